"""What a campaign's file says becomes flights: each by its index alone, and mistakes are told before the first."""

import shlex

import numpy as np
import pytest
from campaign_files import ROOT, campaign, equipped, flights

from sitl import __main__ as command_line
from sitl.campaign.cases import digest
from sitl.campaign.distributions import Choice, Normal, Uniform, unit_cube
from sitl.strict_yaml import ConfigError

WINDY = "wind_north_m_s: {uniform: [-1, 1]}\nplant:\n  mass_kg: {normal: [1.0, 0.1], relative: true}\n"


def test_more_flights_another_setting_and_another_order_leave_random_flights_as_they_are() -> None:
    few = flights(f"flights: 4\n{WINDY}")
    many = flights(f"flights: 9\ngust_m_s: {{uniform: [0, 1]}}\n{WINDY}")
    assert [c.wind_N for c in few] == [c.wind_N for c in many[:4]]
    assert [c.plant for c in few] == [c.plant for c in many[:4]]
    assert len({c.wind_N for c in many}) == 9
    assert [c.seed for c in many] == list(range(1, 10))


def test_every_draw_is_flown_at_every_point_of_the_grid_in_the_same_air() -> None:
    found = flights(
        "flights: 2\ngust_m_s: {uniform: [0, 1]}\nparameters:\n"
        "  POS_X_P: {grid: [1, 2]}\n  VEL_X_P: {grid: {from: 1, to: 3, count: 3}}\n"
    )
    assert [c.number for c in found] == list(range(12))
    first = [c for c in found if c.draw == 0]
    assert {tuple(v for _, v in c.parameters) for c in first} == {(p, v) for p in (1.0, 2.0) for v in (1.0, 2.0, 3.0)}
    assert len({(c.gust_m_s, c.seed) for c in first}) == 1
    assert first[0].gust_m_s != found[-1].gust_m_s


@pytest.mark.parametrize("sampling", ["latin-hypercube", "sobol"])
def test_sampling_plans_fill_every_interval_whatever_the_order_of_the_lines(sampling: str) -> None:
    cube = unit_cube(["a", "b"], 16, sampling, 3)
    for column in cube.T:
        assert sorted((column * 16).astype(int)) == list(range(16))
    np.testing.assert_array_equal(unit_cube(["b", "a"], 16, sampling, 3), cube[:, ::-1])
    assert not np.array_equal(unit_cube(["a", "b"], 16, sampling, 4), cube)


def test_distributions_have_the_shape_that_they_say() -> None:
    us = unit_cube(["x"], 4000, "random", 1)[:, 0]
    bell = np.array([Normal(2.0, 0.5, -np.inf, np.inf).at(u) for u in us])
    assert (bell.mean(), bell.std()) == pytest.approx((2.0, 0.5), abs=0.03)
    cut = np.array([Normal(2.0, 0.5, 1.9, 2.6).at(u) for u in us])
    assert cut.min() >= 1.9
    assert cut.max() <= 2.6
    assert np.mean(cut < 2.0) == pytest.approx(0.171, abs=0.03)  # of a bell's mass between −0.2 and 1.2 deviations
    assert Uniform(-1.0, 3.0).at(0.25) == 0.0
    assert [Choice(("a", "b")).at(u) for u in (0.0, 0.49, 0.5, 0.999)] == ["a", "a", "b", "b"]


def test_wind_by_speed_and_direction_is_where_the_air_moves() -> None:
    (case,) = flights("wind_speed_m_s: 2\nwind_toward_deg: 90\nwind_down_m_s: -0.5\n")
    assert case.wind_N == pytest.approx((0.0, 2.0, -0.5))


def test_relative_numbers_are_factors_of_the_vehicles_own() -> None:
    gain = "parameters: {POS_X_P: {fixed: 2, relative: true}}\n"
    (case,) = flights(f"vehicle: yawsitter-real\nplant: {{mass_kg: {{fixed: 1.1, relative: true}}}}\n{gain}")
    equipment, (printed,) = equipped(f"vehicle: yawsitter-real\ngains: paper\n{gain}")
    spec = equipment.vehicles["yawsitter-real"]
    assert dict(case.plant)["mass_kg"] == pytest.approx(1.1 * spec.airframe.airframe.mass_kg)
    assert dict(case.parameters)["POS_X_P"] == pytest.approx(2.0 * spec.gains["POS_X_P"])
    assert dict(printed.parameters)["POS_X_P"] == pytest.approx(2.0 * equipment.gains["paper"]["POS_X_P"])


def test_a_command_line_says_every_setting_to_the_last_bit() -> None:
    (case,) = flights(
        "vehicle: {choice: [yawsitter-real]}\ngains: paper\nseed: {grid: [7]}\nheading_deg: -33.3\n"
        "wind_north_m_s: {uniform: [-1, 0]}\ngust_m_s: {uniform: [0.1, 0.9]}\nparameters: {RATE_Y_P: 0.3}\n"
        "plant: {mass_kg: {uniform: [1, 1.2]}}\nbelieved: {chord_m: 0.2}\n"
    )
    program, *words = shlex.split(case.command)
    read = command_line._parser().parse_args(words)
    assert program == "sitl"
    assert (str(read.mission), read.vehicle, read.gains) == ("missions/hover.yaml", "yawsitter-real", "paper")
    assert (read.seed, read.heading, read.wind, read.gust) == (7, -33.3, case.wind_N, case.gust_m_s)
    assert (tuple(read.set), tuple(read.plant), tuple(read.believed)) == (case.parameters, case.plant, case.believed)


