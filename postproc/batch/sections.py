"""Large point clouds in several programs: by region of the part, by operation, or by count.

Names depend on where a section lies, not on how many came before, so that one more hole changes
the program of its own region only (``count`` cannot promise that, and says so).
"""

from __future__ import annotations

import re
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.batch.jobs import Job
from postproc.errors import DataError, SourceRef
from postproc.model.toolpath import MotionKind, ToolPath
from postproc.pipeline.convert import ConvertRequest
from postproc.units import MM

_Rows = NDArray[np.signedinteger[Any]]

_ROWS = {f.name for f in fields(ToolPath)} & {
    "points", "axes", "kind", "feed", "line", "operation", "tool", "arc", "cycle", "rotations",
    "joints",
}  # fmt: skip


def parse_rule(text: str) -> tuple[str, float]:
    """Return (kind, size) of ``region:MM``, ``count:N`` or ``operation``.

    Raises:
        DataError: BAT040 if the text is none of these.
    """
    match = re.fullmatch(r"(region|count):(\d+(?:\.\d+)?)|operation", text)
    if not match or (match[2] is not None and float(match[2]) <= 0):
        raise DataError(
            "BAT040",
            f"--split {text!r}, expected region:MM, count:N or operation",
            SourceRef("postproc"),
        )
    return (match[1], float(match[2])) if match[1] else ("operation", 0.0)


def subset(path: ToolPath, rows: _Rows) -> ToolPath:
    """Return the tags ``rows`` (k,) of a toolpath; tables are kept, events within are moved.

    Events before the first row of the input (spindle on, coolant on) go before each section.
    """
    columns = {name: getattr(path, name)[rows] for name in _ROWS if getattr(path, name) is not None}
    place = np.searchsorted(rows, np.arange(len(path) + 1))
    keep = set(rows.tolist())
    events = tuple(
        replace(event, index=int(place[event.index]))
        for event in path.events
        if event.index == 0 or event.index in keep or event.index == len(path)
    )
    names = tuple(path.names[i] for i in rows) if path.names is not None else None
    return replace(path, **columns, events=events, names=names)


def section_labels(path: ToolPath, rule: tuple[str, float]) -> list[tuple[str, _Rows]]:
    """Return (label, rows) per section, in the order in which the input first touches them.

    Raises:
        DataError: BAT041 if the input is a continuous path, which cannot be cut by region.
    """
    kind, size = rule
    key: _Rows
    if kind == "operation":
        key = path.operation[:, None].astype(np.int64)
    else:
        holes = path.format == "csv" or bool((path.kind == MotionKind.HOLE).all())
        if kind == "region" and not holes:
            raise DataError(
                "BAT041",
                "only point clouds of holes can be split by region; use operation or count",
                SourceRef(path.path),
            )
        key = (
            (np.arange(len(path)) // int(size))[:, None]
            if kind == "count"
            else np.floor(path.points / (size * MM)).astype(np.int64)
        )
    _, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    grouped = np.argsort(inverse.ravel(), kind="stable")
    ends = np.cumsum(np.bincount(inverse.ravel()))
    return [
        (_label(kind, key[first[g]], path), grouped[ends[g - 1] if g else 0 : ends[g]])
        for g in order
    ]


def _label(kind: str, key: _Rows, path: ToolPath) -> str:
    if kind == "count":
        return f"{int(key[0]) + 1:03d}"
    if kind == "operation":
        index = int(key[0])
        name = path.operations[index].name if index >= 0 else "REST"
        return re.sub(r"\W+", "_", name)[:10].upper() or "REST"
    return "".join(
        f"{axis}{'N' if value < 0 else ''}{abs(int(value))}"
        for axis, value in zip("XYZ", key, strict=True)
    )


def split_job(job: Job, path: ToolPath, rule: tuple[str, float]) -> list[Job]:
    """Return one job per section of a job's toolpath, named after the section."""
    from postproc.krl.names import legal_name

    stem = job.request.name or Path(job.request.source).stem
    jobs = []
    for label, rows in section_labels(path, rule):
        name = legal_name(f"{stem[: max(1, 23 - len(label))]}_{label}")
        request: ConvertRequest = replace(job.request, name=name)
        jobs.append(Job(f"{job.key}#{label}", request, subset(path, rows)))
    return jobs


def caller_program(name: str, sections: list[str]) -> dict[str, bytes]:
    """Return a program that calls the sections' programs in order; each sets itself up."""
    from postproc.emitters.kuka_krl import render_files
    from postproc.krl.program import Call, KrlModule, Routine

    routine = Routine(name, tuple(Call(section) for section in sections))
    attributes = ("ACCESS RVP", "REL 1")
    return render_files([KrlModule(name, (routine,), attributes=attributes)])
