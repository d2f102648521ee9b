"""xacro files to URDF text, and the robot of a folder of either kind.

The macros are expanded by the library xacrodoc, which needs no ROS: packages are found by the names
of the folders around the file.
"""

from __future__ import annotations

import json
import os
import re
import xml.etree.ElementTree as ET
from importlib.util import find_spec
from pathlib import Path

from postproc.bounded import run_bounded
from postproc.errors import CellError, SourceRef
from postproc.files import read_bytes

_NO_ROBOT = frozenset({"macro", "property", "include", "arg"})
_LEVELS = 5
"""So many folders above a file are searched for packages."""
_MOST_FILES = 5000
_SECONDS = 20
_BYTES = 2 << 30
"""What the expansion of a file may take: its expressions are Python's and have no bound."""


def is_xacro(path: Path) -> bool:
    """Return whether a file holds macros that have to be expanded."""
    return path.suffix.lower() == ".xacro" or b"<xacro:" in read_bytes(path)


def find_urdf(path: Path) -> Path:
    """Return the file of a robot: the file itself, or the only one in a folder.

    Plain URDF files go before xacro files; files that only define macros are no robots.
    """
    if not path.is_dir():
        return path
    files = sorted(p for p in path.rglob("*") if p.suffix.lower() in (".urdf", ".xacro"))
    plain = [file for file in files[:_MOST_FILES] if file.suffix.lower() == ".urdf"]
    robots = plain or [file for file in files[:_MOST_FILES] if _has_robot(file)]
    if len(robots) == 1:
        return robots[0]
    names = ", ".join(file.relative_to(path).as_posix() for file in robots[:8])
    text = f"{len(robots)} robots in this folder, expected one: {names}"
    if not robots:
        text = "no .urdf file and no .xacro file with a robot in this folder"
    raise CellError("CEL011", text, SourceRef(str(path)), "give one of the files")


def _has_robot(file: Path) -> bool:
    """Return whether a xacro file has more in it than definitions."""
    try:
        root = ET.fromstring(file.read_bytes())
    except (ET.ParseError, OSError, ValueError, LookupError):
        return False
    words = [str(element.tag).rpartition("}") for element in root if isinstance(element.tag, str)]
    return any(not (space and word in _NO_ROBOT) for space, _, word in words)


def expanded(path: Path, folder: Path) -> bytes:
    """Return the URDF text of a xacro file; mesh files are named relative to ``folder``."""
    if not (find_spec("xacro") and find_spec("xacrodoc")):
        text = "a xacro file, and the library that expands it is not installed"
        hint = "pip install xacrodoc, or give the URDF that ROS makes of it"
        raise CellError("CEL011", text, SourceRef(str(path)), hint)
    script, asked = Path(__file__).with_name("expansion.py"), json.dumps(_packages(path))
    code, text = run_bounded(script, [str(path)], _SECONDS, _BYTES, asked) or (2, "")
    if code != 0:
        budget = f"cannot be expanded within {_SECONDS} s and {_BYTES >> 30} GB"
        reason = " ".join(text.split())[:300] if code == 1 else budget
        raise CellError("CEL011", f"xacro: {reason}", SourceRef(str(path)))
    return _with_near_meshes(text, path, folder).encode("utf-8")


def _packages(path: Path) -> dict[str, str]:
    """Return the folders that may be packages: those around the file, nearest first."""
    found: dict[str, str] = {}
    for parent in path.resolve().parents[:_LEVELS]:
        found.setdefault(parent.name, parent.as_posix())
        for sibling in sorted(p for p in parent.iterdir() if p.is_dir()):
            found.setdefault(sibling.name, sibling.as_posix())
    return found


def _with_near_meshes(text: str, path: Path, folder: Path) -> str:
    """Return the text with mesh files that exist named relative to the folder of the URDF."""

    def near(match: re.Match[str]) -> str:
        file = resolved_mesh(match[1], path)
        if file is None:
            return match[0]
        return f'filename="{Path(os.path.relpath(file, folder.resolve())).as_posix()}"'

    return re.sub(r'filename="([^"]*)"', near, text)


def resolved_mesh(name: str, path: Path) -> Path | None:
    """Return the file of a mesh name in a URDF file, None if there is none.

    ``package://NAME/rest`` is looked for in folders called NAME above the file, in folders called
    NAME beside those, and last beside the file itself or one above, where people copy it.
    """
    if name.startswith("package://"):
        package, _, rest = name.removeprefix("package://").partition("/")
        folders = [parent for parent in path.resolve().parents]
        candidates = [f / rest for f in folders if f.name == package]
        candidates += [f / package / rest for f in folders]
        candidates += [f / rest for f in folders[:2]]
    else:
        candidates = [path.parent / name.removeprefix("file://")]
    return next((file for file in candidates if file.is_file()), None)
