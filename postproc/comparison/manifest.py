"""The manifest beside programs: what it says of them, and how a new version is accepted."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from postproc.controller import load_program
from postproc.errors import KrlError, SourceRef
from postproc.files import read_bytes, write_files
from postproc.krl import Comment, KrlModule, Move, load_modules

_FRAME = re.compile(r" (tool|base) (\d+): X (.*?), Y (.*?), Z (.*?), A (.*?), B (.*?), C (.*?)\s*")
"""How the comments at the head of a program name its frames [mm, deg]."""
_TAG = re.compile(r"\s*CAM line (\d+): (.*?)\s*")
"""How the comment behind a motion names its tag."""
MANIFEST = "manifest.json"
"""What a batch keeps about the programs of a folder."""


def about(paths: Sequence[str], modules: Sequence[KrlModule] = ()) -> dict[str, Any]:
    """Return ``tools``, ``bases`` and ``ids`` of a program by its files; empty where not known.

    A manifest that was made with another text of the program says nothing about this one: then the
    comments of its ``modules`` do.
    """
    files = [Path(path) for path in paths]
    with suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
        entries = json.loads((files[0].parent / MANIFEST).read_bytes())["entries"].values()
        marks = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}
        known = [entry for entry in entries if marks.items() <= entry["files"].items()]
        parts = {name: dict(known[0][name]) for name in ("tools", "bases", "ids")} if known else {}
        frames = [*parts.get("tools", {}).values(), *parts.get("bases", {}).values()]
        if parts and all(len([float(v) for v in frame]) == 6 for frame in frames):
            return parts
    return _told(modules)


def _told(modules: Sequence[KrlModule]) -> dict[str, Any]:
    """Return what the comments of a program say: its frames, its tags by their CAM line."""
    found: dict[str, dict[str, Any]] = {"tools": {}, "bases": {}, "ids": {}}
    names: dict[str, set[str]] = {}
    for statement in (s for module in modules for r in module.routines for s in r.statements):
        if isinstance(statement, Comment) and (frame := _FRAME.fullmatch(statement.text)):
            kind, number, *values = frame.groups()
            with suppress(ValueError):
                found[f"{kind}s"][number] = [float(value) for value in values]
        elif isinstance(statement, Move) and (tag := _TAG.fullmatch(statement.comment)):
            names.setdefault(tag[1], set()).add(tag[2])
    found["ids"] = {line: min(known) for line, known in names.items() if len(known) == 1}
    return found


def accept(old: str | Path, new: str | Path) -> list[str]:
    """Copy a program with its sub-programs, or a folder's modules, over the old ones.

    Of folders, modules that the new one has no more are removed from the old one, and a batch's
    manifest comes along. All other files stay as they are. Returns the files that were written or
    removed. DIF002 if the two programs have different names.
    """
    left, right = Path(old), Path(new)
    if left.is_dir():
        before, after = _files(left, load_modules([left])), _files(right, load_modules([right]))
        gone = sorted(before.keys() - after.keys())
        if (right / MANIFEST).is_file():
            after[MANIFEST] = right / MANIFEST
    else:
        if left.stem.upper() != right.stem.upper():
            text = f"{left.stem} cannot become {right.stem}: a module has the name of its file"
            raise KrlError("DIF002", text, SourceRef(str(new)))
        before, after = {}, _files(right.parent, load_program(right))
        gone, left = [], left.parent
    contents = {}
    for name, path in sorted(after.items()):
        content = read_bytes(path)
        target = before.get(
            name, left / path.relative_to(right if right.is_dir() else right.parent)
        )
        if not target.is_file() or target.read_bytes() != content:
            contents[target] = content
    write_files(contents)
    for name in gone:
        before[name].unlink(missing_ok=True)
    return [str(path) for path in sorted([*contents, *(before[name] for name in gone)])]


def _files(folder: Path, modules: tuple[KrlModule, ...]) -> dict[str, Path]:
    """Return the files of modules by their upper-case name within the folder."""
    paths = [Path(p) for m in modules for p in (m.src_path, m.dat_path) if p]
    return {str(path.relative_to(folder)).upper(): path for path in paths if path.is_file()}
