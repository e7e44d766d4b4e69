"""What the report says beside its tables: where print and physics part, and why. Numbers come from the evaluation."""

import math

import numpy as np

from sitl.frames import GRAVITY_M_S2
from sitl.model.airframe import Airframe
from sitl.model.propulsion import wake_speed
from sitl.model.trim import solve
from sitl.page import told
from sitl.reproduce import beyond
from sitl.reproduce.cases import ABLATIONS, MISSIONS, VIEWS
from sitl.reproduce.evaluation import Evaluation
from sitl.reproduce.fly import Flight
from sitl.reproduce.printed import AXES, OVERALL, ROWS
from sitl.reproduce.tables import ROUNDING, figures, score, tracking
from sitl.vehicle_spec import load_vehicle

Notes = dict[str, list[str]]  # by Table.key
_MARGINS = (
    "ω_c: the highest frequency at which |L| = 1, ω_B: where the closed loop has lost 3 dB, both in rad/s; GM: gain "
    "margin in dB; PM: phase margin in degrees; max |S|: the greatest sensitivity. Each loop is closed around those "
    "inside it, and cut at its own measurement. The disturbance observer is left out throughout."
)
_LIMITS = (
    "The zero: a flap that pitches the nose forward pushes the vehicle backward first; no gain moves it, and a loop "
    "north faster than about half of it answers the wrong way for longer than it has time. Saturation: beyond the "
    "angles given the printed or tuned gains ask for all that flaps or propellers have, and the loop is no longer the "
    "one of these tables."
)
_LEG_S, _LEGS_M, _LEG_PEAK_M_S = 10.0, (5.0, 10.0), 20.0 / 10.0 * 15.0 / 8.0
_CIRCLE_LEAST_N = 12.526  # printed


def notes(evaluation: Evaluation) -> Notes:
    beyond_paper = beyond.notes(evaluation)
    ranges = [_yaw(evaluation), _circle_yaw(evaluation), _pitch(evaluation), _thrust(), _shape()]
    return {
        "overview": [
            _feedback(evaluation),
            *_overall(evaluation),
            _yaw(evaluation),
            _thrust(),
            _side_force(evaluation),
            beyond_paper[0],
        ],
        **{f"{mission}-true": _tracking(evaluation, mission) for mission in MISSIONS},
        "seeds": [_seeds(evaluation)],
        "ranges": ranges,
        "trim": [
            "Of the two airframe files neither trims where the paper does: near the printed 93° only the literal one, "
            "whose flaps push along +z, and near the printed thrust neither (see the ranges above)."
        ],
        "ablations": _ablations(evaluation),
        "readings": _readings(evaluation),
        "limits": [_LIMITS],
        "margins-paper-ideal": [_MARGINS],
        "trials": beyond_paper,
    }


def _airframe() -> Airframe:
    return load_vehicle("yawsitter").airframe.airframe


def _feedback(evaluation: Evaluation) -> str:
    """∫e of a loop without velocity feed-forward: v = K_p e + K_d ė, and e is zero at both ends of a leg."""
    gains = load_vehicle("yawsitter").gains
    travel = {"x": 40.0, "y": 20.0, "z": 10.0}
    owed = " / ".join(f"{d / gains[f'POS_{axis.upper()}_P']:.1f}" for axis, d in travel.items())
    printed = " / ".join(f"{v:.2f}" for v in OVERALL["rectangle"]["iae"])
    flown = " / ".join(f"{v:.1f}" for v in evaluation.flight("feedback", "rectangle").true["iae"])
    return (
        "The printed loops alone can't have flown the printed errors. A position loop V = K_p e + K_d ė trails a "
        "moving reference by about v / K_p, whatever its course in time, so that each way travelled costs way / K_p "
        f"of ∫|e| dt: {owed} m·s for x / y / z of the rectangle, {flown} when flown, against a printed {printed}. A "
        "feed-forward must have been at work that the paper doesn't describe, or the error was measured otherwise "
        "than against the moving reference."
    )


def _overall(evaluation: Evaluation) -> list[str]:
    """One line for every view: how many overall figures lie above print, and which."""
    said = []
    for view in VIEWS[1:]:
        above = [
            f"{mission} {name} {axis} ({1000.0 * value:.1f}, print {1000.0 * printed:.1f} m{unit.strip('[]')})"
            for mission in MISSIONS
            for key, (name, unit) in ((key, label.rsplit(" ", 1)) for key, label in ROWS)
            for axis, value, printed in zip(
                AXES, figures(evaluation, view, mission)[key], OVERALL[mission][key], strict=True
            )
            if value > printed + ROUNDING
        ]
        count = len(MISSIONS) * len(ROWS) * len(AXES)
        rest = f"; above it: {', '.join(above)}" if above else ""
        said.append(f"{view.title}: {count - len(above)} of {count} overall figures at or below print{rest}.")
    return [line[0].upper() + line[1:] for line in said]


