/* The cascade, following a trajectory with quaternion error: after sitl/control (steering and the paper's YXZ error,
 * which a tracked flight does not use, are left out). */

#define LOOK 0.02
#define STEP 1e-4

typedef struct { double p, i, d; } Pid;
typedef struct { Pid x, y, z; } Loop;
typedef struct { Loop position, velocity, attitude, rate; } Gains;

typedef struct {
    double ff_velocity, ff_acceleration, ff_inverse, quaternion_error, velocity_max, acceleration_max, velocity_d_tau,
        rate_d_tau, motor_tau, flap_tau, force_bandwidth, moment_bandwidth, slipstream_floor, thrust_floor,
        thrust_recover, braking_x, braking_y, braking_z, lean_max;
} Settings;

typedef struct { double pitch, lean, thrust, flap, slope, residual; } Trim;
typedef struct { Trim before, now, after; } Course;

typedef struct {
    Vec position_integral, velocity_integral, attitude_integral, rate_integral, velocity_smoothed, rate_smoothed;
    Course reference_trims;
    Trim command_trim;
    double flow_left, flow_right, flap_left, flap_right;
    Vec acceleration, angular, velocity_seen, rates_seen;
    double observing, thrust_short, roll_short, pitch_short, yaw_short;
} Memory;

typedef struct { const double *start, *coefficients; double end; int pieces; } Trajectory;
typedef struct { Vec at, v, a, j; double heading, heading_rate; } Reference;
typedef struct { Vec at, v; Quat q; Vec rates; } Nav;
typedef struct { double follow_position[3], follow_velocity[3], aloft; } Following;
typedef struct { double thrust_left, thrust_right, flap_left, flap_right; } Outputs;

static inline double hold(double integral, double error, double dt, double limit, int held) {
    double next = integral + error * dt;
    return held && fabs(next) > fabs(integral) ? integral : within(next, limit);
}

static inline Vec hold3(Vec i, Vec e, double dt, double limit, int x, int y, int z) {
    return (Vec){hold(i.x, e.x, dt, limit, x), hold(i.y, e.y, dt, limit, y), hold(i.z, e.z, dt, limit, z)};
}

static inline double pid(Pid g, double e, double i, double rate) { return g.p * e + g.i * i + g.d * rate; }

static inline Vec pid3(Loop g, Vec e, Vec i, Vec rate, Vec ff) {
    return (Vec){pid(g.x, e.x, i.x, rate.x) + ff.x, pid(g.y, e.y, i.y, rate.y) + ff.y, pid(g.z, e.z, i.z, rate.z) + ff.z};
}

static inline double low_pass(double x, double to, double dt, double tau) { return x + (to - x) * (dt / (tau + dt)); }

static inline Vec filtered(Vec *smoothed, Vec e, double dt, double tau) {
    if (tau <= 0.0) {
        *smoothed = e;
        return (Vec){0.0, 0.0, 0.0};
    }
    smoothed->x = low_pass(smoothed->x, e.x, dt, tau);
    smoothed->y = low_pass(smoothed->y, e.y, dt, tau);
    smoothed->z = low_pass(smoothed->z, e.z, dt, tau);
    return (Vec){(e.x - smoothed->x) / tau, (e.y - smoothed->y) / tau, (e.z - smoothed->z) / tau};
}

static inline Vec heading_frame(double heading, Vec v) {
    double c = cos(heading), s = sin(heading);
    return (Vec){c * v.x + s * v.y, c * v.y - s * v.x, v.z};
}

