"""The page's pilot against the stand-in vehicle: what waits, what is lost with the link, what comes back."""

from collections.abc import Callable

from gcs_tools_stand_in import Pair, StandIn

from gcs_tools import commands
from gcs_tools.client import Client
from gcs_tools.view.pilot import Pilot
from sitl.mavlink.codec import mav

TAKEOFF = mav.MAV_CMD_NAV_TAKEOFF
LIMIT_S = 20.0


class Met:
    """A pilot that has met its vehicle."""

    def __init__(self) -> None:
        self.pilot, self.vehicle = Pilot(Client(1)), StandIn()
        self.pair = Pair(self.pilot.client, self.vehicle)
        self.until(lambda: self.pilot.up)

    def until(self, true: Callable[[], bool]) -> None:
        self.pair.run(true, LIMIT_S)

    def run(self, seconds: float) -> None:
        end_s = self.pair.wall_s + seconds
        self.until(lambda: self.pair.wall_s >= end_s)

    def texts(self) -> list[str]:
        return [line.text for line in self.pilot.lines]


def takeoff(client: Client):
    return commands.takeoff(client, height_m=3.0, wait=False)


def test_a_parameter_is_written_while_a_command_waits_for_its_answer() -> None:
    met = Met()
    met.vehicle.unanswered[TAKEOFF] = 99
    met.pilot.ask(takeoff)
    met.run(1.0)
    met.pilot.write("RATE_Y_P", 0.25)
    met.run(0.2)
    assert met.vehicle.parameters["RATE_Y_P"] == 0.25
    met.until(lambda: met.texts() == ["the vehicle doesn't answer NAV_TAKEOFF"])


def test_the_newest_command_takes_the_place_of_one_that_waits() -> None:
    met = Met()
    met.vehicle.unanswered[TAKEOFF] = 99
    met.pilot.ask(takeoff)
    met.run(1.0)
    met.pilot.ask(lambda client: commands.land(client, wait=False))
    met.run(10.0)
    assert met.texts() == ["landing"]
    tries = [m for m in met.vehicle.commands if m.command == TAKEOFF]
    assert len(tries) <= 3


def test_a_refusal_is_one_line_with_the_vehicles_reason() -> None:
    met = Met()
    met.vehicle.refuse[TAKEOFF] = (mav.MAV_RESULT_DENIED, "take-off refused: tipped over")
    met.pilot.ask(takeoff)
    met.until(lambda: met.pilot.completed == 1)
    assert met.texts() == ["take-off: refused by the vehicle: take-off refused: tipped over"]
    assert met.pilot.lines[-1].severity == mav.MAV_SEVERITY_WARNING


def test_what_is_asked_of_a_lost_vehicle_never_reaches_it() -> None:
    met = Met()
    met.vehicle.silent = True
    met.run(1.0)
    met.pilot.ask(takeoff)
    met.pilot.write("RATE_Y_P", 0.25)
    met.pilot.write("SIM_PAUSE", 1.0)
    met.until(lambda: not met.pilot.up)
    assert met.pilot.trouble == "nothing heard from the vehicle for 3 s"
    met.pilot.ask(takeoff)
    met.pilot.write("POS_X_P", 1.0)
    assert met.pilot.value("POS_X_P") == 2.5
    met.run(5.0)
    met.vehicle.silent = False
    met.vehicle.parameters["RATE_Y_P"] = 0.75
    met.until(lambda: met.pilot.up)
    met.run(3.0)
    assert not met.vehicle.armed
    assert met.vehicle.parameters == {"RATE_Y_P": 0.75, "POS_X_P": 2.5, "SIM_PAUSE": 0}
    assert met.pilot.value("RATE_Y_P") == 0.75


def test_a_vehicle_that_introduces_itself_anew_is_asked_for_its_parameters_again() -> None:
    met = Met()
    met.vehicle.parameters["RATE_Y_P"] = 0.125
    met.run(0.5)
    assert met.pilot.value("RATE_Y_P") == 0.5
    met.vehicle.say("YawSitter SITL 0.1.0: simulated 'yawsitter'", mav.MAV_SEVERITY_INFO)
    met.until(lambda: met.pilot.value("RATE_Y_P") == 0.125)


def test_a_parameter_that_the_vehicle_does_not_have_is_told() -> None:
    met = Met()
    met.pilot.write("NOPE", 1.0)
    met.run(0.2)
    assert met.texts() == ["NOPE: the vehicle has no such parameter"]


def test_what_is_written_again_is_written_after_what_was_asked_for_meanwhile() -> None:
    met = Met()
    written: list[str] = []
    met.vehicle._value = written.append  # type: ignore[method-assign]
    for name, value in (("POS_X_P", 1.0), ("SIM_PAUSE", 1.0), ("POS_X_P", 2.0)):
        met.pilot.write(name, value)
    met.run(20.0)
    assert list(dict.fromkeys(written)) == ["SIM_PAUSE", "POS_X_P"]
