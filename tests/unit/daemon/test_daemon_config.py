"""What the command line's values may be, and what is said of those that may not."""

import math
from pathlib import Path

import pytest

from sitl.daemon import config
from sitl.daemon.config import Port, RunConfig, SettingError
from sitl.geodesy import GeoPoint


def test_home_is_a_point_and_a_heading() -> None:
    home = config.parse_home("47.3977,8.5456,488,90")
    assert home.point == GeoPoint(47.3977, 8.5456, 488.0)
    assert home.heading_rad == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(
    ("parse", "text", "named"),
    [
        (config.parse_home, "1,2", "LAT,LON,ALT_AMSL,HEADING"),
        (config.parse_home, "91,0,0,0", "latitude 91"),
        (config.parse_home, "0,181,0,0", "longitude 181"),
        (config.parse_home, "0,0,nan,0", "LAT,LON,ALT_AMSL,HEADING"),
        (config.parse_home, "0,0,1e9,0", "altitude"),
        (config.parse_wind, "1,2", "NORTH,EAST,DOWN"),
        (config.parse_wind, "31,0,0", "-30 to 30"),
        (config.parse_wind, "inf,0,0", "NORTH,EAST,DOWN"),
        (config.parse_gust, "-1", "0 to 10"),
        (config.parse_speed, "0", "'max'"),
        (config.parse_speed, "fast", "'max'"),
        (config.parse_speed, "nan", "'max'"),
        (config.parse_instance, "-1", "0 to 249"),
        (config.parse_instance, "250", "0 to 249"),
        (config.parse_seed, "1.5", "whole number"),
        (config.parse_setting, "RATE_Y_P", "NAME=VALUE"),
        (config.parse_setting, "RATE_Y_P=nan", "NAME=VALUE"),
        (config.parse_setting, "=1", "NAME=VALUE"),
        (config.parse_airframe, "mass_kg", "NAME=VALUE"),
        (config.parse_peer, "14550", "HOST:PORT"),
        (config.parse_peer, "127.0.0.1:0", "HOST:PORT"),
        (config.parse_peer, "127.0.0.1:70000", "HOST:PORT"),
        (config.parse_listen, "everywhere", "0.0.0.0"),
    ],
)
def test_a_wrong_value_is_refused_in_one_line_that_names_what_is_allowed(parse, text, named) -> None:
    with pytest.raises(SettingError) as refusal:
        parse(text)
    assert named in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_max_speed_reads_as_the_parameter_spells_it() -> None:
    assert config.parse_speed("max") == 0.0
    assert config.parse_speed("2.5") == 2.5


def test_a_setting_is_a_name_and_a_number() -> None:
    assert config.parse_setting("rate_y_p=0.4") == ("RATE_Y_P", 0.4)
    assert config.parse_airframe("mass_kg=1.2") == ("mass_kg", 1.2)


def test_the_ports_move_with_the_instance() -> None:
    settings = RunConfig(instance=3)
    assert settings.local_ports == {Port.GCS: ("127.0.0.1", 18573), Port.ONBOARD: ("127.0.0.1", 14583)}
    assert settings.static_peers == {Port.GCS: (("127.0.0.1", 14550),), Port.ONBOARD: (("127.0.0.1", 14543),)}
    assert settings.system_id == 4


def test_no_instance_sends_to_the_ground_stations_port_what_is_meant_for_onboard_programs() -> None:
    ports = [RunConfig(instance=i).static_peers[Port.ONBOARD][0][1] for i in range(config.INSTANCE_MAX + 1)]
    assert ports[:10] == list(range(14540, 14550))
    assert set(ports[10:]) == {14549}


def test_a_viewer_has_a_port_only_when_asked_for() -> None:
    settings = RunConfig(instance=3, hil_viewer=True)
    assert settings.local_ports[Port.VIEWER] == ("127.0.0.1", 19453)
    assert settings.static_peers[Port.VIEWER] == (("127.0.0.1", 19413),)


def test_more_ground_stations_join_the_usual_one_without_doubling_it() -> None:
    more = (("127.0.0.1", 14550), ("127.0.0.1", 14999))
    assert RunConfig(ground_stations=more).static_peers[Port.GCS] == more


def test_a_far_ground_station_needs_a_wider_ear() -> None:
    far = RunConfig(ground_stations=(("192.0.2.7", 14550),))
    with pytest.raises(SettingError, match=r"--listen 0\.0\.0\.0"):
        config.check(config.Setup((far,)))
    assert config.check(config.Setup((far._replace(listen="0.0.0.0"),))).first.listen == "0.0.0.0"


def test_state_lives_in_the_user_s_state_folder(monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert config.default_state_dir(2) == tmp_path / "yawsitter" / "instance-2"
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert config.default_state_dir(0) == Path(tmp_path) / ".local" / "state" / "yawsitter" / "instance-0"
