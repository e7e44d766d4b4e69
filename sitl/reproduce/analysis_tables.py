"""Tables of what was changed on purpose, and of the loops."""

import math
from typing import Any

import numpy as np

from gcs_tools.metrics import AIRBORNE_M
from sitl.reproduce.cases import ABLATIONS, MISSIONS
from sitl.reproduce.evaluation import Evaluation
from sitl.reproduce.printed import AXES
from sitl.reproduce.tables import Cell, Group, Row, Table, millimetres, number

_COLUMNS = (*AXES, "max |φ| [°]")


def ablations(evaluation: Evaluation) -> Table:
    """Mean absolute error in millimetres and the largest turn of the heading, per change and vehicle."""
    rows = []
    for a, before in zip(ABLATIONS, (None, *ABLATIONS), strict=False):
        cells = []
        for vehicle in evaluation.ablated:
            for mission in MISSIONS:
                cells += _cells(evaluation, f"{a.key}@{vehicle}", mission)
        rows.append(Row(a.title, cells, "" if before is not None and before.group == a.group else a.group))
    missing = [Cell("—")] * (len(_COLUMNS) * len(MISSIONS) * (len(evaluation.ablated) - 1))
    literal = [cell for mission in MISSIONS for cell in _cells(evaluation, "literal", mission)]
    rows.append(Row("yawsitter-literal", [*literal, *missing], "airframe"))
    groups = [Group(f"{vehicle}, {mission}", _COLUMNS) for vehicle in evaluation.ablated for mission in MISSIONS]
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
        pole = f"{real:.3g}" + (f" ± {abs(imaginary):.3g}j" if abs(imaginary) > 1e-9 else "")
        part = f"{line['gains']} gains, {line['actuators']} actuators"
        rows.append(
            Row(
                f"M_des = {line['reading']}",
                [
                    number(line["rate_hz"], 0),
                    Cell("stable" if stable else "unstable", float(stable), stable),
                    Cell(pole.replace("-", "−"), real),
                    Cell(_innermost(line["unstable_loops"])),
                ],
                part if part != last else "",
            )
        )
        last = part
    columns = ("control rate [Hz]", "whole loop", "slowest or worst pole [1/s]", "innermost loop that is unstable")
    return Table("readings", "Readings of M_des, linearised in hover", [Group("", columns)], rows)


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
    return Cell(f"{value:.3g}", value)
