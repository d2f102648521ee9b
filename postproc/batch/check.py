"""Is what stands in a folder what would be made now? Everything is made anew in memory."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import field
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from postproc.batch.child import JobResult
from postproc.batch.fingerprint import forget
from postproc.batch.jobs import Job, uniquely_named
from postproc.batch.manifest import Manifest
from postproc.batch.run import BatchOptions, Progress, called, execute, vanished
from postproc.batch.sections import expand
from postproc.errors import PostprocError
from postproc.records import dataclass

if TYPE_CHECKING:
    from postproc.comparison import DiffReport


@dataclass(slots=True)
class Checked:
    """Entries by key, status ``ok``, ``different``, ``vanished`` or the failure; differences.

    ``reports``: what the robot would do differently, by program.
    """

    entries: dict[str, dict[str, Any]] = field(default_factory=dict)
    reports: dict[str, DiffReport] = field(default_factory=dict)

    @property
    def bad(self) -> list[str]:
        """Keys whose programs are not what would be made now."""
        return [key for key, entry in self.entries.items() if entry["status"] != "ok"]

    def document(self) -> dict[str, Any]:
        """Return the ``postproc.batch_check/1`` document."""
        return {
            "schema": "postproc.batch_check/1",
            "same": not self.bad,
            "entries": self.entries,
            "differences": {name: report.to_dict() for name, report in self.reports.items()},
        }


def check_batch(
    jobs: Sequence[Job], folder: Path, options: BatchOptions, progress: Progress | None = None
) -> Checked:
    """Make everything anew in memory and compare it with what stands in the folder.

    Nothing is written. A program in the folder whose input is gone counts as a difference.
    """
    forget()
    manifest = Manifest.load(folder)
    work = expand(uniquely_named(jobs, manifest.programs), options.split)
    checked = Checked()
    programs: dict[str, str] = {}
    failed = 0
    for done, result in enumerate(chain(work.broken, execute(work.jobs, options)), 1):
        _compare(checked, manifest, result)
        programs[result.key] = result.name if result.status == "ok" else ""
        failed += checked.entries[result.key]["status"] != "ok"
        if progress:
            progress(done, len(work.jobs) + len(work.broken), failed)
    for caller in work.callers:
        _compare(checked, manifest, called(caller, [programs[key] for key in caller.sections]))
    for key, files in vanished(manifest, work.keys).items():
        lines = [f"{folder / name}:1: error BAT016: its input {key} is gone" for name in files]
        if lines:
            checked.entries[key] = {"status": "vanished", "errors": lines}
    checked.entries = dict(sorted(checked.entries.items()))
    checked.reports = dict(sorted(checked.reports.items()))
    return checked


def _compare(checked: Checked, manifest: Manifest, result: JobResult) -> None:
    """Note what differs between a result and what stands in the folder."""
    errors, status = list(result.errors), result.status
    before = manifest.entries.get(result.key, {"files": ()})["files"]
    old = {
        name: path.read_bytes()
        for name in sorted({*before, *result.files})
        if (path := manifest.folder / name).is_file()
    }
    if status == "ok":
        for name in sorted(old.keys() | result.files.keys()):
            what = _difference(old.get(name), result.files.get(name))
            if what:
                errors.append(f"{manifest.folder / name}:1: error BAT016: {what}")
                status = "different"
    if status == "different" and old:
        try:
            checked.reports[result.name] = _report(old, result.files, result.name)
        except PostprocError as problem:  # what stands there is no KRL
            errors.append(str(problem))
    checked.entries[result.key] = {"status": status, "errors": errors}


def _difference(old: bytes | None, new: bytes | None) -> str:
    if old == new:
        return ""
    if new is None:
        return "is not made any more"
    return "is missing" if old is None else "is not what would be written now"


def _report(old: Mapping[str, bytes], new: Mapping[str, bytes], name: str) -> DiffReport:
    from postproc.comparison import diff_files

    return diff_files(old, new, name)


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
