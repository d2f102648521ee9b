"""An outcome as JUnit XML, which every CI system shows."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Any

_FAILURES = {"failed", "different"}


def junit_xml(
    entries: Mapping[str, Mapping[str, Any]], suite_name: str = "postproc batch"
) -> bytes:
    """Return a test suite with one case per entry, by name: ``status`` and ``errors``."""
    failed = sum(entry["status"] in _FAILURES for entry in entries.values())
    errors = sum(entry["status"] not in _FAILURES | {"ok"} for entry in entries.values())
    suite = ET.Element(
        "testsuite",
        name=suite_name,
        tests=str(len(entries)),
        failures=str(failed),
        errors=str(errors),
    )
    for key in sorted(entries):
        entry = entries[key]
        case = ET.SubElement(suite, "testcase", classname="postproc", name=_printable(key))
        if entry["status"] != "ok":
            kind = "failure" if entry["status"] in _FAILURES else "error"
            lines = [_printable(line) for line in entry["errors"]]
            problem = ET.SubElement(case, kind, message=lines[0] if lines else entry["status"])
            problem.text = "\n".join(lines)
    return bytes(ET.tostring(suite, encoding="utf-8", xml_declaration=True)) + b"\n"


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() or c == "\n" else "?" for c in text)
