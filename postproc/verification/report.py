"""The answer of a verification."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field
from typing import Any, NamedTuple

import numpy as np

from postproc.arrays import AnyIntArray, FloatArray
from postproc.errors import Finding, RunKind, Severity, SourceRef
from postproc.paths import Paths
from postproc.records import dataclass
from postproc.units import DEG, MM
from postproc.verification.coverage import Coverage


@dataclass(frozen=True, slots=True)
class Worst:
    """The worst value of one measure and the line it belongs to; ``unit`` as in files."""

    value: float
    unit: str
    file: str
    line: int
    detail: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of the JSON document."""
        return {
            "value": round(self.value, 6),
            "unit": self.unit,
            "file": self.file,
            "line": self.line,
            "detail": self.detail,
        }


class Remark(NamedTuple):
    """A finding at a motion, at a file and line, or, with None, about the program as a whole."""

    kind: RunKind
    place: int | tuple[str, int] | None
    message: str
    severity: Severity = Severity.ERROR
    hint: str = ""
    headline: bool = False


class Measure(NamedTuple):
    """The worst value of a measure, and its motion; a later one of the same name replaces it."""

    name: str
    value: float
    unit: str
    motion: int
    detail: str = ""


Said = Remark | Measure
"""What a check has to say."""
AT_MOST = 20
"""So many findings of one kind are listed one by one."""


def listed(rows: AnyIntArray, what: str, by: FloatArray | None = None) -> Iterator[tuple[int, str]]:
    """Yield the first so many rows, the largest ``by`` first, and how many ``what`` there are."""
    more = f", {len(rows)} such {what}" if len(rows) > AT_MOST else ""
    if by is not None:
        rows = rows[np.argsort(-by[rows], kind="stable")]
    yield from ((row, more) for row in rows[:AT_MOST].tolist())


def few_of_each(remarks: Iterable[Remark]) -> Iterator[Remark]:
    """Yield the first so many remarks of each kind."""
    count: Counter[RunKind] = Counter()
    for remark in remarks:
        count[remark.kind] += 1
        if count[remark.kind] <= AT_MOST:
            yield remark


def collected(said: Iterable[Said], paths: Paths) -> tuple[list[Finding], dict[str, Worst]]:
    """Return what checks say as findings and worst values by their names."""
    trace, findings, worst = paths.trace, [], {}
    for item in said:
        if isinstance(item, Measure):
            worst[item.name] = Worst(item.value, item.unit, *trace.place(item.motion), item.detail)
            continue
        place = trace.place(item.place) if isinstance(item.place, int) else item.place
        source = SourceRef(*(place or (trace.files[0] if trace.files else "", 1)))
        findings.append(
            Finding(
                item.severity,
                item.kind,
                item.message,
                source=source,
                hint=item.hint,
                headline=item.headline,
            )
        )
    return findings, worst


@dataclass(frozen=True, slots=True)
class Expectation:
    """How far the real tool is expected from the CAM points, and the commanded one is [m].

    Over all CAM points, missed ones by how near the program comes: worst and root mean square.
    """

    expected_max: float
    expected_rms: float
    nominal_max: float
    nominal_rms: float

    def to_dict(self) -> dict[str, float]:
        """Return the entries of the JSON document."""
        names = ("expected_max", "expected_rms", "nominal_max", "nominal_rms")
        return {f"{n}_position_error_mm": round(getattr(self, n) / MM, 6) for n in names}


@dataclass(frozen=True, slots=True)
class Tolerances:
    """How far the program may be from the CAM file.

    ``position`` [m] of points, ``axis`` [rad] of the tool axis there, ``path`` [m] along arcs and
    lines beside the points; None: the chord tolerance of the cell.
    """

    position: float = 0.01 * MM
    axis: float = 0.005 * DEG
    path: float | None = None


@dataclass(frozen=True, slots=True)
class Played:
    """The run that was judged, motion by motion (m,), for those who want to see it.

    ``durations`` (m,) estimated [s]; ``served`` (n,) motion that goes to each CAM point, -1 for
    none, and ``position_error`` (n,) there [m] (of the real tool, where a model was given), both
    None without a CAM file.
    """

    paths: Paths
    durations: FloatArray
    tolerances: Tolerances
    served: AnyIntArray | None = None
    position_error: FloatArray | None = None


@dataclass(frozen=True, slots=True)
class VerifyReport:
    """What a program does on the robot model, and how far it is what the CAM file asks for.

    Args:
        program: name; points: executed motions.
        violations: what makes the program bad; warnings: what does not.
        cycle_time: estimate [s].
        worst: the worst value of each measure.
        position_error: largest distance of a CAM point from where the program goes, with a model
            from where the real tool is expected [m]; axis_error: largest angle of the tool axis
            there beyond the allowed tilt [rad]; tilt: largest that was used of it [rad]; all None
            without a CAM file.
        tags: CAM points; matched: those that were gone to or passed, in order; passed: those that
            no motion ends at, as ``[motion] thin`` of the cell allows.
        expectation: real and commanded tool beside each other, None without a model.
        coverage: which motions of the text were judged, and which are not known.
        run: what was judged.
    """

    program: str
    points: int
    violations: tuple[Finding, ...]
    warnings: tuple[Finding, ...] = ()
    cycle_time: float = 0.0
    worst: Mapping[str, Worst] = field(default_factory=dict)
    position_error: float | None = None
    axis_error: float | None = None
    tilt: float | None = None
    tags: int | None = None
    matched: int | None = None
    passed: int | None = None
    expectation: Expectation | None = None
    collisions_checked: bool = False
    coverage: Coverage | None = None
    run: Played | None = field(default=None, compare=False, repr=False)

    @property
    def ok(self) -> bool:
        """Whether nothing stands against the program."""
        return not self.violations

    def to_dict(self) -> dict[str, Any]:
        """Return the ``postproc.verify/1`` document."""
        position, axis = self.position_error, self.axis_error
        return {
            "schema": "postproc.verify/1",
            "program": self.program,
            "ok": self.ok,
            "points": self.points,
            "tags": self.tags,
            "matched": self.matched,
            "passed": self.passed,
            "max_position_error_mm": _in_unit(position, MM),
            "max_axis_error_deg": _in_unit(axis, DEG),
            "max_tilt_deg": _in_unit(self.tilt, DEG),
            **({} if self.expectation is None else self.expectation.to_dict()),
            "violations": [_entry(item) for item in self.violations],
            "warnings": [_entry(item) for item in self.warnings],
            **({} if self.coverage is None else {"motions": self.coverage.to_dict()}),
            "worst": {name: item.to_dict() for name, item in sorted(self.worst.items())},
            "collisions_checked": self.collisions_checked,
            "cycle_time_s": round(self.cycle_time, 3),
        }


def _in_unit(value: float | None, unit: float) -> float | None:
    """Return a number for the document; None without one, or where nothing was passed at all."""
    return None if value is None or not math.isfinite(value) else round(value / unit, 6)


def _entry(finding: Finding) -> dict[str, Any]:
    file, line = finding.place
    return {"line": line, "kind": finding.code, "detail": finding.message, "file": file}


def in_order(findings: list[Finding], severity: Severity) -> tuple[Finding, ...]:
    """Return the findings of a severity, each once: headlines first, then by file and line."""
    own = dict.fromkeys(item for item in findings if item.severity is severity)
    return tuple(sorted(own, key=lambda item: (not item.headline, item.place, item.code)))
