"""The .tlog file."""

import pytest

from sitl.daemon.config import SettingError
from sitl.daemon.recorder import Recorder


def test_each_frame_stands_behind_its_time_in_microseconds(tmp_path) -> None:
    recorder = Recorder(tmp_path / "new", 3, 0.0)
    recorder.frame(b"\xfdabc", 1.5)
    recorder.frame(b"\xfdde", 1_700_000_000.25)
    recorder.close()
    first, second = (1_500_000).to_bytes(8, "big"), (1_700_000_000_250_000).to_bytes(8, "big")
    assert recorder.path.read_bytes() == first + b"\xfdabc" + second + b"\xfdde"
    assert recorder.path.name == "1970-01-01_00-00-00Z_instance-3.tlog"


def test_a_second_recording_in_the_same_second_takes_another_name(tmp_path) -> None:
    first, second = Recorder(tmp_path, 0, 0.0), Recorder(tmp_path, 0, 0.0)
    assert first.path != second.path
    first.close()
    second.close()


def test_a_folder_that_can_t_be_made_is_refused_in_one_line(tmp_path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(SettingError, match="--record"):
        Recorder(tmp_path / "file", 0, 0.0)
