"""The motions of one block: points, arcs and rapids, fast lines and unusual ones together."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.readers.apt.dialect import ArcSense, Dialect
from postproc.readers.apt.scan import CIRCLE, CIRCLE_FIELDS, GOTO, RAPID, SKIP, Scan
from postproc.readers.apt.statement import Statement, bounded
from postproc.readers.text import Faults

_TLON = re.compile(
    r"TLON\s*,\s*GO(?:FWD|LFT|RGT|BACK)\s*/\s*\(\s*CIRCLE\s*/([^)]*)\)\s*,.*"
    r"\(\s*LINE\s*/([^)]*)\)\s*$",
    re.IGNORECASE,
)
_POINT, _POINT_AXIS, _ARC = 3, 6, 6
_MOST_TURNS = 10_000
_TAKEN = frozenset({"GOTO", "CIRCLE", "RAPID", "GODLTA", "INDIRV"})


@dataclass(slots=True)
class Motions:
    """Motions of a block with k points and m arcs, numbers as written in the file.

    ``lines`` (k,) line indices; ``points`` (k, 6), axis NaN where not given; ``relative`` indices
    of points given as increments; ``rapid`` (k,). ``arc_target`` (m,) index of the point at which
    each arc ends, k = the first of the next block; ``arc_line`` (m,); ``arcs`` (m, 7);
    ``arc_sign`` (m,) +1 counterclockwise about the written vector, -1 clockwise; ``arc_turns``
    (m,); ``arc_tangent`` (m, 3) start direction that stands in for the vector, NaN else.
    """

    lines: IndexArray
    points: FloatArray
    relative: list[int]
    rapid: BoolArray
    arc_target: IndexArray
    arc_line: IndexArray
    arcs: FloatArray
    arc_sign: FloatArray
    arc_turns: IndexArray
    arc_tangent: FloatArray


class MotionReader:
    """Turns scanned blocks into motions; carries RAPID, tangents and arcs over block borders."""

    def __init__(self, dialect: Dialect, faults: Faults) -> None:
        self._dialect = dialect
        self._faults = faults
        self._rapid = False
        self._tangent: list[float] | None = None
        self._pending: tuple[int, FloatArray, float, int, FloatArray] | None = None
        self._scan: Scan
        self._points: dict[int, list[float]] = {}
        self._relative: set[int] = set()
        self._arcs: dict[int, tuple[list[float], float, int]] = {}
        self._tangents: dict[int, list[float]] = {}
        self._feeds: list[int] = []

    def read(self, scan: Scan) -> Motions:
        """Return the motions of a block; takes their statements out of ``scan.others``."""
        self._scan = scan
        bulk_points = np.flatnonzero(scan.code == GOTO)
        bulk_arcs = np.flatnonzero(scan.code == CIRCLE)
        self._points, self._relative, self._arcs, self._tangents = {}, set(), {}, {}
        self._feeds = []
        scan.others = [item for item in scan.others if not self._take(*item)]
        lines = np.flatnonzero(scan.code == GOTO)
        points = self._merged(lines, bulk_points, scan.goto, self._points, 6)
        relative = [int(np.searchsorted(lines, line)) for line in sorted(self._relative)]
        rapid = self._rapids(lines)
        return self._with_arcs(lines, points, relative, rapid, bulk_arcs)

    def finish(self) -> None:
        """Check that nothing waits for a point that never came.

        Raises:
            ReadError: APT030 for an arc without an end point.
        """
        if self._pending is not None:
            raise self._faults.error(
                "APT030", "an arc has no end point: no GOTO follows", self._pending[0]
            )

    def _take(self, index: int, statement: Statement) -> bool:
        """Handle a motion statement that the bulk did not take; False for any other word."""
        word = statement.word
        if word == "FEDRAT":
            self._feeds.append(index)
        if word not in _TAKEN and not word.startswith("TLON"):
            return False
        line = self._scan.line(index)
        if word == "GOTO":
            self._points[index] = self._point(statement, line)
            self._scan.code[index] = GOTO
        elif word == "CIRCLE":
            self._arcs[index] = self._arc(statement, line)
            self._scan.code[index] = CIRCLE
        elif word == "RAPID":
            self._scan.code[index] = RAPID
        elif word == "GODLTA":
            self._points[index] = self._increment(statement, line)
            self._relative.add(index)
            self._scan.code[index] = GOTO
        elif word == "INDIRV":
            self._tangent = self._three(statement, line)
            self._scan.code[index] = SKIP
        else:
            self._tool_on(index, statement, line)
        return True

    def _values(self, statement: Statement, line: int) -> list[float]:
        """Return the leading numbers of a motion statement, with the fixes of ``--recover``."""
        args = [arg for arg in statement.args]
        while args and not args[-1]:
            args.pop()
            self._faults.fix(
                "APT020", "empty field at the end", "it is left out", line, statement.text
            )
        if any(" " in arg for arg in args):
            if not self._dialect.blank_separates:
                self._faults.fix(
                    "APT021",
                    "two numbers without a comma between them",
                    "the blank separates them",
                    line,
                    statement.text,
                )
            args = [part for arg in args for part in arg.split()]
        values = []
        for arg in args:
            value = bounded(arg)
            if value is None:
                raise self._faults.error(
                    "APT022",
                    f"{statement.word} has {arg[:20]!r} where a number of at most 1e9 was expected",
                    line,
                    statement.text,
                )
            values.append(value)
        return values

    def _point(self, statement: Statement, line: int) -> list[float]:
        values = self._values(statement, line)
        if len(values) not in (_POINT, _POINT_AXIS):
            raise self._faults.error(
                "APT023",
                f"GOTO has {len(values)} numbers, expected 3 (point) or 6 (point and tool axis)",
                line,
                statement.text,
            )
        return values + [np.nan] * (6 - len(values))

    def _increment(self, statement: Statement, line: int) -> list[float]:
        values = self._values(statement, line)
        if len(values) not in (1, _POINT, _POINT_AXIS):
            raise self._faults.error(
                "APT023",
                f"GODLTA has {len(values)} numbers, expected 3 (or 1, along the tool axis)",
                line,
                statement.text,
            )
        if len(values) == 1:
            values = [np.nan, np.nan, values[0]]
        return values + [np.nan] * (6 - len(values))

    def _three(self, statement: Statement, line: int) -> list[float]:
        values = self._values(statement, line)
        if len(values) != _POINT or not any(values):
            raise self._faults.error(
                "APT024", "INDIRV needs a direction of 3 numbers", line, statement.text
            )
        return values

    def _arc(self, statement: Statement, line: int) -> tuple[list[float], float, int]:
        """Return the 7 numbers, the sign by the record's word (0: by the dialect), extra turns."""
        words = [arg.upper() for arg in statement.args]
        turns = 0
        if "TIMES" in words:
            at = words.index("TIMES")
            count = bounded(words[at + 1]) if at + 1 < len(words) else None
            if count is None or count != int(count) or not 0 <= count <= _MOST_TURNS:
                raise self._faults.error(
                    "APT031", "TIMES needs a whole number of turns", line, statement.text
                )
            turns, words = int(count), words[:at]
        sign = 0.0
        for name, value in (("COUNTERCLOCKWISE", 1.0), ("CCLW", 1.0), ("CLOCKWISE", -1.0),
                            ("CLW", -1.0)):  # fmt: skip
            if words and words[-1] == name:
                sign, words = value, words[:-1]
        values = self._values(Statement("CIRCLE", tuple(words), statement.text), line)
        if len(values) < _ARC:
            raise self._faults.error(
                "APT032",
                f"CIRCLE has {len(values)} numbers, expected centre, vector and perhaps radius",
                line,
                statement.text,
            )
        values = values[:CIRCLE_FIELDS]
        return values + [np.nan] * (CIRCLE_FIELDS - len(values)), sign, turns

    def _tool_on(self, index: int, statement: Statement, line: int) -> None:
        """Take CATIA's arc: a circle, a start direction by INDIRV, and the line to the end."""
        match = _TLON.match(statement.text)
        if match is None:
            raise self._faults.error(
                "APT033",
                "TLON is read as an arc only, (CIRCLE/x,y,z,r),ON,(LINE/x,y,z,x,y,z)",
                line,
                statement.text,
            )
        circle = [bounded(text) for text in match.group(1).split(",")]
        ray = [bounded(text) for text in match.group(2).split(",")]
        if None in circle or None in ray or len(circle) != 4 or len(ray) not in (4, 6):
            raise self._faults.error(
                "APT033", "TLON needs CIRCLE/x,y,z,r and LINE/x,y,z,x,y,z", line, statement.text
            )
        if self._tangent is None:
            raise self._faults.error(
                "APT034", "TLON without INDIRV before it: no start direction", line, statement.text
            )
        numbers = [float(v) for v in circle if v is not None]
        end = [float(v) for v in ray if v is not None]
        end = end[3:6] if len(end) == 6 else [*end[2:4], numbers[2]]
        self._points[index] = [*end, np.nan, np.nan, np.nan]
        self._arcs[index] = ([*numbers[:3], 0.0, 0.0, 1.0, numbers[3]], 1.0, 0)
        self._tangents[index] = self._tangent
        self._tangent = None
        self._scan.code[index] = GOTO

    @staticmethod
    def _merged(
        lines: IndexArray,
        bulk: IndexArray,
        values: FloatArray,
        slow: dict[int, list[float]],
        width: int,
    ) -> FloatArray:
        if not slow:
            return values
        result = np.full((len(lines), width), np.nan)
        result[np.searchsorted(lines, bulk)] = values
        keys = np.array(sorted(slow), dtype=np.int64)
        result[np.searchsorted(lines, keys)] = [slow[int(key)] for key in keys]
        return result

    def _rapids(self, lines: IndexArray) -> BoolArray:
        """Return which points (k,) a RAPID applies to: the next one only."""
        k = len(lines)
        last = np.full(k + 1, -2, dtype=np.int64)
        if self._rapid:
            last[0] = -1
        rapid_lines = np.flatnonzero(self._scan.code == RAPID)
        last[np.searchsorted(lines, rapid_lines)] = rapid_lines
        if self._dialect.feed_cancels_rapid and self._feeds:
            feed_lines = np.array(self._feeds, dtype=np.int64)
            cancelled = np.full(k + 1, -2, dtype=np.int64)
            cancelled[np.searchsorted(lines, feed_lines)] = feed_lines
            last[cancelled > last] = -2
        self._rapid = bool(last[k] > -2)
        return np.asarray(last[:k] > -2)

    def _with_arcs(
        self,
        lines: IndexArray,
        points: FloatArray,
        relative: list[int],
        rapid: BoolArray,
        bulk: IndexArray,
    ) -> Motions:
        slow = self._arcs
        arc_lines = np.union1d(bulk, np.array(sorted(slow), dtype=np.int64)) if slow else bulk
        m = len(arc_lines)
        merged = {line: values for line, (values, _, _) in slow.items()}
        arcs = self._merged(arc_lines, bulk, self._scan.circle, merged, CIRCLE_FIELDS)
        default = -1.0 if self._dialect.arc_sense is ArcSense.CLOCKWISE else 1.0
        sign = np.full(m, default)
        turns = np.zeros(m, dtype=np.int64)
        tangent = np.full((m, 3), np.nan)
        for line, (_, given, count) in slow.items():
            at = int(np.searchsorted(arc_lines, line))
            sign[at] = given or default
            turns[at] = count
            tangent[at] = self._tangents.get(line, [np.nan] * 3)
        target = np.searchsorted(lines, arc_lines)
        numbers = arc_lines + self._scan.block.first_line
        motions = Motions(
            lines, points, relative, rapid, target, numbers, arcs, sign, turns, tangent
        )
        self._carry_arc(motions)
        self._check_targets(motions)
        return motions

    def _carry_arc(self, motions: Motions) -> None:
        """Prepend the arc that waits from the block before; keep one that waits for the next."""
        if self._pending is not None and len(motions.lines):
            line, values, sign, turns, tangent = self._pending
            motions.arc_target = np.concatenate([[0], motions.arc_target])
            motions.arc_line = np.concatenate([[line], motions.arc_line])
            motions.arcs = np.concatenate([values[None], motions.arcs])
            motions.arc_sign = np.concatenate([[sign], motions.arc_sign])
            motions.arc_turns = np.concatenate([[turns], motions.arc_turns])
            motions.arc_tangent = np.concatenate([tangent[None], motions.arc_tangent])
            self._pending = None
        if len(motions.arc_target) and motions.arc_target[-1] == len(motions.lines):
            if self._pending is not None:
                raise self._two_arcs(int(motions.arc_line[-1]))
            self._pending = (
                int(motions.arc_line[-1]),
                motions.arcs[-1],
                float(motions.arc_sign[-1]),
                int(motions.arc_turns[-1]),
                motions.arc_tangent[-1],
            )
            motions.arc_target = motions.arc_target[:-1]
            motions.arc_line = motions.arc_line[:-1]
            motions.arcs = motions.arcs[:-1]
            motions.arc_sign = motions.arc_sign[:-1]
            motions.arc_turns = motions.arc_turns[:-1]
            motions.arc_tangent = motions.arc_tangent[:-1]

    def _check_targets(self, motions: Motions) -> None:
        double = np.flatnonzero(np.diff(motions.arc_target) == 0)
        if len(double):
            raise self._two_arcs(int(motions.arc_line[double[0] + 1]))

    def _two_arcs(self, line: int) -> Exception:
        return self._faults.error("APT035", "two CIRCLE records without a GOTO between them", line)
