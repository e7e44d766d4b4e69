/* What the benchmark calls: each takes and leaves arrays of doubles, in the order of the NamedTuples in Python. */
#include "vehicle.h"
#include "cascade.h"
#include "plant.h"

/* d/dt of `count` states, each under the same command and wind. */
void derivatives(
    const Numbers *numbers, const Gear *gear, const Actuators *lag, const State *states, const Actuation *command,
    const Vec *wind, long count, State *rates
) {
    Airframe a = airframe_of(numbers);
    for (long i = 0; i < count; i++) rates[i] = derivative(&a, gear, lag, states + i, command, *wind);
}

/* `count` Runge-Kutta steps of `h` seconds. */
void plant(
    const Numbers *numbers, const Gear *gear, const Actuators *lag, State *state, const Actuation *command,
    const Vec *wind, double h, long count
) {
    Airframe a = airframe_of(numbers);
    State s = *state;
    for (long i = 0; i < count; i++) s = step(&a, gear, lag, s, command, *wind, h);
    *state = s;
}

/* `count` control steps of `dt_us` from time zero on, one Runge-Kutta step in each, the state known to the cascade. */
void closed_loop(
    const Numbers *flown, const Numbers *believed, const Gear *gear, const Actuators *lag, const Gains *gains,
    const Settings *settings, const Following *following, const double *start_s, const double *coefficients,
    double end_s, long pieces, State *state, Memory *memory, const Vec *wind, long dt_us, long count
) {
    Airframe a = airframe_of(flown), b = airframe_of(believed);
    Trajectory trajectory = {start_s, coefficients, end_s, (int)pieces};
    State s = *state;
    Memory m = *memory;
    double dt = dt_us * 1e-6;
    for (long i = 0; i < count; i++) {
        Reference reference = sampled(&trajectory, i * dt_us * 1e-6);
        Nav nav = {{s.n, s.e, s.d}, {s.vn, s.ve, s.vd}, {s.qw, s.qx, s.qy, s.qz}, {s.p, s.q, s.r}};
        Outputs x = cascade(&b, gains, settings, following, &m, &nav, &reference, dt);
        Actuation command = {x.thrust_left, x.thrust_right, x.flap_left, x.flap_right};
        s = step(&a, gear, lag, s, &command, *wind, dt);
    }
    *state = s, *memory = m;
}
