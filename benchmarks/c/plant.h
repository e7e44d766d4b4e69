/* The plant: derivative of the state and one Runge-Kutta step, after sitl/model/derivative.py and integrate.py. */

#define POINTS 7

typedef struct {
    double points[POINTS][3], stiffness, damping, friction, slip, ground_down, standing_pitch;
} Gear;

typedef struct { double motor_tau, flap_tau; } Actuators;
typedef struct { double thrust_left, thrust_right, flap_left, flap_right; } Actuation;

typedef union {
    struct {
        double n, e, d, vn, ve, vd, qw, qx, qy, qz, p, q, r, rotor_left, rotor_right, flap_left, flap_right;
    };
    double all[17];
} State;

static inline Load ground_loads(const Gear *g, const State *s) {
    Load sum = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    if (s->d + 1.0 < g->ground_down) return sum;
    Quat q = {s->qw, s->qx, s->qy, s->qz};
    for (int i = 0; i < POINTS; i++) {
        Vec at = {g->points[i][0], g->points[i][1], g->points[i][2]};
        double depth = s->d + rotate(q, at).z - g->ground_down;
        if (depth <= 0.0) continue;
        Vec spin = {s->q * at.z - s->r * at.y, s->r * at.x - s->p * at.z, s->p * at.y - s->q * at.x};
        spin = rotate(q, spin);
        double vn = s->vn + spin.x, ve = s->ve + spin.y, vd = s->vd + spin.z;
        double normal = most(0.0, g->stiffness * depth + g->damping * vd);
        double grip = -g->friction * normal / sqrt(vn * vn + ve * ve + g->slip * g->slip);
        Vec f = rotate_back(q, (Vec){grip * vn, grip * ve, -normal});
        sum.force.x += f.x, sum.force.y += f.y, sum.force.z += f.z;
        sum.moment.x = sum.moment.x + at.y * f.z - at.z * f.y;
        sum.moment.y = sum.moment.y + at.z * f.x - at.x * f.z;
        sum.moment.z = sum.moment.z + at.x * f.y - at.y * f.x;
    }
    return sum;
}

static inline State derivative(
    const Airframe *a, const Gear *g, const Actuators *lag, const State *s, const Actuation *command, Vec wind
) {
    Quat at = {s->qw, s->qx, s->qy, s->qz};
    Vec air = rotate_back(at, (Vec){s->vn - wind.x, s->ve - wind.y, s->vd - wind.z});
    double left = thrust_of(a, s->rotor_left), right = thrust_of(a, s->rotor_right);
    double wake_left = wake_speed(a, left, air.x), wake_right = wake_speed(a, right, air.x);
    Load wing = wing_loads(a, air.x, air.z, wake_left, wake_right);
    Load flap = flap_loads(a, air.z, wake_left, wake_right, s->flap_left, s->flap_right);
    Load ground = ground_loads(g, s);
    double m = a->n.mass, kv = a->n.drag_linear, kt = a->n.drag_quadratic;
    Vec force = {
        left + right + wing.force.x + -m * (kv + kt * fabs(air.x)) * air.x + ground.force.x,
        a->n.side_force * (left - right) + -m * (kv + kt * fabs(air.y)) * air.y + ground.force.y,
        wing.force.z + flap.force.z + -m * (kv + kt * fabs(air.z)) * air.z + ground.force.z,
    };
    double torque = a->n.torque_coefficient * (s->rotor_left * s->rotor_left - s->rotor_right * s->rotor_right);
    Vec moment = {
        torque + wing.moment.x + flap.moment.x + ground.moment.x,
        wing.moment.y + flap.moment.y + ground.moment.y,
        a->n.prop_arm * (left - right) + wing.moment.z + ground.moment.z,
    };
    Vec world = rotate(at, force);
    double p = s->p, q = s->q, r = s->r;
    double motor = lag->motor_tau > 0.0 ? 1.0 / lag->motor_tau : 0.0;
    double servo = lag->flap_tau > 0.0 ? 1.0 / lag->flap_tau : 0.0;
    return (State){{
        s->vn, s->ve, s->vd,
        world.x / m, world.y / m, world.z / m + GRAVITY,
        0.5 * (-s->qx * p - s->qy * q - s->qz * r),
        0.5 * (s->qw * p + s->qy * r - s->qz * q),
        0.5 * (s->qw * q + s->qz * p - s->qx * r),
        0.5 * (s->qw * r + s->qx * q - s->qy * p),
        (moment.x - (a->n.jzz - a->n.jyy) * q * r) / a->n.jxx,
        (moment.y - (a->n.jxx - a->n.jzz) * r * p) / a->n.jyy,
        (moment.z - (a->n.jyy - a->n.jxx) * p * q) / a->n.jzz,
        (rotor_speed(a, command->thrust_left) - s->rotor_left) * motor,
        (rotor_speed(a, command->thrust_right) - s->rotor_right) * motor,
        (command->flap_left - s->flap_left) * servo,
        (command->flap_right - s->flap_right) * servo,
    }};
}

static inline State moved(const State *s, double h, const State *k) {
    State x;
    for (int i = 0; i < 17; i++) x.all[i] = s->all[i] + h * k->all[i];
    return x;
}

static inline State step(
    const Airframe *a, const Gear *g, const Actuators *lag, State s, const Actuation *command, Vec wind, double h
) {
    if (lag->motor_tau <= 0.0) {
        s.rotor_left = rotor_speed(a, command->thrust_left);
        s.rotor_right = rotor_speed(a, command->thrust_right);
    }
    if (lag->flap_tau <= 0.0) s.flap_left = command->flap_left, s.flap_right = command->flap_right;
    State k1 = derivative(a, g, lag, &s, command, wind), x = moved(&s, 0.5 * h, &k1);
    State k2 = derivative(a, g, lag, &x, command, wind);
    x = moved(&s, 0.5 * h, &k2);
    State k3 = derivative(a, g, lag, &x, command, wind);
    x = moved(&s, h, &k3);
    State k4 = derivative(a, g, lag, &x, command, wind);
    for (int i = 0; i < 17; i++)
        s.all[i] = s.all[i] + h / 6.0 * k1.all[i] + h / 3.0 * k2.all[i] + h / 3.0 * k3.all[i] + h / 6.0 * k4.all[i];
    double k = 1.0 / sqrt(s.qw * s.qw + s.qx * s.qx + s.qy * s.qy + s.qz * s.qz);
    s.qw *= k, s.qx *= k, s.qy *= k, s.qz *= k;
    return s;
}
