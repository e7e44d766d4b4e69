"""Tables of what was changed on purpose, and of the loops."""

import math
from typing import Any

import numpy as np

from gcs_tools.metrics import AIRBORNE_M
from sitl.page import Cell, Group, Row, Table, told
from sitl.reproduce.cases import ABLATIONS, MISSIONS
from sitl.reproduce.evaluation import Evaluation
from sitl.reproduce.linear import READINGS
from sitl.reproduce.loops import HOMES
from sitl.reproduce.printed import AXES
from sitl.reproduce.tables import millimetres, number

_COLUMNS = (*AXES, "max |φ| [°]")
_KICK = "max |φ| in a 3 m step east [°]"


def ablations(evaluation: Evaluation) -> Table:
    """Mean absolute error in millimetres and the largest turn of the heading, per change and vehicle."""
    rows = []
    for a, before in zip(ABLATIONS, (None, *ABLATIONS), strict=False):
        cells = []
        for vehicle in evaluation.ablated:
            for mission in MISSIONS:
                cells += _cells(evaluation, f"{a.key}@{vehicle}", mission)
            cells.append(number(evaluation.kicks[a.key, vehicle], 2))
        rows.append(Row(a.title, cells, "" if before is not None and before.group == a.group else a.group))
    literal = [cell for mission in MISSIONS for cell in _cells(evaluation, "literal", mission)]
    groups = []
    for vehicle in evaluation.ablated:
        groups += [*(Group(f"{vehicle}, {mission}", _COLUMNS) for mission in MISSIONS), Group(vehicle, (_KICK,))]
    missing = [Cell("—")] * (sum(len(group.columns) for group in groups) - len(literal))
    rows.append(Row("yawsitter-literal", [*literal, *missing], "airframe"))
    return Table("ablations", "Ablations: mean absolute error of the true position [mm]", groups, rows)


def _cells(evaluation: Evaluation, setup: str, mission: str) -> list[Cell]:
    flight = evaluation.flight(setup, mission)
    airborne = flight.column("down_m") < -AIRBORNE_M
    turn = float(np.abs(flight.column("roll_deg")[airborne]).max())
    return [*(millimetres(v, digits=2) for v in flight.true["mae"]), number(turn, 3)]


def readings(loops: list[dict[str, Any]]) -> Table:
    """Which readings of M_des are stable."""
    rows = []
    last = ""
    for line in loops:
        real, imaginary = line["worst_pole_1_s"]
        stable = line["stable"]
        pole = _pole(real) + (f" ± {_pole(abs(imaginary))}j" if abs(imaginary) > 1e-9 else "")
        part = f"{line['gains']} gains, {line['actuators']} actuators"
        rows.append(
            Row(
                f"M_des = {line['reading']}",
                [
                    number(line["rate_hz"], 0),
                    Cell("stable" if stable else "unstable", float(stable), stable),
                    Cell(pole, real),
                    Cell(_innermost(line["unstable_loops"])),
                ],
                part if part != last else "",
            )
        )
        last = part
    columns = ("control rate [Hz]", "whole loop", "slowest or worst pole [1/s]", "innermost loop that is unstable")
    return Table("readings", "Readings of M_des, linearised in hover", [Group("", columns)], rows)


def _pole(value: float) -> str:
    return f"{value:.3g}".replace("-", "−") if abs(value) < 1000.0 else told(value, 0)


def _innermost(unstable: list[str]) -> str:
    return next((loop for loop in ("rate", "attitude", "velocity", "position") if loop in unstable), "—")


_MARGIN_COLUMNS = ("ω_c", "ω_B", "GM", "PM", "max |S|")


def margins_table(loops: list[dict[str, Any]]) -> list[Table]:
    """Every loop and axis: one table per gain set and kind of actuators, a column group per reading."""
    tables = []
    rates = min(line["rate_hz"] for line in loops)
    for gains, actuators in dict.fromkeys((line["gains"], line["actuators"]) for line in loops):
        lines = [x for x in loops if (x["gains"], x["actuators"], x["rate_hz"]) == (gains, actuators, rates)]
        rows = []
        last = ""
        for k, loop in enumerate(lines[0]["loops"]):
            cells = [cell for line in lines for cell in _margins(line["loops"][k])]
            rows.append(Row(loop["axis"], cells, loop["loop"] if loop["loop"] != last else ""))
            last = loop["loop"]
        groups = [Group(f"M_des = {line['reading']}", _MARGIN_COLUMNS) for line in lines]
        title = f"Loops: {gains} gains, {actuators} actuators, {rates} Hz"
        tables.append(Table(f"margins-{gains}-{actuators}", title, groups, rows))
    return tables


def _margins(loop: dict[str, Any]) -> list[Cell]:
    if not loop["stable"]:
        return [Cell("unstable", None, False, len(_MARGIN_COLUMNS))]
    up = loop["gain_up"]
    gain = Cell("∞") if math.isinf(up) else number(20.0 * math.log10(up), 1)
    speeds = [_speed(loop["crossover_rad_s"]), _speed(loop["bandwidth_rad_s"])]
    return [*speeds, gain, number(loop["phase_deg"], 0), number(loop["sensitivity"], 2)]


def _speed(value: float) -> Cell:
    if not math.isfinite(value):
        return Cell("—")
    return number(value, 2 if value < 10.0 else 1 if value < 100.0 else 0)


def limits_table(evaluation: Evaluation) -> Table:
    """What physics sets, beside what each gain set asks of it."""
    x = evaluation.limits
    speeds = [_north(evaluation, gains, actuators) for gains, _, actuators in HOMES]
    rows = [
        Row(
            "flaps to north [rad/s]", [number(x["unstable_zero_1_s"], 1), *speeds], "unstable zero; velocity loop's ω_c"
        ),
        Row("thrust to weight", [number(x["thrust_to_weight"], 2), Cell("—"), Cell("—")], "saturation"),
    ]
    for name in ("roll", "pitch", "yaw"):
        asked = [number(x[f"{name}_saturates_deg_{gains}"], 1) for gains, _, _ in HOMES]
        heading = "greatest angular acceleration in hover [rad/s²]; the angle that asks for it all [°]"
        rows.append(Row(name, [number(x[f"{name}_rad_s2"], 0), *asked], heading if name == "roll" else ""))
    columns = ("limit", *(f"{gains} gains, {actuators} actuators" for gains, _, actuators in HOMES))
    return Table("limits", "Limits that no gains move, and how near the loops go", [Group("", columns)], rows)


def _north(evaluation: Evaluation, gains: str, actuators: str) -> Cell:
    line = next(
        x for x in evaluation.loops if (x["gains"], x["actuators"], x["reading"]) == (gains, actuators, READINGS[0])
    )
    return _speed(next(x for x in line["loops"] if (x["loop"], x["axis"]) == ("velocity", "north"))["crossover_rad_s"])
