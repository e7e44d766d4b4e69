"""The settings of a swarm: places, ports, identities."""

from pathlib import Path

import pytest

from sitl.daemon import config, formation, swarm
from sitl.daemon.config import Port, RunConfig, SettingError
from sitl.strict_yaml import ConfigError


def test_the_grid_starts_at_home_and_fills_rows_to_the_north() -> None:
    assert swarm.grid(1, 3.0) == [(0.0, 0.0)]
    assert swarm.grid(5, 3.0) == [(0, 0), (0, 3), (0, 6), (3, 0), (3, 3)]
    assert len(set(swarm.grid(250, 0.5))) == 250


def test_each_vehicle_is_an_instance_and_ground_stations_are_served_on_the_shared_port_alone() -> None:
    made = swarm.setup(RunConfig(instance=4, seed=9, state_dir=Path("s")), swarm.grid(3, 3.0), 10.0)
    assert [v.system_id for v in made.vehicles] == [5, 6, 7]
    assert [v.seed for v in made.vehicles] == [9, 10, 11]
    assert [v.state_dir for v in made.vehicles] == [Path(f"s/instance-{i}") for i in (4, 5, 6)]
    assert made.sockets[4, Port.SHARED] == ("127.0.0.1", 18304)
    assert made.sockets[6, Port.GCS] == ("127.0.0.1", 18576)
    assert made.voices[4, Port.SHARED] == (5, 6, 7)
    assert made.voices[5, Port.ONBOARD] == (6,)
    assert made.static_peers == [
        ((4, Port.SHARED), ("127.0.0.1", 14550)),
        ((4, Port.ONBOARD), ("127.0.0.1", 14544)),
        ((5, Port.ONBOARD), ("127.0.0.1", 14545)),
        ((6, Port.ONBOARD), ("127.0.0.1", 14546)),
    ]


def test_no_two_swarms_and_vehicles_get_the_same_ports() -> None:
    setups = [swarm.setup(RunConfig(instance=first), swarm.grid(1, 1.0), 10.0) for first in range(250)]
    ports = [port for made in setups for _, port in made.sockets.values()]
    assert len(set(ports)) == len(ports)


def test_what_is_recorded_lies_in_a_folder_for_each_vehicle() -> None:
    first = RunConfig(record=True, record_dir=Path("logs"), state_dir=Path("s"))
    made = swarm.setup(first, swarm.grid(2, 3.0), 10.0)
    assert [v.log_dir for v in made.vehicles] == [Path("logs/instance-0"), Path("logs/instance-1")]
    made = swarm.setup(first._replace(record_dir=None), swarm.grid(2, 3.0), 10.0)
    assert [v.log_dir for v in made.vehicles] == [Path("s/instance-0/logs"), Path("s/instance-1/logs")]


def test_a_viewer_whose_port_would_be_another_vehicles_is_refused() -> None:
    config.check(swarm.setup(RunConfig(hil_viewer=True), swarm.grid(40, 3.0), 10.0))
    with pytest.raises(SettingError, match="instance 40 would send to UDP 19450, where instance 0 listens"):
        config.check(swarm.setup(RunConfig(hil_viewer=True), swarm.grid(41, 3.0), 10.0))
    with pytest.raises(SettingError, match="--hil-viewer"):
        config.check(config.Setup((RunConfig(instance=50, hil_viewer=True),)))


def test_more_vehicles_than_system_ids_are_refused() -> None:
    with pytest.raises(SettingError, match="would end at 250, above 249"):
        swarm.setup(RunConfig(instance=241), swarm.grid(10, 1.0), 10.0)


@pytest.mark.parametrize(
    ("parse", "text"),
    [
        (swarm.parse_count, "0"),
        (swarm.parse_count, "251"),
        (swarm.parse_count, "many"),
        (swarm.parse_spacing, "0"),
        (swarm.parse_spacing, "nan"),
        (swarm.parse_rate, "1000"),
        (swarm.parse_port, "70000"),
    ],
)
def test_what_can_not_be_used_is_refused_by_its_text(parse, text) -> None:
    with pytest.raises(SettingError, match=f"'{text}' is not"):
        parse(text)


def test_a_formation_file_says_where_each_stands(tmp_path) -> None:
    file = tmp_path / "pair.yaml"
    file.write_text("description: a pair\nplaces:\n  - {north_m: 1, east_m: 2.5}\n  - {north_m: -3, east_m: 0}\n")
    assert formation.load(file, 2) == [(1.0, 2.5), (-3.0, 0.0)]
    with pytest.raises(ConfigError, match="there are 2, for 3 vehicles"):
        formation.load(file, 3)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("places: [{north_m: 1}]", "east_m"),
        ("places: [{north_m: .inf, east_m: 0}]", r"places\[0\].north_m: inf must be in"),
        ("place: []", "place"),
    ],
)
def test_a_formation_file_that_says_it_wrong_is_refused(tmp_path, text, complaint) -> None:
    file = tmp_path / "wrong.yaml"
    file.write_text(text + "\n")
    with pytest.raises(ConfigError, match=complaint):
        formation.load(file, 1)


def test_the_bundled_formations_are_sound() -> None:
    for file in (Path(__file__).parents[3] / "examples/formations").glob("*.yaml"):
        assert formation.load(file, 9)
