"""Archives of a controller that are damaged or made to harm: each ends in a cell or one line."""

from __future__ import annotations

import contextlib
import io
import os
import random
import stat
import tempfile
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from postproc.cli import app

Files = dict[str, bytes]
_ODD = (
    b"1E300", b"-", b"{", b'"', b"nan", b"\xff\xfe", b"9" * 400, b"#X", b"}}", b"{" * 3000, b"\0",
    b"1E-400", b"TRUE", b"'B2'", b"'HFFFFFFFFFFFFFFFFFF'", b"=", b"[1000000000]", b";",
)  # fmt: skip


def mutants(files: Mapping[str, bytes], count: int, start: int = 19) -> Iterator[tuple[str, bytes]]:
    """Yield (kind of damage, bytes of the archive) of so many damaged copies of a backup."""
    kinds = (*_DAMAGES.items(), ("packed", None))
    for number in range(count):
        chance = random.Random(start * 1_000_003 + number)
        kind, damage = kinds[number % len(kinds)]
        changed = dict(files)
        if damage is None:
            yield kind, cut_or_turned(zipped(changed), chance)
            continue
        damage(changed, chance)
        yield kind, zipped(changed)


def zipped(files: Mapping[str, bytes]) -> bytes:
    """Return a ZIP archive; a name that begins with ``link:`` becomes a link."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a name twice is one of the damages
        for name, content in files.items():
            entry = zipfile.ZipInfo(name.removeprefix("link:"))
            if name.startswith("link:"):
                entry.external_attr = (stat.S_IFLNK | 0o777) << 16
            archive.writestr(entry, content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def cut_or_turned(content: bytes, chance: random.Random) -> bytes:
    """Return content with one damage: cut, turned, doubled, something odd put in, lines mixed."""
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
        numbers = [i for i, sign in enumerate(content) if sign in b"0123456789"]
        at = chance.choice(numbers) if numbers else at
        return content[:at] + chance.choice(_ODD) + content[at + 1 :]
    lines = content.split(b"\n")
    chance.shuffle(lines)
    return b"\n".join(lines)


def _one_file(files: Files, chance: random.Random) -> None:
    name = chance.choice(sorted(files))
    files[name] = cut_or_turned(files[name], chance)


def _data(files: Files, chance: random.Random) -> None:
    name = chance.choice([name for name in sorted(files) if name.lower().endswith(".dat")])
    files[name] = cut_or_turned(files[name], chance)


def _bomb(files: Files, chance: random.Random) -> None:
    name = chance.choice(sorted(files))
    files[name] = files[name] + b" " * chance.choice((2_000_000, 20_000_000))


def _traversal(files: Files, chance: random.Random) -> None:
    way = chance.choice(("../", "/", "C:/", "KRC/../../", "..\\", "\\\\host\\share\\", "./../"))
    files[way + "evil.dat"] = b"DEFDAT EVIL\nENDDAT\n"


def _link(files: Files, chance: random.Random) -> None:
    name = chance.choice(sorted(files))
    files[f"link:{name}"] = b"/etc/passwd"
    if chance.random() < 0.5:
        del files[name]


def _encoding(files: Files, chance: random.Random) -> None:
    encoding = chance.choice(("utf-16", "utf-8-sig", "cp1252", "cp1250", "utf-32", "cp037"))
    for name in list(files):
        with contextlib.suppress(UnicodeError):
            files[name] = files[name].decode("utf-8").encode(encoding)


def _absent(files: Files, chance: random.Random) -> None:
    del files[chance.choice(sorted(files))]


def _renamed(files: Files, chance: random.Random) -> None:
    change = chance.choice((str.upper, str.lower, str.swapcase, lambda name: f"a/b/{name}"))
    for name in list(files):
        files[change(name)] = files.pop(name)


def _second(files: Files, chance: random.Random) -> None:
    name = chance.choice(sorted(files))
    files[chance.choice(("other/", "KRC2/", "")) + name.swapcase()] = files[name]


def _nested(files: Files, chance: random.Random) -> None:
    inner = zipped(files)
    if chance.random() < 0.5:
        files.clear()
    files["inner.zip"] = inner


_DAMAGES: Mapping[str, Callable[[Files, random.Random], None]] = {
    "a file": _one_file, "a data list": _data, "a bomb": _bomb, "a way out": _traversal,
    "a link": _link, "another encoding": _encoding, "a file is absent": _absent,
    "other names": _renamed, "a second robot": _second, "an archive within": _nested,
}  # fmt: skip


def outcome_of(archive: bytes, folder: Path, also_check: bool) -> str:
    """Return ``cell`` or the code of the error of ``new-cell``, ``fault: ...`` where it is ours."""
    path, out = folder / "backup.zip", folder / "cell.toml"
    path.write_bytes(archive)
    out.unlink(missing_ok=True)
    code, said = _run(["new-cell", "--backup", os.fspath(path), "-o", os.fspath(out)])
    if out.exists() != (code == 0) or code not in (0, 2) or "Traceback" in said:
        return f"fault: {said.strip()[-300:]}"
    if code == 0 and also_check:
        code, said = _run(["check", os.fspath(out), "--backup", os.fspath(path)])
        if code not in (0, 1) or "Traceback" in said:
            return f"fault: {said.strip()[-300:]}"
        return "cell"
    if code == 0:
        return "cell"
    first = said.splitlines()[0]
    return first.partition(": error ")[2][:6] or f"fault: {first}"


def _run(arguments: list[str]) -> tuple[int, str]:
    said = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
        code = app.run(arguments)
    return code, said.getvalue()


def print_outcomes(source: Path, count: int) -> None:
    """Read so many damaged copies of a backup, a folder or ZIP, and print what became of them."""
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for kind, archive in mutants(files_of(source), count):
            outcome = outcome_of(archive, Path(folder), also_check=True)
            counts[outcome] += 1
            if outcome.startswith("fault"):
                print(f"{kind}: {outcome}")
    print(", ".join(f"{name} {number}" for name, number in counts.most_common()))


def files_of(source: Path) -> Files:
    """Return the files of a backup by their path in it."""
    if source.is_dir():
        return {
            path.relative_to(source).as_posix(): path.read_bytes()
            for path in sorted(source.rglob("*"))
            if path.is_file() and ".git" not in path.parts
        }
    with zipfile.ZipFile(source) as archive:
        return {item.filename: archive.read(item) for item in archive.infolist()}
