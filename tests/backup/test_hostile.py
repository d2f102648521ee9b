"""Archives that are broken, mutated or made to harm: one clear line, never a traceback."""

import os
import random
import stat
import zipfile

import pytest

from postproc.backup import archive as archive_room
from postproc.backup import read_backup
from postproc.cli import app
from postproc.errors import PostprocError
from tests.backup import archives
from tests.backup.test_backup import contents


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


def test_two_hundred_mutated_archives(tmp_path, capsys):
    """Bytes of the archive and of its files turned, cut, doubled: never a traceback."""
    chance = random.Random(19)
    whole = contents(names={("TOOL", 3): "Fräser"}, loads={3: (40.0, (1.0, 2.0, 3.0))})
    outcomes = {0: 0, 2: 0}
    for number in range(200):
        files = dict(whole)
        if number % 2:
            name = chance.choice(sorted(files))
            files[name] = _mutated(files[name], chance)
            packed = archives.zipped(files)
        else:
            packed = _mutated(archives.zipped(files), chance)
        path = write(tmp_path, packed)
        out = tmp_path / f"cell_{number}.toml"
        code = app.run(["new-cell", "--backup", str(path), "-o", str(out)])
        err = capsys.readouterr().err
        assert "Traceback" not in err
        assert code in (0, 2), err
        assert out.exists() == (code == 0)
        assert code == 0 or ": error " in err.splitlines()[0]
        outcomes[code] += 1
        if code == 0 and outcomes[0] % 10 == 0:
            assert app.run(["check", str(out), "--backup", str(path)]) in (0, 1)
            assert "Traceback" not in capsys.readouterr().err
    assert min(outcomes.values()) > 20


def _mutated(content, chance):
    """Return content with one kind of damage."""
    kind, at = chance.randrange(6), chance.randrange(max(len(content), 1))
    if kind == 0:
        return content[:at]
    if kind == 1:
        return content[:at] + bytes([chance.randrange(256)]) + content[at + 1 :]
    if kind == 2:
        return content[:at] + content[at : at + 200] * 2 + content[at + 200 :]
    if kind == 3:
        return content[:at] + chance.randbytes(30) + content[at:]
    if kind == 4:
        odd = [b"1E300", b"-", b"{", b'"', b"nan", b"\xff\xfe", b"9" * 400, b"#X", b"}}"]
        numbers = [i for i, sign in enumerate(content) if sign in b"0123456789"]
        at = chance.choice(numbers) if numbers else at
        return content[:at] + chance.choice(odd) + content[at + 1 :]
    lines = content.split(b"\n")
    chance.shuffle(lines)
    return b"\n".join(lines)
