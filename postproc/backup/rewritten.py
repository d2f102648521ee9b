"""Tool and base data that programs of the controller overwrite: what stands at rest may not cut."""

from __future__ import annotations

import re

from postproc.backup.archive import Archive
from postproc.backup.layout import Layout
from postproc.backup.variables import decoded
from postproc.errors import ReadError

_ASSIGNED = re.compile(
    r"^[^;\"\n]*?\b(TOOL_DATA|BASE_DATA|LOAD_DATA)\s*\[\s*(\w+)\s*\](?:\s*\.\s*\w+)?\s*=(?!=)",
    re.IGNORECASE | re.MULTILINE,
)
_SUFFIXES = (".src", ".sub")


def rewritten_data(archive: Archive, layout: Layout) -> tuple[str, ...]:
    """Return the data that some program assigns: ``TOOL_DATA[11]``, ``BASE_DATA[any]``.

    Files too large or broken are left out: they only serve a remark.
    """
    root = f"{layout.root}/".lower()
    found: set[tuple[str, int]] = set()
    for name in archive.sizes:
        if not (name.lower().startswith(root) and name.lower().endswith(_SUFFIXES)):
            continue
        try:
            text = decoded(archive.read(name))
        except ReadError:
            continue
        for match in _ASSIGNED.finditer(text):
            index = int(match[2]) if match[2].isdigit() and len(match[2]) < 4 else 0
            found.add((match[1].upper(), index))
    return tuple(f"{name}[{index or 'any'}]" for name, index in sorted(found))
