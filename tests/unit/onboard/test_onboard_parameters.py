"""The parameter registry: declared ranges, refusals, persistence."""

import math
import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from onboard_flights import SPECS, FailingStore, texts

from sitl.onboard.declarations import as_markdown, declarations
from sitl.onboard.events import EventLog
from sitl.onboard.modes import EventKind
from sitl.onboard.parameters import Declaration, ParameterRefusal, Parameters
from sitl.onboard.store import FolderStore, MemoryStore, Store

DECLARED = [
    Declaration("GAIN", False, 0.1, 0.0, 0.3, "1/s", "Gains", "A gain"),
    Declaration("CHOICE", True, 1, 0, 3, "", "Other", "A choice", values=((0, "a"), (1, "b"), (3, "c"))),
    Declaration("COUNT", True, 0, 0, 100, "ms", "Other", "A counter", persistent=False),
    Declaration("FIXED", True, 7, 0, 255, "", "Other", "A fixed one", read_only=True),
]


def registry(store: Store | None = None, events: EventLog | None = None, namespace: str = "one") -> Parameters:
    return Parameters(DECLARED, store or MemoryStore(), namespace, events or EventLog())


@pytest.mark.parametrize(
    ("name", "value", "is_int", "refusal"),
    [
        ("NOBODY", 1.0, None, ParameterRefusal.UNKNOWN),
        ("GAIN", math.nan, None, ParameterRefusal.NOT_FINITE),
        ("GAIN", math.inf, None, ParameterRefusal.NOT_FINITE),
        ("GAIN", 0.31, None, ParameterRefusal.OUT_OF_RANGE),
        ("GAIN", -0.01, None, ParameterRefusal.OUT_OF_RANGE),
        ("GAIN", 0.2, True, ParameterRefusal.WRONG_TYPE),
        ("CHOICE", 1, False, ParameterRefusal.WRONG_TYPE),
        ("CHOICE", 0.5, None, ParameterRefusal.WRONG_TYPE),
        ("CHOICE", 2, True, ParameterRefusal.OUT_OF_RANGE),
        ("CHOICE", 4, True, ParameterRefusal.OUT_OF_RANGE),
        ("FIXED", 8, True, ParameterRefusal.READ_ONLY),
    ],
)
def test_a_bad_write_is_refused_for_its_reason_and_the_old_value_stays(
    name: str, value: float, is_int: bool | None, refusal: ParameterRefusal
) -> None:
    p = registry()
    before = {n: p[n] for n in p.names}
    assert p.set(name, value, is_int) is refusal
    assert {n: p[n] for n in p.names} == before
    assert p.generation == 0


@given(st.floats(0.0, 0.3))
def test_a_value_in_force_is_exact_in_single_precision(value: float) -> None:
    p = registry()
    assert p.set("GAIN", value) is None
    assert p["GAIN"] == float(np.float32(value))


def test_a_limit_that_travelled_in_single_precision_is_still_allowed() -> None:
    p = registry()
    assert p.set("GAIN", float(np.float32(0.3)), is_int=False) is None
    assert registry()["GAIN"] == float(np.float32(0.1))


def test_a_change_counts_and_is_told_and_a_repetition_is_neither() -> None:
    events = EventLog()
    p = registry(events=events)
    assert p.set("GAIN", 0.2) is None
    assert p.set("GAIN", 0.2) is None
    assert p.generation == 1
    assert [(e.kind, e.text) for e in events.since(0)] == [(EventKind.PARAMETER, "GAIN")]


def test_values_outlive_the_process_and_kinds_of_vehicle_stay_apart(tmp_path) -> None:
    store = FolderStore(tmp_path)
    registry(store).set("GAIN", 0.2)
    registry(store, namespace="two").set("CHOICE", 3)
    assert registry(FolderStore(tmp_path))["GAIN"] == float(np.float32(0.2))
    assert registry(FolderStore(tmp_path))["CHOICE"] == 1
    assert registry(FolderStore(tmp_path), namespace="two")["CHOICE"] == 3


def test_what_is_stored_can_be_read_by_those_whom_the_umask_lets_and_leaves_nothing_else_behind(tmp_path) -> None:
    before = os.umask(0o027)
    try:
        FolderStore(tmp_path / "state").write("parameters.json", b"{}")
    finally:
        os.umask(before)
    [path] = (tmp_path / "state").iterdir()
    assert (path.name, path.stat().st_mode & 0o777) == ("parameters.json", 0o640)


def test_what_is_not_persistent_and_what_is_default_is_not_stored() -> None:
    store = MemoryStore()
    p = registry(store)
    p.set("COUNT", 5)
    assert store.read("parameters.json") is None
    p.set("GAIN", 0.2)
    p.reset("Gains")
    assert b"GAIN" not in (store.read("parameters.json") or b"")
    assert p["COUNT"] == 5


def test_a_write_that_cannot_be_saved_is_refused_and_told() -> None:
    store, events = FailingStore(), EventLog()
    p = registry(store, events)
    store.writable = False
    assert p.set("GAIN", 0.2) is ParameterRefusal.NOT_SAVED
    assert p["GAIN"] == float(np.float32(0.1))
    assert p.generation == 0
    assert texts(events) == ["parameter GAIN not saved: No space left on device"]
    assert p.set("COUNT", 3) is None  # which is never saved
    store.writable = True
    assert p.set("GAIN", 0.2) is None


