/* Numbers, rotations and force laws of the vehicle, written by hand after sitl/model: the benchmark's yardstick.
 *
 * Structs that Python fills hold doubles only, in the order of the NamedTuples of the same name.
 */
#include <math.h>

#define GRAVITY 9.80665
#define PI 3.14159265358979323846

typedef struct { double x, y, z; } Vec;
typedef struct { double w, x, y, z; } Quat;
typedef struct { Vec force, moment; } Load;

typedef struct {
    double mass, jxx, jyy, jzz, density, wing_area, wing_moment_area, span, chord, ac_behind, lift_slope, lift_zero,
        drag_zero, oswald, moment_slope, moment_zero, stall_angle, stall_sharpness, plate_drag, immersed, flap_area,
        flap_lift, flap_moment, flap_roll_arm, flap_max, prop_radius, slipstream_ratio, prop_arm, wake_arm,
        thrust_coefficient, torque_coefficient, thrust_min, thrust_max, side_force, drag_linear, drag_quadratic;
} Numbers;

/* What follows from the numbers alone, worked out once. */
typedef struct {
    Numbers n;
    double induced, stall_far, disc, weight;
} Airframe;

static inline Airframe airframe_of(const Numbers *n) {
    double radius = n->slipstream_ratio * n->prop_radius;
    Airframe a = {*n,
                  1.0 / (PI * n->oswald * (n->span * n->span / n->wing_area)),
                  exp(-2.0 * n->stall_sharpness * n->stall_angle),
                  n->density * PI * radius * radius,
                  n->mass * GRAVITY};
    return a;
}

static inline double least(double a, double b) { return a < b ? a : b; }
static inline double most(double a, double b) { return a > b ? a : b; }
static inline double within(double x, double limit) { return most(-limit, least(limit, x)); }

static inline Vec rotate(Quat q, Vec v) {
    double tx = 2.0 * (q.y * v.z - q.z * v.y), ty = 2.0 * (q.z * v.x - q.x * v.z), tz = 2.0 * (q.x * v.y - q.y * v.x);
    Vec r = {v.x + q.w * tx + q.y * tz - q.z * ty, v.y + q.w * ty + q.z * tx - q.x * tz,
             v.z + q.w * tz + q.x * ty - q.y * tx};
    return r;
}

static inline Vec rotate_back(Quat q, Vec v) {
    Quat back = {q.w, -q.x, -q.y, -q.z};
    return rotate(back, v);
}

static inline double thrust_of(const Airframe *a, double rotor) { return a->n.thrust_coefficient * rotor * rotor; }

static inline double rotor_speed(const Airframe *a, double thrust) {
    return sqrt(most(thrust, 0.0) / a->n.thrust_coefficient);
}

static inline double wake_speed(const Airframe *a, double thrust, double u) {
    return 0.5 * (u + sqrt(u * u + 4.0 * most(thrust, 0.0) / a->disc));
}

typedef struct { double x, z, moment; } Panel;

static inline Panel panel(const Airframe *a, double u, double w, double fraction) {
    double speed = sqrt(u * u + w * w);
    if (speed < 1e-6) return (Panel){0.0, 0.0, 0.0};
    double k = 1.0 / speed, c = k * u, s = k * w, alpha = atan2(w, u);
    double near = exp(least(35.0, a->n.stall_sharpness * (a->n.stall_angle - fabs(alpha))));
    double far = near * a->stall_far;
    double gone = 1.0 - near / ((1.0 + near) * (1.0 + far)), kept = 1.0 - gone;
    double attached = a->n.lift_zero + a->n.lift_slope * alpha;
    double attached_drag = a->n.drag_zero + attached * attached * a->induced;
    double normal = a->n.plate_drag * s, plate_moment = -0.5 / PI * fabs(alpha) * normal;
    double lift = kept * attached + gone * normal * c;
    double drag = kept * attached_drag + gone * (a->n.drag_zero + normal * s);
    double moment = kept * (a->n.moment_zero + a->n.moment_slope * alpha) + gone * plate_moment;
    double q = 0.5 * a->n.density * speed * speed * fraction;
    double fx = q * a->n.wing_area * (lift * s - drag * c), fz = q * a->n.wing_area * (-lift * c - drag * s);
    return (Panel){fx, fz, q * a->n.wing_moment_area * a->n.chord * moment + fz * a->n.ac_behind};
}

static inline Load wing_loads(const Airframe *a, double u, double w, double wake_left, double wake_right) {
    double half = 0.5 * a->n.immersed, arm = a->n.wake_arm;
    Panel l = panel(a, wake_left, w, half), r = panel(a, wake_right, w, half), f = panel(a, u, w, 1.0 - a->n.immersed);
    return (Load){{l.x + r.x + f.x, 0.0, l.z + r.z + f.z},
                  {arm * (r.z - l.z), l.moment + r.moment + f.moment, arm * (l.x - r.x)}};
}

static inline double flap_pressure(const Airframe *a, double w, double wake) {
    return 0.5 * a->n.density * (wake * wake + w * w);
}

static inline Load flap_loads(const Airframe *a, double w, double wake_left, double wake_right, double left, double right) {
    double l = flap_pressure(a, w, wake_left) * a->n.flap_area * left;
    double r = flap_pressure(a, w, wake_right) * a->n.flap_area * right;
    return (Load){{0.0, 0.0, -a->n.flap_lift * (l + r)},
                  {a->n.flap_roll_arm * a->n.flap_lift * (l - r), a->n.chord * a->n.flap_moment * (l + r), 0.0}};
}
