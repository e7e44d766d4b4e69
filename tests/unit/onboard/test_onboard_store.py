"""Stores replace as a whole, and the event log numbers without gaps."""

import os

import pytest

from sitl.onboard.events import EventLog
from sitl.onboard.modes import EventKind, Severity
from sitl.onboard.store import FolderStore, MemoryStore, Store


@pytest.fixture(params=["memory", "folder"])
def store(request, tmp_path) -> Store:
    return MemoryStore() if request.param == "memory" else FolderStore(tmp_path / "state" / "one")


def test_what_was_never_written_is_none(store: Store) -> None:
    assert store.read("plan") is None
    store.set_aside("plan")
    assert store.read("plan") is None


def test_a_write_replaces_the_whole(store: Store) -> None:
    store.write("plan", b"a long first content")
    store.write("plan", b"short")
    assert store.read("plan") == b"short"


def test_what_is_set_aside_is_kept_under_another_name(store: Store) -> None:
    store.write("plan", b"x")
    store.set_aside("plan")
    assert store.read("plan") is None
    assert store.read("plan.damaged") == b"x"


def test_a_write_that_fails_leaves_the_old_content_and_no_litter(tmp_path, monkeypatch) -> None:
    store = FolderStore(tmp_path)
    store.write("plan", b"old")

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OSError, match="No space"):
        store.write("plan", b"new")
    assert store.read("plan") == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["plan"]


def test_events_are_numbered_without_gaps_and_read_from_any_place() -> None:
    log = EventLog()
    for k in range(5):
        log.now_us = 1000 * k
        log.add(EventKind.ITEM_REACHED, Severity.INFO, "", k)
    assert [(e.number, e.now_us, e.value) for e in log.since(3)] == [(3, 3000, 3), (4, 4000, 4)]
    assert log.since(5) == []
    assert log.next_number == 5


def test_the_log_keeps_the_last_thousand_events_under_their_own_numbers() -> None:
    log = EventLog()
    for k in range(1500):
        log.tell(Severity.INFO, str(k))
    kept = log.since(0)
    assert len(kept) == 1000
    assert kept[0].number == 500
    assert [e.number for e in log.since(1498)] == [1498, 1499]
    assert all(e.text == str(e.number) for e in kept)
