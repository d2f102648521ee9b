"""What the manifest beside a program says of it: frames of the cell, ids of the tags."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

NAME = "manifest.json"
"""What a batch keeps about the programs of a folder."""


def about(paths: Sequence[str]) -> dict[str, Any]:
    """Return ``tools``, ``bases`` and ``ids`` of a program by its files; empty where not known.

    A manifest that was made with another text of the program says nothing about this one.
    """
    files = [Path(path) for path in paths]
    if not files or not all(path.is_file() for path in files):
        return {}
    manifest = files[0].parent / NAME
    if not manifest.is_file():
        return {}
    try:
        entries = json.loads(manifest.read_bytes())["entries"].values()
        marks = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}
        known = [entry for entry in entries if marks.items() <= entry["files"].items()]
        parts = {name: known[0][name] for name in ("tools", "bases", "ids")} if known else {}
        frames = [*parts.get("tools", {}).values(), *parts.get("bases", {}).values()]
        is_sound = all(len([float(v) for v in frame]) == 6 for frame in frames)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}
    return parts if is_sound and all(isinstance(v, dict) for v in parts.values()) else {}