def _tracking(evaluation: Evaluation, mission: str) -> list[str]:
    scores = score(tracking(evaluation, mission, "true"))
    return [
        "At or below print: " + "; ".join(f"{title}: {good} of {count} cells" for title, good, count in scores) + ".",
        "Errors are compared by size: the paper doesn't say which way it subtracts. Its “max overshoot” is compared "
        "with the largest |error|, the greatest that an overshoot can be. Single instants are a matter of luck: "
        "print has some below a millimetre, less than any receiver can tell. The overall figures are the "
        "ones to compare.",
    ]


def _seeds(evaluation: Evaluation) -> str:
    def worst(source: str, mission: str) -> str:
        flights = [evaluation.flight("tuned", mission, seed) for seed in evaluation.seeds]
        maes = np.array([(f.true if source == "true" else f.reported)["mae"] for f in flights]).max(axis=0)
        return " / ".join(f"{1000.0 * v:.1f}" for v in maes)

    parts = [f"{m} {worst('true', m)} mm true and {worst('reported', m)} mm reported" for m in MISSIONS]
    return (
        f"Greatest MAE x / y / z over seeds {', '.join(map(str, evaluation.seeds))}: {'; '.join(parts)}. The true "
        "position is the plant's; the reported one is the filter's estimate, which is all that a ground station hears "
        "of. The loop holds the estimate to the reference, so its slow errors show in the true position alone."
    )


def _bound_deg(distance_m: float, seconds: float) -> float:
    """The least greatest lean [°] that takes a vehicle over a distance from rest to rest: 4 d / T² all the time."""
    return math.degrees(math.atan(4.0 * distance_m / seconds**2 / GRAVITY_M_S2))


def _yaw(evaluation: Evaluation) -> str:
    small, large = (_peak(evaluation.flight("feedforward", m)) for m in ("rectangle-20x5", "rectangle"))
    short, long = (_bound_deg(d, _LEG_S) for d in _LEGS_M)
    return (
        f"Yaw on the rectangle peaks at {small:.2f}° when it is 5 m wide and at {large:.2f}° when it is 10 m wide; "
        f"print says −1.60°. By lean alone 5 m from rest to rest in ten seconds take at least {short:.2f}°, 10 m at "
        f"least {long:.2f}°, whatever the course in time. So if the printed yaw is the lean ψ, it fits the text's 20 × "
        "5 and can't be the table's 20 × 10; the paper calls it a deviation and may mean another quantity."
    )


def _circle_yaw(evaluation: Evaluation) -> str:
    smooth, jump = (_peak(evaluation.flight("feedforward", m)) for m in ("circle", "circle-constant-speed"))
    steady = math.degrees(math.atan((2.0 * math.pi * 2.0 / 50.0) ** 2 / 2.0 / GRAVITY_M_S2))
    return (
        f"Yaw on the circle: going round needs {steady:.2f}° steadily, a smooth start {smooth:.2f}° and a start at "
        f"full speed {jump:.2f}° at the peak. The printed 5.7° is more than any of them; its cause isn't printed."
    )


def _pitch(evaluation: Evaluation) -> str:
    low, high = evaluation.flight("feedforward", "rectangle").true["ranges"]["pitch_deg"]
    back = math.degrees(solve(_airframe(), _LEG_PEAK_M_S).pitch_rad)
    return (
        f"The text gives the pitch of hover alone. Along the 20 m legs, {_LEG_PEAK_M_S:.2f} m/s at their middle, it "
        f"goes from {low:.0f}° to {high:.0f}° here; steady flight north at that speed trims at {back:.0f}°. That "
        "follows from the printed lift, whose slipstream part turns with the wing; the paper shows its pitch as a "
        "figure only."
    )


def _thrust() -> str:
    a = _airframe()
    weight = a.mass_kg * GRAVITY_M_S2
    speed = wake_speed(a, 0.5 * weight, 0.0)
    drag = a.drag_at_zero + a.lift_at_zero**2 / (math.pi * a.oswald * a.aspect_ratio)
    force = 0.5 * a.air_density_kg_m3 * speed**2 * a.wing_area_m2 * drag
    return (
        f"Thrust: at constant height T = W sin θ + D, at most {weight:.2f} N + D. The circle's least printed thrust of "
        f"{_CIRCLE_LEAST_N} N needs D ≥ {_CIRCLE_LEAST_N - weight:.2f} N throughout; the printed C_D0 and C_L0, with "
        f"the whole wing in hover's slipstream of {speed:.1f} m/s, come to {force:.2f} N. What makes up the rest isn't "
        "printed, so every measured thrust is lower."
    )


