import os
import stat

import pytest

from postproc.errors import ReadError
from postproc.files import read_bytes, write_files


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
