"""Which motions of a program's text were judged, which not, and why not.

A motion is not known where it never ran while something before it could not be followed, where its
own goal or data are not known, and where what happens right before it is not: then nobody knows
from where it comes. All else that ran was judged; violations stand at the line that they name.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from postproc.controller import Trace
from postproc.errors import Finding, RunKind
from postproc.krl import KrlModule, Move
from postproc.records import dataclass

NOT_KNOWN = frozenset({RunKind.UNJUDGED, RunKind.CONDITION, RunKind.ENDLESS})
"""What is said where the text alone does not tell what the arm does."""
_FROM_ELSEWHERE = "what happens right before it is not known, so neither is its path"
_Place = tuple[str, int]


@dataclass(frozen=True, slots=True)
class Unknown:
    """A motion that was not judged: its place, and why."""

    file: str
    line: int
    why: str


@dataclass(frozen=True, slots=True)
class Coverage:
    """Motions of the text of a program and what it calls.

    ``judged`` ran and were looked at, ``refused`` of them have a violation at their line;
    ``never_run`` are passed by, for all that is known. The others are ``unknown``.
    """

    in_text: int
    judged: int
    refused: int
    never_run: int
    unknown: tuple[Unknown, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of the JSON document."""
        return {
            "in_text": self.in_text,
            "judged": self.judged,
            "refused": self.refused,
            "never_run": self.never_run,
            "unknown": [{"file": u.file, "line": u.line, "why": u.why} for u in self.unknown],
        }


def coverage_of(
    modules: Sequence[KrlModule], trace: Trace, violations: Iterable[Finding]
) -> Coverage:
    """Return what was judged of the motions in the text of modules."""
    files = [trace.files[file] for file in trace.file.tolist()]
    run = list(zip(files, trace.line.tolist(), strict=True))
    ran = dict(zip(reversed(run), reversed(range(len(run))), strict=True))
    said: dict[_Place, Finding] = {}
    doubts: list[Finding] = []
    for finding in violations:
        said.setdefault(finding.place, finding)
        if finding.code in NOT_KNOWN:
            doubts.append(finding)
    counts = {"in_text": 0, "judged": 0, "refused": 0, "never_run": 0}
    unknown = []
    for places in _motions(modules):
        if not (said or doubts or trace.unsure):  # nothing is in question: they are only counted
            known = sum(place in ran for place in places)
            counts["in_text"] += len(places)
            counts["judged"] += known
            counts["never_run"] += len(places) - known
            continue
        is_open = False  # a motion was passed by that may have run, and nothing known ran since
        for place in places:
            motion = ran.get(place)
            why = _why_not(place, motion, trace, said, doubts)
            if not why and is_open:
                why, is_open = _FROM_ELSEWHERE, False
            elif why and motion is None:
                is_open = True
            counts["in_text"] += 1
            if why:
                unknown.append(Unknown(*place, why))
                continue
            counts["judged"] += motion is not None
            counts["refused"] += motion is not None and place in said
            counts["never_run"] += motion is None
    return Coverage(**counts, unknown=tuple(unknown))


def _motions(modules: Sequence[KrlModule]) -> Iterator[list[_Place]]:
    """Yield the places of the motions of each routine."""
    for module in modules:
        for routine in module.routines:
            path = module.src_path
            yield [(path, move.line) for move in routine.statements if type(move) is Move]


def _why_not(
    place: _Place,
    motion: int | None,
    trace: Trace,
    said: dict[_Place, Finding],
    doubts: Sequence[Finding],
) -> str:
    """Return why a motion is not known, empty if it is; ``motion``: its first run."""
    own = said.get(place)
    if own is not None and (motion is None or own.code in NOT_KNOWN):
        return own.message
    if motion is None:
        return f"not reached: {doubts[0].message}" if doubts else ""
    if motion in trace.unsure:
        return _FROM_ELSEWHERE
    return ""