def test_a_reset_that_cannot_be_saved_changes_nothing() -> None:
    store = FailingStore()
    p = registry(store)
    p.set("GAIN", 0.2)
    p.set("CHOICE", 3)
    store.writable = False
    assert p.reset() is ParameterRefusal.NOT_SAVED
    assert (p["GAIN"], p["CHOICE"]) == (float(np.float32(0.2)), 3)
    store.writable = True
    assert p.reset() is None
    assert (p["GAIN"], p["CHOICE"]) == (float(np.float32(0.1)), 1)


@pytest.mark.parametrize("damage", [b"{", b"[]", b'{"one": 3}', b'{"one": {"GAIN": "x"}}', b"\xff\xfe"])
def test_a_damaged_file_is_set_aside_and_defaults_are_in_force(damage: bytes) -> None:
    store, events = MemoryStore(), EventLog()
    store.write("parameters.json", damage)
    assert registry(store, events)["GAIN"] == float(np.float32(0.1))
    assert store.read("parameters.json.damaged") == damage
    assert texts(events) == ["stored parameters damaged: set aside: defaults in force"]


def test_values_that_no_longer_fit_are_left_out_with_a_warning() -> None:
    store, events = MemoryStore(), EventLog()
    store.write("parameters.json", b'{"one": {"GAIN": 9.0, "GONE": 1.0, "CHOICE": 3, "COUNT": 4, "FIXED": 1}}')
    p = registry(store, events)
    assert (p["GAIN"], p["CHOICE"], p["COUNT"], p["FIXED"]) == (float(np.float32(0.1)), 3, 0, 7)
    assert texts(events) == [
        "stored parameter GAIN ignored: out of range",
        "stored parameter GONE ignored: unknown name",
        "stored parameter COUNT ignored: not kept across restarts",
        "stored parameter FIXED ignored: read-only",
    ]


@pytest.mark.parametrize("stored", [b'{"one": {"GAIN": 0.2}}', b"{"])
def test_a_store_that_cannot_be_used_does_not_keep_the_vehicle_from_starting(stored: bytes) -> None:
    store, events = FailingStore(), EventLog()
    store.write("parameters.json", stored)
    store.writable = store.readable = False
    assert registry(store, events)["GAIN"] == float(np.float32(0.1))
    assert texts(events) == ["stored parameters not readable (Permission denied): defaults in force"]
    store.readable = True
    assert registry(store, events)["CHOICE"] == 1


def test_a_counter_that_runs_down_can_be_put_back() -> None:
    p = registry()
    p.set("COUNT", 50)
    p.put_back("COUNT", 0)
    assert p["COUNT"] == 0


@pytest.mark.parametrize("name", sorted(SPECS))
def test_every_declaration_fits_the_wire_and_its_own_range(name: str) -> None:
    declared = declarations(SPECS[name].gains, SPECS[name].parameters)
    assert len({d.name for d in declared}) == len(declared)
    for d in declared:
        assert len(d.name) <= 16
        assert d.name == d.name.upper()
        assert d.minimum <= d.default <= d.maximum
        assert d.short
        assert d.group
        assert not d.values or d.default in dict(d.values)


def test_the_36_gains_are_declared_by_loop_axis_and_term() -> None:
    names = {d.name for d in declarations(SPECS["yawsitter"].gains, {})}
    gains = {f"{loop}_{axis}_{t}" for loop in ("POS", "VEL", "ATT", "RATE") for axis in "XYZ" for t in "PID"}
    assert gains <= names


def test_a_default_for_an_undeclared_parameter_is_an_error() -> None:
    with pytest.raises(KeyError):
        declarations(SPECS["yawsitter"].gains, {"NOBODY": 1.0})


def test_the_table_in_the_documentation_has_every_parameter() -> None:
    declared = declarations(SPECS["yawsitter"].gains, {})
    table = as_markdown(declared)
    assert all(f"| `{d.name}` |" in table for d in declared)


def test_a_preset_is_in_force_for_this_run_only_and_leaves_what_was_kept() -> None:
    store = MemoryStore()
    first = registry(store)
    assert first.set("GAIN", 0.25) is None
    second = registry(store)
    assert second.preset("GAIN", 0.125) is None
    assert second["GAIN"] == 0.125
    assert second.set("CHOICE", 3) is None  # a save on the way
    third = registry(store)
    assert (third["GAIN"], third["CHOICE"]) == (0.25, 3)
    assert third.preset("GAIN", 0.125) is None
    assert third.set("GAIN", 0.0625) is None  # set again: kept
    assert registry(store)["GAIN"] == 0.0625


def test_a_reset_leaves_the_simulations_own_settings_alone() -> None:
    parameters = registry(MemoryStore())
    parameters.set("COUNT", 2)
    parameters.set("GAIN", 0.25)
    assert parameters.reset() is None
    assert parameters["COUNT"] == 2
    assert parameters["GAIN"] == pytest.approx(0.1)
