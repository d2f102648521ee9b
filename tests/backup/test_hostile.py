"""Archives that are broken, mutated or made to harm: one clear line, never a traceback."""

import os
import stat
import zipfile
from collections import Counter

import pytest

from postproc.backup import archive as archive_room
from postproc.backup import read_backup
from postproc.errors import PostprocError
from tests.backup import archives
from tests.backup.test_backup import contents
from tools.controllers.mutate import mutants, outcome_of


def code_of(path):
    with pytest.raises(PostprocError) as caught:
        read_backup(path)
    assert "\n" not in str(caught.value)
    return caught.value.code


def write(folder, content):
    path = folder / "backup.zip"
    path.write_bytes(content)
    return path


@pytest.mark.parametrize(
    "name", ["../evil.dat", "/etc/evil.dat", "C:/evil.dat", "KRC/../../x", "..\\evil.dat", "\\x"]
)
def test_paths_that_lead_out(name, tmp_path):
    assert code_of(write(tmp_path, archives.zipped({**contents(), name: b"x"}))) == "BAK002"


def test_links_are_not_followed(tmp_path):
    path = tmp_path / "backup.zip"
    with zipfile.ZipFile(path, "w") as packed:
        for name, content in contents().items():
            packed.writestr(name, content)
        link = zipfile.ZipInfo("KRC/R1/System/link.src")
        link.external_attr = (stat.S_IFLNK | 0o777) << 16
        packed.writestr(link, "/etc/passwd")
    assert code_of(path) == "BAK002"
    folder = archives.unpacked(tmp_path / "folder", contents())
    secret = tmp_path / "secret.dat"
    secret.write_text("DEFDAT SECRET\nENDDAT\n")
    machine = folder / "KRC" / "R1" / "Mada" / "$machine.dat"
    machine.unlink()
    machine.symlink_to(secret)
    assert code_of(folder) == "BAK006"


def test_bombs(tmp_path, monkeypatch):
    zeros = {**contents(), "KRC/R1/Mada/$robcor.dat": bytes(40_000_000)}
    assert code_of(write(tmp_path, archives.zipped(zeros))) == "BAK003"
    monkeypatch.setattr(archive_room, "MOST_BYTES", 20_000)
    long = {**contents(), "KRC/R1/Mada/$robcor.dat": os.urandom(30_000)}
    assert code_of(write(tmp_path, archives.zipped(long))) == "BAK003"
    monkeypatch.setattr(archive_room, "MOST_FILES", 3)
    assert code_of(write(tmp_path, archives.zipped(contents()))) == "BAK003"


def test_what_is_no_backup(tmp_path):
    assert code_of(tmp_path / "nothing.zip") == "IO001"
    assert code_of(write(tmp_path, b"")) == "BAK001"
    assert code_of(write(tmp_path, b"PK\x03\x04 cut off")) == "BAK001"
    assert code_of(write(tmp_path, archives.zipped({"a.txt": b"x"}))) == "BAK006"
    inner = archives.zipped(contents())
    path = write(tmp_path, archives.zipped({"inner.zip": inner}))
    with pytest.raises(PostprocError) as caught:
        read_backup(path)
    assert caught.value.code == "BAK006"
    assert "inner.zip" in caught.value.hint
    two = {f"{side}/{k}": v for side in ("a", "b") for k, v in contents().items()}
    assert code_of(write(tmp_path, archives.zipped(two))) == "BAK006"
    empty = {**contents(), "KRC/R1/Mada/$machine.dat": b""}
    assert code_of(write(tmp_path, archives.zipped(empty))) == "BAK005"
    (tmp_path / "empty").mkdir()
    assert code_of(tmp_path / "empty") == "BAK006"


@pytest.mark.slow
def test_mutated_archives(tmp_path):
    """A slice of ``python -m tools.controllers mutate``: each kind of damage many times."""
    whole = contents(names={("TOOL", 3): "Fräser"}, loads={3: (40.0, (1.0, 2.0, 3.0))})
    outcomes = Counter()
    kinds = Counter()
    for number, (kind, packed) in enumerate(mutants(whole, 80)):
        outcome = outcome_of(packed, tmp_path, also_check=number % 5 == 0)
        assert not outcome.startswith("fault"), (number, kind, outcome)
        outcomes[outcome] += 1
        kinds[kind] += 1
    assert min(kinds.values()) >= 7
    assert outcomes["cell"] > 15
    assert {"BAK001", "BAK002", "BAK003", "BAK004", "BAK005", "BAK006"} <= set(outcomes)