static inline Quat multiply(Quat a, Quat b) {
    return (Quat){a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
                  a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}

static inline Quat about_z(double angle) { return (Quat){cos(0.5 * angle), 0.0, 0.0, sin(0.5 * angle)}; }

static inline double wrapped(double angle) {
    double x = fmod(angle + PI, 2.0 * PI);
    return (x < 0.0 ? x + 2.0 * PI : x) - PI;
}

/* reference */

static inline void polynomial(const double *c, double t, double out[4]) {
    out[0] = ((((c[5] * t + c[4]) * t + c[3]) * t + c[2]) * t + c[1]) * t + c[0];
    out[1] = (((5.0 * c[5] * t + 4.0 * c[4]) * t + 3.0 * c[3]) * t + 2.0 * c[2]) * t + c[1];
    out[2] = ((20.0 * c[5] * t + 12.0 * c[4]) * t + 6.0 * c[3]) * t + 2.0 * c[2];
    out[3] = (60.0 * c[5] * t + 24.0 * c[4]) * t + 6.0 * c[3];
}

static inline Reference sampled(const Trajectory *x, double t_s) {
    int k = x->pieces - 1;
    while (k > 0 && t_s < x->start[k]) k--;
    int resting = t_s < x->start[0] || t_s >= x->end;
    double t = most(least(t_s, x->end) - x->start[k], 0.0), n[4], e[4], d[4], h[4];
    const double *c = x->coefficients + 24 * k;
    polynomial(c, t, n), polynomial(c + 6, t, e), polynomial(c + 12, t, d), polynomial(c + 18, t, h);
    Vec zero = {0.0, 0.0, 0.0};
    if (resting) return (Reference){{n[0], e[0], d[0]}, zero, zero, zero, h[0], 0.0};
    return (Reference){{n[0], e[0], d[0]}, {n[1], e[1], d[1]}, {n[2], e[2], d[2]}, {n[3], e[3], d[3]}, h[0], h[1]};
}

/* the trim's inverse */

static inline double balance(const Airframe *a, Vec force, Vec air, double moment, double pitch, Trim *out, double thrust) {
    double c = cos(pitch), s = sin(pitch);
    double gx = c * force.x - s * force.z, gz = s * force.x + c * force.z, along = sqrt(gx * gx + force.y * force.y);
    double plane = c * air.x - s * air.z, w = s * air.x + c * air.z;
    double u = along > 1e-9 ? (gx * plane + force.y * air.y) / along : plane;
    double wake = wake_speed(a, 0.5 * thrust, u);
    Panel i = panel(a, wake, w, a->n.immersed), f = panel(a, u, w, 1.0 - a->n.immersed);
    double area = 2.0 * a->n.flap_area * flap_pressure(a, w, wake);
    double flap = within((moment - i.moment - f.moment) / (area * a->n.chord * a->n.flap_moment), a->n.flap_max);
    out->flap = flap;
    out->thrust = most(2.0 * a->n.thrust_min, least(2.0 * a->n.thrust_max, along - i.x - f.x));
    out->lean = gx; /* made an angle by whoever keeps it */
    return gz - i.z - f.z - -area * a->n.flap_lift * flap;
}

static inline Trim refined(const Airframe *a, Vec force, Vec air, double moment, Trim start, double slope) {
    Trim x, ahead;
    x.residual = balance(a, force, air, moment, start.pitch, &x, start.thrust);
    x.lean = atan2(force.y, x.lean);
    x.slope = slope;
    if (isnan(slope)) {
        x.slope = (balance(a, force, air, moment, start.pitch + STEP, &ahead, start.thrust) - x.residual) / STEP;
        if (fabs(x.slope) < 1.0) x.slope = x.slope >= 0.0 ? 1.0 : -1.0;
    }
    x.pitch = start.pitch - within(x.residual / x.slope, 0.2);
    return x;
}

static inline void needed(const Airframe *a, const Reference *r, double h, Vec *force, Vec *air) {
    double k = 0.5 * h * h, m = a->n.mass, heading = r->heading + h * r->heading_rate;
    Vec v = {r->v.x + h * r->a.x + k * r->j.x, r->v.y + h * r->a.y + k * r->j.y, r->v.z + h * r->a.z + k * r->j.z};
    Vec f = {m * (r->a.x + h * r->j.x), m * (r->a.y + h * r->j.y), m * (r->a.z + h * r->j.z - GRAVITY)};
    *force = heading_frame(heading, f), *air = heading_frame(heading, v);
}

static inline Course reference_needs(const Airframe *a, const Reference *r, Course start, Vec *rates, Vec *moment) {
    Vec f, v, fb, vb, fa, va;
    needed(a, r, 0.0, &f, &v), needed(a, r, -LOOK, &fb, &vb), needed(a, r, LOOK, &fa, &va);
    Trim now = refined(a, f, v, 0.0, start.now, NAN);
    Trim before = refined(a, fb, vb, 0.0, start.before, now.slope), after = refined(a, fa, va, 0.0, start.after, now.slope);
    double pitch_rate = (after.pitch - before.pitch) / (2.0 * LOOK), lean_rate = (after.lean - before.lean) / (2.0 * LOOK);
    double pitching = (after.pitch - 2.0 * now.pitch + before.pitch) / (LOOK * LOOK);
    double leaning = (after.lean - 2.0 * now.lean + before.lean) / (LOOK * LOOK);
    Vec turn = {-sin(now.pitch) * r->heading_rate, pitch_rate, cos(now.pitch) * r->heading_rate};
    *rates = rotate_back(about_z(now.lean), turn);
    rates->z += lean_rate;
    *moment = (Vec){0.0, a->n.jyy * pitching, a->n.jzz * leaning};
    return (Course){before, now, after};
}

/* disturbance observer */

static inline double tracked(double d, double before, double now, double model, double k, double limit, double dt) {
    return within(d + k * ((now - before) / dt - model - d), limit);
}

static inline void observe(
    const Airframe *a, const Settings *s, Memory *m, const Nav *nav, double w, double wake_left, double wake_right,
    const Load *wing, int aloft, double dt
) {
    if (!aloft) {
        double k = exp(-dt / 0.1);
        m->acceleration = (Vec){k * m->acceleration.x, k * m->acceleration.y, k * m->acceleration.z};
        m->angular = (Vec){k * m->angular.x, k * m->angular.y, k * m->angular.z};
    } else if (m->observing > 0.0) {
        Load flap = flap_loads(a, w, wake_left, wake_right, m->flap_left, m->flap_right);
        double difference = m->flow_left - m->flow_right, mass = a->n.mass;
        double torque = a->n.torque_coefficient / a->n.thrust_coefficient * difference;
        Vec model = rotate(nav->q, (Vec){(m->flow_left + m->flow_right + wing->force.x) / mass,
                                         a->n.side_force * difference / mass, (wing->force.z + flap.force.z) / mass});
        model.z += GRAVITY;
        double p = nav->rates.x, q = nav->rates.y, r = nav->rates.z;
        Vec turning = {
            (torque + wing->moment.x + flap.moment.x - (a->n.jzz - a->n.jyy) * q * r) / a->n.jxx,
            (wing->moment.y + flap.moment.y - (a->n.jxx - a->n.jzz) * r * p) / a->n.jyy,
            (a->n.prop_arm * difference + wing->moment.z - (a->n.jyy - a->n.jxx) * p * q) / a->n.jzz,
        };
        double kf = 1.0 - exp(-s->force_bandwidth * dt), km = 1.0 - exp(-s->moment_bandwidth * dt);
        Vec v = m->velocity_seen, o = m->rates_seen, *d = &m->acceleration, *t = &m->angular;
        *d = (Vec){tracked(d->x, v.x, nav->v.x, model.x, kf, 6.0, dt), tracked(d->y, v.y, nav->v.y, model.y, kf, 6.0, dt),
                   tracked(d->z, v.z, nav->v.z, model.z, kf, 6.0, dt)};
        *t = (Vec){tracked(t->x, o.x, p, turning.x, km, 20.0, dt), tracked(t->y, o.y, q, turning.y, km, 20.0, dt),
                   tracked(t->z, o.z, r, turning.z, km, 20.0, dt)};
    }
    m->velocity_seen = nav->v, m->rates_seen = nav->rates, m->observing = 1.0;
}

/* attitude */

static inline double braked(double e, double p, double braking) {
    double linear = p > 0.0 ? braking / (p * p) : INFINITY;
    if (fabs(e) <= linear) return e;
    return copysign(sqrt(2.0 * braking * (fabs(e) - 0.5 * linear)) / p, e);
}

static inline Vec attitude_error(Quat q, Quat target, double *nose) {
    Quat x = multiply((Quat){q.w, -q.x, -q.y, -q.z}, target);
    double nx = 1.0 - 2.0 * (x.y * x.y + x.z * x.z), ny = 2.0 * (x.x * x.y + x.w * x.z), nz = 2.0 * (x.x * x.z - x.w * x.y);
    double sine = sqrt(ny * ny + nz * nz), pitch = 0.0, yaw = nx > 0.0 ? 0.0 : PI;
    if (sine >= 1e-12) {
        double angle = atan2(sine, nx);
        pitch = -nz / sine * angle, yaw = ny / sine * angle;
    }
    *nose = nx;
    return (Vec){most(0.0, nx) * wrapped(2.0 * atan2(x.x, x.w)), pitch, yaw};
}

static inline double approach(double dt, double tau) { return tau > 0.0 ? 1.0 - exp(-dt / tau) : 1.0; }

static inline double spun_up(double thrust, double command, double gain) {
    double root = sqrt(thrust);
    root += gain * (sqrt(most(command, 0.0)) - root);
    return root * root;
}

static inline Outputs allocate(
    const Airframe *a, double force_x, Vec moment, double u, double w, const Load *wing, Memory *m, double flap_floor,
    double floor
) {
    double low = a->n.thrust_min, high = a->n.thrust_max;
    double wanted = (moment.z - wing->moment.z) / a->n.prop_arm, difference = within(wanted, high - low);
    double wanted_total = most(floor, force_x - wing->force.x);
    double total = most(2.0 * low + fabs(difference), least(2.0 * high - fabs(difference), wanted_total));
    double torque = a->n.torque_coefficient / a->n.thrust_coefficient * difference;
    double pitch = (moment.y - wing->moment.y) / (a->n.flap_area * a->n.chord * a->n.flap_moment);
    double roll = (moment.x - wing->moment.x - torque) / (a->n.flap_area * a->n.flap_roll_arm * a->n.flap_lift);
    double q_left = flap_pressure(a, w, wake_speed(a, most(m->flow_left, flap_floor), u));
    double q_right = flap_pressure(a, w, wake_speed(a, most(m->flow_right, flap_floor), u));
    double left = (pitch + roll) / (2.0 * q_left), right = (pitch - roll) / (2.0 * q_right), limit = a->n.flap_max;
    double sum = within(0.5 * (left + right), limit), room = most(0.4 * limit, limit - fabs(sum));
    double part = within(0.5 * (left - right), room);
    sum = within(sum, limit - fabs(part));
    m->thrust_short = fabs(total - wanted_total) < 1e-9 ? 0.0 : 1.0;
    m->roll_short = fabs(part - 0.5 * (left - right)) < 1e-9 ? 0.0 : 1.0;
    m->pitch_short = fabs(sum - 0.5 * (left + right)) < 1e-9 ? 0.0 : 1.0;
    m->yaw_short = fabs(difference - wanted) < 1e-9 ? 0.0 : 1.0;
    return (Outputs){0.5 * (total + difference), 0.5 * (total - difference), sum + part, sum - part};
}

static inline Outputs cascade(
    const Airframe *a, const Gains *g, const Settings *s, const Following *f, Memory *m, const Nav *nav,
    const Reference *ref, double dt
) {
    int thrust_held = m->thrust_short > 0.0, tilt_held = m->pitch_short > 0.0 || m->yaw_short > 0.0;
    int roll_held = m->roll_short > 0.0, pitch_held = m->pitch_short > 0.0, yaw_held = m->yaw_short > 0.0;
    Vec air = rotate_back(nav->q, nav->v);
    double wake_left = wake_speed(a, m->flow_left, air.x), wake_right = wake_speed(a, m->flow_right, air.x);
    Load wing = wing_loads(a, air.x, air.z, wake_left, wake_right);
    observe(a, s, m, nav, air.z, wake_left, wake_right, &wing, f->aloft > 0.0, dt);

    const double *fp = f->follow_position, *fv = f->follow_velocity;
    Vec e = {fp[0] * (ref->at.x - nav->at.x), fp[1] * (ref->at.y - nav->at.y), fp[2] * (ref->at.z - nav->at.z)};
    m->position_integral = hold3(m->position_integral, e, dt, 5.0, tilt_held, tilt_held, thrust_held);
    double k = s->ff_velocity;
    Vec ff = {fp[0] == 0.0 ? ref->v.x : k * ref->v.x, fp[1] == 0.0 ? ref->v.y : k * ref->v.y,
              fp[2] == 0.0 ? ref->v.z : k * ref->v.z};
    Vec lag = {fp[0] * (ref->v.x - nav->v.x), fp[1] * (ref->v.y - nav->v.y), fp[2] * (ref->v.z - nav->v.z)};
    Vec v = pid3(g->position, e, m->position_integral, lag, ff);
    v = (Vec){within(v.x, s->velocity_max), within(v.y, s->velocity_max), within(v.z, s->velocity_max)};

    Vec whole = {v.x - nav->v.x, v.y - nav->v.y, v.z - nav->v.z};
    e = (Vec){fv[0] * whole.x, fv[1] * whole.y, fv[2] * whole.z};
    int far = whole.x * whole.x + whole.y * whole.y + whole.z * whole.z > 4.0;
    tilt_held |= far, thrust_held |= far;
    m->velocity_integral = hold3(m->velocity_integral, e, dt, 10.0, tilt_held, tilt_held, thrust_held);
    Vec rate = filtered(&m->velocity_smoothed, e, dt, s->velocity_d_tau);
    k = s->ff_acceleration;
    ff = (Vec){(fv[0] == 0.0 ? ref->a.x : k * ref->a.x) - m->acceleration.x,
               (fv[1] == 0.0 ? ref->a.y : k * ref->a.y) - m->acceleration.y,
               (fv[2] == 0.0 ? ref->a.z : k * ref->a.z) - m->acceleration.z};
    Vec want = pid3(g->velocity, e, m->velocity_integral, rate, ff);
    double lift = most(0.2 * GRAVITY, GRAVITY - within(want.z, s->acceleration_max));
    double level = sqrt(want.x * want.x + want.y * want.y), allowed = least(s->acceleration_max, lift * tan(s->lean_max));
    k = level > allowed ? allowed / level : 1.0;
    Vec specific = {k * want.x, k * want.y, -lift};
    if (f->aloft == 0.0 && hypot(nav->v.x, nav->v.y) > 0.1) specific.z = least(specific.z, -1.15 * GRAVITY);
    Vec force = {a->n.mass * specific.x, a->n.mass * specific.y, a->n.mass * specific.z};

    Vec rates_ff = {0.0, 0.0, 0.0}, moment_ff = {0.0, 0.0, 0.0};
    if (s->ff_inverse > 0.0) {
        m->reference_trims = reference_needs(a, ref, m->reference_trims, &rates_ff, &moment_ff);
    } else {
        Vec f0, v0;
        needed(a, ref, 0.0, &f0, &v0);
        Trim now = refined(a, f0, v0, 0.0, m->reference_trims.now, NAN);
        m->reference_trims = (Course){now, now, now};
    }
    moment_ff.x -= a->n.jxx * m->angular.x, moment_ff.y -= a->n.jyy * m->angular.y, moment_ff.z -= a->n.jzz * m->angular.z;
    Vec level_force = heading_frame(ref->heading, force), level_air = heading_frame(ref->heading, nav->v);
    m->command_trim = refined(a, level_force, level_air, moment_ff.y, m->command_trim, NAN);
    double half = 0.5 * m->command_trim.pitch;
    Quat target = multiply(multiply(about_z(ref->heading), (Quat){cos(half), 0.0, sin(half), 0.0}),
                           about_z(m->command_trim.lean));

    double nose, size;
    e = attitude_error(nav->q, target, &nose);
    size = sqrt(e.y * e.y + e.z * e.z), k = 1.0;
    if (size >= 1e-9) {
        double braking = least(s->braking_y * size / most(fabs(e.y), 1e-9), s->braking_z * size / most(fabs(e.z), 1e-9));
        k = braked(size, most(g->attitude.y.p, g->attitude.z.p), braking) / size;
    }
    e = (Vec){braked(e.x, g->attitude.x.p, s->braking_x), k * e.y, k * e.z};
    m->attitude_integral = hold3(m->attitude_integral, e, dt, 1.0, roll_held, pitch_held, yaw_held);
    Vec damping = {rates_ff.x - nav->rates.x, rates_ff.y - nav->rates.y, rates_ff.z - nav->rates.z};
    Vec rates = pid3(g->attitude, e, m->attitude_integral, damping, rates_ff);

    e = (Vec){rates.x - nav->rates.x, rates.y - nav->rates.y, rates.z - nav->rates.z};
    m->rate_integral = hold3(m->rate_integral, e, dt, 2.0, roll_held, pitch_held, yaw_held);
    rate = filtered(&m->rate_smoothed, e, dt, s->rate_d_tau);
    Vec demand = pid3(g->rate, e, m->rate_integral, rate, moment_ff);

    double off = most(0.0, least(1.0, 1.0 - nose / 0.7));
    double floor = s->thrust_floor + off * most(0.0, s->thrust_recover - s->thrust_floor);
    Outputs x = allocate(a, rotate_back(nav->q, force).x, demand, air.x, air.z, &wing, m, 0.5 * s->slipstream_floor, floor);
    double motor = approach(dt, s->motor_tau), servo = approach(dt, s->flap_tau);
    m->flow_left = spun_up(m->flow_left, x.thrust_left, motor), m->flow_right = spun_up(m->flow_right, x.thrust_right, motor);
    m->flap_left += servo * (x.flap_left - m->flap_left), m->flap_right += servo * (x.flap_right - m->flap_right);
    return x;
}
