"""A folder on disk, as the link's files."""

import os

import pytest

from sitl.daemon.files import FolderArea


@pytest.fixture
def area(tmp_path):
    return FolderArea(tmp_path / "area", capacity=1000)


def put(area, *path, data=b"data") -> None:
    file = area.create(path, empty=True)
    file.write(0, data)
    file.close()


def test_a_folder_that_is_not_there_yet_is_empty_and_made_when_written_to(area, tmp_path) -> None:
    assert area.entries(()) == []
    put(area, "x")
    assert (tmp_path / "area" / "x").read_bytes() == b"data"
    assert [(e.name, e.size) for e in area.entries(())] == [("x", 4)]


def test_files_are_read_written_cut_renamed_and_removed(area) -> None:
    put(area, "x", data=b"hello world")
    area.make_folder(("deep",))
    area.rename(("x",), ("deep", "y"))
    area.truncate(("deep", "y"), 5)
    file = area.open(("deep", "y"))
    assert (file.size, file.read(1, 100), file.read(9, 1)) == (5, b"ello", b"")
    file.close()
    assert [(e.name, e.size) for e in area.entries(())] == [("deep", None)]
    with pytest.raises(OSError, match="not empty"):
        area.remove_folder(("deep",))
    area.remove(("deep", "y"))
    area.remove_folder(("deep",))
    assert area.entries(()) == []


def test_nothing_is_renamed_over_another_file(area) -> None:
    put(area, "x")
    put(area, "y", data=b"other")
    with pytest.raises(FileExistsError):
        area.rename(("x",), ("y",))


def test_links_lead_nowhere(area, tmp_path) -> None:
    (tmp_path / "secret").write_text("secret")
    put(area, "x")
    root = tmp_path / "area"
    (root / "file").symlink_to(tmp_path / "secret")
    (root / "folder").symlink_to(tmp_path)
    assert [e.name for e in area.entries(())] == ["x"]
    for attempt in (
        lambda: area.open(("file",)),
        lambda: area.open(("folder", "secret")),
        lambda: area.create(("file",), empty=True),
        lambda: area.create(("folder", "new"), empty=True),
        lambda: area.remove(("folder", "secret")),
        lambda: area.entries(("folder",)),
        lambda: area.entries(("folder", "area")),
        lambda: area.open((f"..{os.sep}secret",)),
    ):
        with pytest.raises(PermissionError):
            attempt()
    assert (tmp_path / "secret").read_text() == "secret"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes in the file system here")
def test_only_plain_files_are_opened(area, tmp_path) -> None:
    put(area, "x")
    area.make_folder(("deep",))
    os.mkfifo(tmp_path / "area" / "pipe")
    assert [e.name for e in area.entries(())] == ["deep", "x"]
    with pytest.raises(IsADirectoryError):
        area.open(("deep",))
    with pytest.raises(PermissionError):
        area.open(("pipe",))


def test_no_more_than_the_capacity_is_taken(area) -> None:
    put(area, "x", data=bytes(600))
    file = area.create(("y",), empty=True)
    file.write(0, bytes(400))
    with pytest.raises(OSError, match="space"):
        file.write(400, b"1")
    file.write(0, b"1")  # nothing grows
    file.close()
    with pytest.raises(OSError, match="space"):
        area.truncate(("y",), 10_000)
    area.remove(("x",))
    area.truncate(("y",), 1000)


def test_what_is_in_use_stays(tmp_path) -> None:
    area = FolderArea(tmp_path, in_use=lambda name: name == "now.tlog")
    put(area, "now.tlog")
    put(area, "old.tlog")
    area.remove(("old.tlog",))
    with pytest.raises(OSError, match="busy"):
        area.remove(("now.tlog",))