def _shape() -> str:
    return "The circle's climb of 5 s and lap of 50 s are read from its key times; print has radius, altitude and 55 s."


def _peak(flight: Flight) -> float:
    low, high = flight.true["ranges"]["yaw_deg"]
    return float(max(abs(low), abs(high)))


def _impulse(flight: Flight, column: str) -> float:
    """The greatest momentum [N·s] that a force has given by any instant of a flight."""
    t, force = flight.column("t_s"), flight.column(column)
    given = np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(t))
    return float(np.abs(given).max())


def _side_force(evaluation: Evaluation) -> str:
    a = _airframe()
    per_rate = a.side_force_factor / a.prop_arm_m * a.jzz_kg_m2
    flight = evaluation.flight("feedforward", "rectangle")
    side, gravity = (_impulse(flight, f"{cause}_y_N") for cause in ("side_force", "gravity"))
    return (
        "The side force can't carry the vehicle sideways by the paper's own equations: F_y = K_f ΔT and M_z = l_y ΔT "
        f"come from one ΔT, so its momentum is (K_f / l_y) J_zz Δr = {1000.0 * per_rate:.0f} mN·s per rad/s of yaw "
        f"rate, and none once the turning stops. On the rectangle it gave {1000.0 * side:.2f} mN·s at most, gravity "
        f"through the lean {1000.0 * gravity:.0f} mN·s."
    )


def _ablations(evaluation: Evaluation) -> list[str]:
    def mae(key: str) -> float:
        return float(evaluation.flight(f"{key}@yawsitter", "rectangle").true["mae"][1])

    literal = evaluation.flight("literal", "rectangle").true["ranges"]["flap_deg"]
    return [
        "K_f: with this cascade, which moves sideways by leaning, the rectangle's mean y error is "
        f"{1000 * mae('kf-0'):.2f} mm without side force, {1000 * mae('as-is'):.2f} mm with K_f = 0.2 and "
        f"{1000 * mae('kf-03'):.2f} mm with 0.3: it is not what tracks. How the "
        "paper's own allocation, ΔT = M_z / L_y + F_y, would use it can't be flown: as printed it adds newtons to "
        "newton metres per metre.",
        *_coupling(evaluation),
        "Attitude error: at heading zero YXZ angles and quaternion agree to second order; they part at large angles, "
        "as in the step east, and near ±90° of heading, where the YXZ angles are singular.",
        f"The literal airframe's flaps go from {told(literal[0], 1)}° to {told(literal[1], 1)}° on the rectangle"
        + (", into their stops." if max(map(abs, literal)) > 34.9 else "."),
    ]


def _coupling(evaluation: Evaluation) -> list[str]:
    said = []
    for vehicle in evaluation.ablated:
        told = {a.key: f"{evaluation.kicks[a.key, vehicle]:.2f}°" for a in ABLATIONS if not a.overrides}
        said.append(
            f"{vehicle} {told['as-is']} as it is, {told['torque-unknown']} where the allocation doesn't know the "
            f"torque, {told['wake-unknown']} where it doesn't know the slipstreams, {told['both-unknown']} where it "
            f"knows neither, {told['both-absent']} where there is neither"
        )
    return [
        "Reaction torque and unequal slipstreams both roll the vehicle about its thrust axis when the thrusts differ. "
        "These gentle flights don't show it; a bare step of 3 m east does. Its heading turns by at most: "
        f"{'; '.join(said)}. The two pull opposite ways, so that leaving one out can help by chance."
    ]


def _readings(evaluation: Evaluation) -> list[str]:
    a, gains = _airframe(), load_vehicle("yawsitter").gains
    inertia = {"P": a.jxx_kg_m2, "Q": a.jyy_kg_m2, "R": a.jzz_kg_m2}
    rates = [
        f"{gains[f'RATE_{axis}_P'] * (1.0 + gains[f'ATT_{axis}_D']) / (2.0 * j * j) / 1000.0:.1f} kHz ({name})"
        for axis, (name, j) in zip("XYZ", inertia.items(), strict=True)
    ]
    printed = [x for x in evaluation.loops if x["gains"] == "paper"]
    slow = [x for x in printed if x["rate_hz"] == min(y["rate_hz"] for y in printed)]
    fine = dict.fromkeys(x["reading"] for x in slow if all(y["stable"] for y in slow if y["reading"] == x["reading"]))
    return [
        "Stable with the printed gains at the vehicle's rate, ideal and real actuators: M_des = "
        f"{', '.join(fine) or 'none'}.",
        "M_des = J⁻¹ × bracket makes the rate loops' gain K = K_p (1 + K_d) / J², with the attitude loop's K_d, "
        "which acts on the same rates; sampled, their poles 1 − K h leave the unit circle below K / 2 = "
        f"{', '.join(rates)}. Above the greatest of them it is stable, with ideal actuators.",
    ]
