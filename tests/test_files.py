import os
import stat

import pytest

from postproc.errors import ReadError
from postproc.files import leftovers, open_input, read_bytes, write_files


def test_missing_input_is_one_line():
    with pytest.raises(ReadError) as caught:
        read_bytes("nowhere/part.cls")
    assert str(caught.value) == "nowhere/part.cls:1: error IO001: no such file"


def test_a_folder_is_no_input(tmp_path):
    with pytest.raises(ReadError, match="IO002"):
        read_bytes(tmp_path)


def test_all_files_appear_with_their_folders(tmp_path):
    write_files({tmp_path / "a" / "x.src": b"1", tmp_path / "b" / "y.dat": b"2"})
    assert (tmp_path / "a" / "x.src").read_bytes() == b"1"
    assert (tmp_path / "b" / "y.dat").read_bytes() == b"2"
    assert stat.S_IMODE((tmp_path / "a" / "x.src").stat().st_mode) == 0o644


def test_one_bad_target_leaves_nothing_behind(tmp_path):
    (tmp_path / "taken").mkdir()
    (tmp_path / "x.src").write_bytes(b"old")
    with pytest.raises(ReadError, match="IO003"):
        write_files({tmp_path / "x.src": b"new", tmp_path / "taken": b"2"})
    assert (tmp_path / "x.src").read_bytes() == b"old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["taken", "x.src"]


def test_a_full_disk_leaves_nothing_behind(tmp_path, monkeypatch):
    real = os.fdopen

    def full(handle, mode):
        stream = real(handle, mode)
        stream.close()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fdopen", full)
    with pytest.raises(ReadError, match="No space left"):
        write_files({tmp_path / "x.src": b"new"})
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_fails_while_it_is_read_is_one_line():
    # reading address 0 of a process is an input/output error, for root too
    with (
        pytest.raises(ReadError, match=r"mem:1: error IO002: cannot be read: Input/output"),
        open_input("/proc/self/mem") as stream,
    ):
        stream.read(1)


def test_durable_files_are_like_others(tmp_path):
    write_files({tmp_path / "x.json": b"1"}, durable=True)
    assert [p.name for p in tmp_path.iterdir()] == ["x.json"]


def test_what_killed_writers_left_is_known_by_its_name(tmp_path):
    for name in (".x.src.ab_c0123.part", ".x.part", "x.src.ab_c0123.part", ".x.src.ABC.part"):
        (tmp_path / name).write_bytes(b"")
    assert [p.name for p in leftovers(tmp_path)] == [".x.src.ab_c0123.part"]
