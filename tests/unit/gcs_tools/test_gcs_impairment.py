"""A link made worse on purpose."""

import math

import pytest

from gcs_tools.impairment import Impairment, Wire, parse


def fate(impairment: Impairment, count: int = 10_000) -> list[tuple[float, int]]:
    """When each of a row of datagrams, a millisecond apart, arrives."""
    wire: Wire[int] = Wire(impairment)
    arrived = []
    for k in range(count + 20_000):
        if k < count:
            wire.put(k * 1e-3, k)
        arrived += [(k * 1e-3, each) for each in wire.take(k * 1e-3)]
    assert wire.next_s == math.inf
    return arrived


def test_a_good_link_hands_on_everything_at_once_and_in_order() -> None:
    assert fate(Impairment()) == [(k * 1e-3, k) for k in range(10_000)]


def test_shares_and_delays_are_those_asked_for() -> None:
    arrived = fate(Impairment(loss=0.2, dup=0.05, jitter_s=0.1))
    assert len({k for _, k in arrived}) == pytest.approx(8000 + 10_000 * 0.2 * 0.05, rel=0.02)
    assert len(arrived) == pytest.approx(10_000 * 1.05 * 0.8, rel=0.02)
    late = [s - k * 1e-3 for s, k in arrived]
    assert max(late) <= 0.102
    assert sum(late) / len(late) == pytest.approx(0.05, abs=0.002)
    assert [k for _, k in arrived] != sorted(k for _, k in arrived)


def test_the_same_seed_gives_the_same_fate_and_the_way_back_another() -> None:
    bad = Impairment(loss=0.2, dup=0.05, jitter_s=0.1, seed=3)
    assert fate(bad, 500) == fate(bad, 500)
    assert fate(bad, 500) != fate(bad.reversed(), 500)


def test_what_is_written_is_read() -> None:
    assert parse("loss=0.2,dup=0.05,jitter=0.1,seed=7") == Impairment(0.2, 0.05, 0.1, 7)
    assert parse("jitter=1") == Impairment(jitter_s=1.0)


@pytest.mark.parametrize("text", ["", "loss", "loss=1", "loss=-1", "loss=nan", "delay=1", "seed=1.5", "loss=0,loss=0"])
def test_anything_else_is_refused_with_what_is_allowed(text: str) -> None:
    with pytest.raises(ValueError, match=r"loss=0\.\.0\.95"):
        parse(text)
