"""Sub-programs that an earlier, longer program of the same name has left in a folder.

A controller has one flat name space: what stays there is loaded with the new program. Only files
that say themselves that they are a part of such a program are ours; all others are left alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from postproc.errors import Finding, Severity, SourceRef
from postproc.files import read_bytes
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Former:
    """Names of files in a folder: ``ours`` nothing needs any more, ``foreign`` only look so."""

    ours: tuple[str, ...] = ()
    foreign: tuple[str, ...] = ()

    def findings(self, folder: Path) -> tuple[Finding, ...]:
        """Return a warning where files stay that are called as if they were parts."""
        if not self.foreign:
            return ()
        text = (
            f"{', '.join(self.foreign)}: named like parts of this program, but not known to be of "
            "an earlier one: not removed"
        )
        return (Finding(Severity.WARNING, "CNV012", text, source=SourceRef(str(folder))),)


def part_title(number: int, count: int, first: int, stop: int) -> str:
    """Return the comment by which a sub-program says whose part it is."""
    return f"part {number} of {count}: motions {first + 1} to {stop}"


_TITLE = re.compile(rb"^;[ \t]*part \d+ of \d+: motions \d+ to \d+[ \t\r]*$", re.MULTILINE)


def former_parts(folder: Path, name: str, files: Iterable[str]) -> Former:
    """Return what stands in a folder beside a program's files as if it were one of its parts.

    A part of ours that another program of the folder calls is foreign, too.
    """
    keep = {file.upper() for file in files}
    if not any(file.endswith(".SRC") for file in keep) or not folder.is_dir():
        return Former()
    looks = re.compile(rf"({re.escape(name)}_\d{{3,}})\.(src|dat)", re.IGNORECASE)
    found = {path.name: m[1].upper() for path in sorted(folder.iterdir())
             if (m := looks.fullmatch(path.name)) and path.name.upper() not in keep
             and path.is_file()}  # fmt: skip
    text = {file: read_bytes(folder / file) for file in found}
    parts = {found[file] for file in found if _is_part(file, text[file])}
    parts -= _called(folder, parts, {*keep, *(file.upper() for file in found)})
    ours = tuple(file for file in found if found[file] in parts and _is_named(file, text[file]))
    return Former(ours, tuple(file for file in found if file not in ours))


def _is_named(file: str, text: bytes) -> bool:
    """Return whether a module says the name of its file."""
    word = rb"DEFDAT" if file.upper().endswith(".DAT") else rb"DEF"
    pattern = rb"^[ \t]*" + word + rb"[ \t]+" + re.escape(file[:-4].encode()) + rb"\b"
    return re.search(pattern, text, re.MULTILINE | re.IGNORECASE) is not None


def _is_part(file: str, text: bytes) -> bool:
    return file.upper().endswith(".SRC") and _is_named(file, text) and bool(_TITLE.search(text))


def _called(folder: Path, parts: set[str], aside: set[str]) -> set[str]:
    """Return the parts that any other program of the folder names."""
    called: set[str] = set()
    for path in sorted(folder.iterdir()) if parts else ():
        is_program = path.suffix.upper() in (".SRC", ".SUB") and path.is_file()
        if is_program and path.name.upper() not in aside:
            calls = re.findall(rb"(?<!DEF[ \t])\b(\w+)[ \t]*\(", read_bytes(path).upper())
            called |= parts & {call.decode("latin-1") for call in calls}
    return called
