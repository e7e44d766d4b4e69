"""Which flights the evaluation consists of, each with the command that flies it again."""

from typing import NamedTuple

MISSIONS = ("rectangle", "circle")
OTHER_READINGS = ("rectangle-20x5", "circle-constant-speed")
NO_FEEDFORWARD = (("FF_VELOCITY", 0.0), ("FF_ACCEL", 0.0), ("FF_INVERSE", 0.0))
NO_OBSERVER = (("CTL_DIST_F_BW", 0.0), ("CTL_DIST_M_BW", 0.0))
_STAGE_1 = (("FF_ACCEL", 0.0), ("FF_INVERSE", 0.0))
_STAGE_2 = (("FF_INVERSE", 0.0),)
SEEDS = (1, 2, 3, 4, 5)

Values = tuple[tuple[str, float], ...]


class Craft(NamedTuple):
    """A vehicle with other parameter values."""

    vehicle: str
    overrides: Values = ()


class Case(NamedTuple):
    """One flight. plant, believed: airframe numbers changed in the vehicle, and in what its controller believes."""

    setup: str
    mission: str
    vehicle: str = "yawsitter"
    seed: int = 1
    overrides: Values = ()
    plant: Values = ()
    believed: Values = ()
    wind_N: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m/s
    gust_m_s: float = 0.0

    @property
    def name(self) -> str:
        return f"{self.setup}-{self.mission}-{self.seed}"

    @property
    def command(self) -> str:
        """The command line of this very flight, in the report's folder."""
        words = ["sitl fly", f"missions/{self.mission}.yaml", "--vehicle", self.vehicle, "--seed", str(self.seed)]
        for option, values in (("--set", self.overrides), ("--plant", self.plant), ("--believed", self.believed)):
            words += [f"{option} {name}={value:.12g}" for name, value in values]
        if any(self.wind_N) or self.gust_m_s:
            words += ["--wind", ",".join(f"{v:g}" for v in self.wind_N), "--gust", f"{self.gust_m_s:g}"]
        return " ".join(words)


class Setup(NamedTuple):
    """A column of the tables: a vehicle, and the parameters that are changed in it."""

    key: str
    title: str
    vehicle: str
    overrides: Values = ()

    @property
    def craft(self) -> Craft:
        return Craft(self.vehicle, self.overrides)


NOISY = "yawsitter-real"
_EXACT = Setup("exact", "tuned gains, real actuators and gyro, state known", NOISY, (("EST_ENABLE", 0.0),))
_TUNED = Setup("tuned", "tuned gains, real actuators, sensors and filter", NOISY)
SETUPS = (
    Setup("feedback", "printed gains, feedback only", "yawsitter", NO_FEEDFORWARD + NO_OBSERVER),
    Setup("feedforward", "printed gains, feed-forward", "yawsitter", NO_OBSERVER),
    _EXACT,
    _TUNED,
)
# who flies the trials beyond the paper
BEYOND = (Setup("printed", "printed gains, feed-forward and observer", "yawsitter"), _EXACT, _TUNED)


class View(NamedTuple):
    """A column of the error tables: a set-up's flights, and the position that its errors are measured with."""

    setup: str
    title: str
    source: str  # of a Flight: "true" or "reported"


VIEWS = (
    *(View(s.key, f"{s.title} (true position)" if s.key == "tuned" else s.title, "true") for s in SETUPS),
    *(View(s.key, f"{s.title} (as it reports it)", "reported") for s in SETUPS if s.key == "tuned"),
)


class Ablation(NamedTuple):
    """A line of the ablation table: what is changed with regard to the vehicle as it is."""

    group: str
    key: str
    title: str
    overrides: Values = ()
    plant: Values = ()
    believed: Values = ()


_NO_TORQUE = (("torque_coefficient", 0.0),)
_NO_WAKE_ARM = (("wake_arm_m", 0.0),)
ABLATIONS = (
    Ablation("reference", "as-is", "as it is, observer on"),
    Ablation("side force", "kf-0", "K_f = 0", plant=(("side_force_factor", 0.0),)),
    Ablation("side force", "kf-03", "K_f = 0.3", plant=(("side_force_factor", 0.3),)),
    Ablation("reaction torque", "torque-unknown", "the allocation doesn't know it", believed=_NO_TORQUE),
    Ablation("reaction torque", "torque-absent", "neither has it", plant=_NO_TORQUE, believed=_NO_TORQUE),
    Ablation("unequal slipstreams", "wake-unknown", "the allocation doesn't know them", believed=_NO_WAKE_ARM),
    Ablation("unequal slipstreams", "wake-absent", "neither has them", plant=_NO_WAKE_ARM, believed=_NO_WAKE_ARM),
    Ablation("both", "both-unknown", "the allocation knows neither", believed=_NO_TORQUE + _NO_WAKE_ARM),
    Ablation(
        "both", "both-absent", "neither has either", plant=_NO_TORQUE + _NO_WAKE_ARM, believed=_NO_TORQUE + _NO_WAKE_ARM
    ),
    Ablation("disturbance observer", "no-observer", "off", overrides=NO_OBSERVER),
    Ablation("attitude error", "yxz", "Euler YXZ instead of quaternion", overrides=(("SYS_ATT_ERROR", 0.0),)),
    Ablation("feed-forward", "ff-none", "none", overrides=NO_FEEDFORWARD),
    Ablation("feed-forward", "ff-velocity", "velocity", overrides=_STAGE_1),
    Ablation("feed-forward", "ff-acceleration", "velocity and acceleration", overrides=_STAGE_2),
)
ABLATED_VEHICLES = ("yawsitter", NOISY)


def evaluation(quick: bool) -> list[Case]:
    """Every flight of the evaluation, once. quick: one seed, and the ablations with the default vehicle only."""
    cases = []
    for setup in SETUPS:
        for mission in (*MISSIONS, *OTHER_READINGS):
            repeated = setup is _TUNED and mission in MISSIONS
            for seed in SEEDS if repeated and not quick else SEEDS[:1]:
                cases.append(Case(setup.key, mission, setup.vehicle, seed, setup.overrides))
    cases += [Case("literal", mission, "yawsitter-literal") for mission in MISSIONS]
    for vehicle in ABLATED_VEHICLES[: 1 if quick else None]:
        for a in ABLATIONS:
            for mission in MISSIONS:
                setup_key = f"{a.key}@{vehicle}"
                cases.append(Case(setup_key, mission, vehicle, 1, a.overrides, a.plant, a.believed))
    return cases