def test_a_campaign_of_other_flights_is_known_by_its_digest() -> None:
    made = campaign(f"flights: 3\n{WINDY}")
    equipment, found = equipped(f"flights: 3\n{WINDY}")
    again, same = equipped(f"# other words\nflights: 3\n{WINDY}")
    mine = digest(made, found, equipment)
    assert digest(made, same, again) == mine
    other = equipment._replace(texts={name: text + " " for name, text in equipment.texts.items()})
    assert digest(made, found, other) != mine
    assert digest(made, found[:2], equipment) != mine
    assert digest(made._replace(trace_every=1), found, equipment) != mine


def test_missions_made_up_from_a_seed_differ_by_draw_and_can_be_flown_again_by_name() -> None:
    equipment, found = equipped("mission: {random: {duration_s: 40}}\nflights: 3\n")
    assert [c.mission for c in found] == [f"random:{k},duration_s=40.0" for k in (1, 2, 3)]
    assert len({equipment.mission(c).reference.at(20.0) for c in found}) == 3  # type: ignore[union-attr]


@pytest.mark.parametrize("name", sorted(p.name for p in (ROOT / "examples/campaigns").glob("*.yaml")))
def test_the_examples_can_be_flown(name: str) -> None:
    from sitl.campaign import file
    from sitl.campaign.cases import cases, equip

    path = ROOT / "examples/campaigns" / name
    made = file.load(str(path))
    assert len(cases(made, equip(made, path.parent), path.parent)) == made.total


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("fligths: 3\n", r"test\.yaml:3: fligths: is not a field here; allowed: name, .*flights"),
        ("flights: 0\n", r"test\.yaml:3: flights: Expected `int` >= 1"),
        ("sampling: magic\n", r"sampling: 'magic' is not one of random, latin-hypercube, sobol"),
        ("mission: nowhere.yaml\n", r"nowhere\.yaml: no such mission file"),
        ("mission: {random: {speed: 3}}\n", r"mission\.random\.speed: 'speed' is not one of duration_s"),
        ("mission: {random: {speed_m_s: 99}}\n", r"test\.yaml:2: mission\.random\.speed_m_s: 99 is outside 0\.2 … 10"),
        ("vehicle: zeppelin\n", "unknown vehicle 'zeppelin': use one of .*yawsitter"),
        ("vehicle: {uniform: [1, 2]}\n", r"vehicle\.uniform: is for numbers; allowed: fixed, choice, grid"),
        ("gust_m_s: {uniform: [0, 1], grid: [1]}\n", r"gust_m_s: exactly one of fixed, uniform, normal, choice, grid"),
        ("gust_m_s: {uniform: [1, 0]}\n", r"gust_m_s\.uniform: \[low, high\] with low below high"),
        ("gust_m_s: {normal: [1, 0]}\n", r"gust_m_s\.normal: .*deviation above 0"),
        ("gust_m_s: {normal: [1, 0.1], within: [5, 6]}\n", r"gust_m_s\.within: \[5, 6\] leaves nothing"),
        ("gust_m_s: {grid: [1, 1]}\n", r"gust_m_s\.grid: a value is given twice"),
        ("gust_m_s: {gird: [1]}\n", r"gust_m_s\.gird: is not a field here; allowed: fixed, uniform"),
        ("gust_m_s: .inf\n", r"gust_m_s: inf is not a finite number"),
        ("gust_m_s: -1\n", r"test\.yaml:3: gust_m_s: flight 0 would have -1; allowed 0 … 10"),
        ("wind_speed_m_s: 40\n", r"wind_north_m_s: flight 0 would have 40; allowed -30 … 30"),
        ("heading_deg: {grid: [0, 400]}\n", r"heading_deg: flight 1 would have 400; allowed -360 … 360"),
        ("seed: 1.5\n", r"seed: whole numbers from 0 to 4294967295"),
        ("parameters: {RATE_Y_Q: 1}\n", r"test\.yaml:3: parameters\.RATE_Y_Q: unknown; near it: .*RATE_Y_P"),
        ("parameters:\n  A: 1\n  RATE_Y_P: 1\n", r"test\.yaml:4: parameters\.A: unknown"),
        (
            "parameters: {POS_X_P: {grid: [1, 200]}}\n",
            r"POS_X_P: flight 1 would have 200 \(out of range\); allowed 0 … 1",
        ),
        ("plant: {mass: 1}\n", r"plant\.mass: unknown; near it: mass_kg"),
        ("plant: {mass_kg: {grid: [1, -1]}}\n", r"plant\.mass_kg: flight 1 would have mass_kg: -1\.0 must be greater"),
        ("success: {mae: 1}\n", r"success\.mae: is not a figure; allowed: mae_north_m"),
        ("flights: 1000000\ngust_m_s: {grid: [1, 2]}\n", r"flights: 2000000 flights with the grid; allowed up to"),
    ],
)
def test_a_mistake_is_named_by_file_line_and_field_with_what_is_allowed(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        flights(text)


def test_the_number_of_flights_is_draws_times_points() -> None:
    assert campaign("flights: 10\ngust_m_s: {grid: [0, 1, 2]}\nheading_deg: {grid: [0, 90]}\n").total == 60
