"""The motions of one block: points, arcs and rapids, fast lines and unusual ones together."""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, IntArray
from postproc.model import WordClass
from postproc.readers.apt import arctext
from postproc.readers.apt.arcs import ArcRecords
from postproc.readers.apt.arctext import NAN, WrittenArc, numbers_of
from postproc.readers.apt.dialect import ArcSense, Dialect, EighthField
from postproc.readers.apt.statement import CIRCLE, GOTO, RAPID, SKIP, Scan, Statement, bounded
from postproc.readers.text import Faults
from postproc.readers.uses import AtLine, WordUses
from postproc.records import dataclass

_POINT, _POINT_AXIS = 3, 6
_TOLERANCE = 1.0
"""Field 8 of a CIRCLE record up to this is a tolerance [mm or inch], above it a sweep [deg]."""
_NEVER = -2
_NORMALS = {"XYPLAN": (0.0, 0.0, 1.0), "YZPLAN": (1.0, 0.0, 0.0), "ZXPLAN": (0.0, 1.0, 0.0)}


@dataclass(slots=True)
class Motions:
    """Motions of a block with k points, numbers as written in the file.

    ``lines`` (k,) line indices; ``points`` (k, 6), axis NaN where not given; ``rapid`` (k,);
    ``suspends`` (k,) which rapids take their point out of a drill cycle: those behind its CYCLE;
    ``arcs``: those that end in this block, their ``tag`` the index of that point, k for the next
    block's first, lengths as written. What is computed from the point before, by index: points
    ``relative``, given as increments, and ``lifted`` up to a plane i, j, k, d along the tool axis;
    ``written``: arcs of which the end or the start direction is.
    """

    lines: IndexArray
    points: FloatArray
    rapid: BoolArray
    suspends: BoolArray
    arcs: ArcRecords
    relative: list[int] = field(default_factory=list)
    lifted: dict[int, list[float]] = field(default_factory=dict)
    written: dict[int, WrittenArc] = field(default_factory=dict)


class MotionReader(AtLine):
    """Turns scanned blocks into motions; carries RAPID, tangents and arcs over block borders."""

    def __init__(self, dialect: Dialect, faults: Faults, uses: WordUses) -> None:
        super().__init__(faults, uses)
        self._dialect = dialect
        self._rapid = self._cycled = False
        """Whether a RAPID waits for a point of a later block, and a CYCLE comes after it."""
        self._tangent: list[float] | None = None
        self._towards: list[float] | None = None
        self._rise = NAN
        """Rise that waits for an arc of a later block."""
        self._clearance: list[float] | None = None
        self._pending: ArcRecords | None = None
        self._scan: Scan
        self._points: dict[int, list[float]] = {}
        self._relative: set[int] = set()
        self._lifted: dict[int, list[float]] = {}
        self._arcs: dict[int, WrittenArc] = {}
        self._slopes: dict[int, float] = {}
        self._feeds: list[int] = []
        self._cycles: list[int] = []

    def read(self, scan: Scan) -> Motions:
        """Return the motions of a block; takes their statements out of ``scan.others``."""
        self._scan = scan
        bulk_points = np.flatnonzero(scan.code == GOTO)
        bulk_arcs = np.flatnonzero(scan.code == CIRCLE)
        self._points, self._relative, self._arcs, self._lifted = {}, set(), {}, {}
        self._slopes, self._feeds, self._cycles = {}, [], []
        scan.others = [item for item in scan.others if not self._take(*item)]
        lines = np.flatnonzero(scan.code == GOTO)
        points = self._merged(lines, bulk_points)
        rapid, suspends = self._rapids(lines)
        motions = Motions(lines, points, rapid, suspends, self._all_arcs(lines, bulk_arcs))
        self._carry_arc(motions)
        motions.relative = [int(np.searchsorted(lines, line)) for line in sorted(self._relative)]
        for line, plane in self._lifted.items():
            motions.lifted[int(np.searchsorted(lines, line))] = plane
            motions.rapid[motions.lines == line] = True
            motions.suspends[motions.lines == line] = True
        motions.written = {
            int(np.searchsorted(lines, line)): arc
            for line, arc in self._arcs.items()
            if arc.plane is not None or arc.towards is not None
        }
        return motions

    def finish(self) -> None:
        """Check that no arc waits for a point that never came."""
        if self._pending is not None:
            text = "an arc has no end point: no GOTO follows"
            raise self.faults.error("APT030", text, int(self._pending.line[0]))

    def _take(self, index: int, statement: Statement) -> bool:
        """Handle a motion statement that the bulk did not take; False for any other word."""
        word = statement.word
        if word == "FEDRAT":
            self._feeds.append(index)
        elif word.startswith("CYCLE"):
            self._cycles.append(index)
        self.line, self.text = self._scan.line(index), statement.text
        if word.startswith("TLON"):
            self._tool_on(index, statement)
            return True
        if word in {"CIRCLE", "ARC", "MOVARC"}:
            self._arc(index, statement)
            return True
        handler = {
            "GOTO": self._goto, "RAPID": self._set_rapid, "GODLTA": self._increment,
            "INDIRV": self._direction, "INDIRP": self._direction, "PSIS": self._skip,
            "ARCSLP": self._slope, "CLEARP": self._clearance_plane,
            "CLRSRF": self._clearance_plane, "RETRCT": self._retract,
        }.get(word)  # fmt: skip
        return handler is not None and handler(index, statement)

    def _values(self, statement: Statement) -> list[float]:
        return numbers_of(self, statement, statement.args, self._dialect.blank_separates)

    def _set_rapid(self, index: int, statement: Statement) -> bool:
        """RAPID: for the next motion only; what stands behind a slash has no meaning there."""
        self._scan.code[index] = SKIP if statement.upper[:1] == ("OFF",) else RAPID
        if any(statement.args):
            text = ",".join(statement.upper)[:20]
            why = f"RAPID holds for the next motion only; {text} behind it is not carried out"
            self.refuse("RAPID", WordClass.GEOMETRY, why)
        return True

    def _skip(self, index: int, statement: Statement) -> bool:
        self._scan.code[index] = SKIP
        return True

    def _goto(self, index: int, statement: Statement) -> bool:
        values = self._values(statement)
        if len(values) not in (_POINT, _POINT_AXIS):
            text = f"GOTO has {len(values)} numbers, expected 3 (point) or 6 (point and tool axis)"
            raise self.error("APT023", text)
        self._place(index, values)
        return True

    def _place(self, index: int, values: list[float]) -> None:
        self._points[index] = values + [NAN] * (6 - len(values))
        self._scan.code[index] = GOTO

    def _increment(self, index: int, statement: Statement) -> bool:
        values = self._values(statement)
        if len(values) not in (1, _POINT, _POINT_AXIS):
            text = f"GODLTA has {len(values)} numbers, expected 3 (increments) or 6 (and tool axis)"
            raise self.error("APT023", text)
        if len(values) == 1:
            reason = "one number alone has no settled meaning; read as a way along the tool axis"
            self.refuse("GODLTA", WordClass.GEOMETRY, reason)
            values = [NAN, NAN, values[0]]
        self._place(index, values)
        self._relative.add(index)
        return True

    def _direction(self, index: int, statement: Statement) -> bool:
        """INDIRV/i,j,k: a direction; INDIRP/x,y,z: a point in that direction."""
        values = self._values(statement)
        vector = statement.word == "INDIRV"
        if len(values) != _POINT or (vector and not any(values)):
            text = f"{statement.word} needs a {'direction' if vector else 'point'} of 3 numbers"
            raise self.error("APT024", text)
        self._tangent, self._towards = (values, None) if vector else (None, values)
        return self._skip(index, statement)

    def _slope(self, index: int, statement: Statement) -> bool:
        """ARCSLP/dz: the arc that follows is a helix and ends so much higher or lower."""
        values = self._values(statement)
        if len(values) != 1:
            raise self.error("APT086", "ARCSLP needs one number, the rise")
        self._slopes[index] = values[0]
        return self._skip(index, statement)

    def _clearance_plane(self, index: int, statement: Statement) -> bool:
        """CLEARP/XYPLAN,z and CLRSRF/z or /i,j,k,d: the plane that RETRCT lifts to."""
        words = [word for word in statement.upper if word != "NORMAL"]
        normal = _NORMALS.get(words[0] if words else "")
        values = [bounded(word) for word in (words[1:] if normal else words)]
        numbers = [value for value in values if value is not None]
        self._clearance = None
        if len(numbers) == len(values) == 1:
            self._clearance = [*(normal or _NORMALS["XYPLAN"]), numbers[0]]
        elif len(numbers) == len(values) == 4 and normal is None:
            self._clearance = numbers
        else:
            text = "a clearance plane that is not understood"
            self.refuse(statement.word, WordClass.GEOMETRY, text)
        return self._skip(index, statement)

    def _retract(self, index: int, statement: Statement) -> bool:
        """RETRCT: along the tool axis to the clearance plane, in rapid."""
        words = [word for word in statement.upper if word not in {"TO", "TOOL", ""}]
        if words or self._clearance is None:
            what = "the clearance plane is not known" if not words else f"{words[0]} is not done"
            self.refuse("RETRCT", WordClass.GEOMETRY, f"{what}; the tool stays where it is")
            return self._skip(index, statement)
        self._place(index, [NAN] * 3)
        self._lifted[index] = self._clearance
        return True

    def _arc(self, index: int, statement: Statement) -> None:
        """CIRCLE and MOVARC end at the next GOTO, ARC at its own end."""
        if statement.word == "MOVARC":
            arc = arctext.movarc(self, statement)
        elif statement.word == "ARC":
            arc = arctext.arc_with_end(self, statement)
        else:
            blanks = self._dialect.blank_separates
            arc = arctext.circle(self, statement, blanks)
        self._arcs[index] = arc
        if arc.end is not None:
            self._place(index, arc.end)
        else:
            self._scan.code[index] = CIRCLE

    def _tool_on(self, index: int, statement: Statement) -> None:
        """TLON,GOFWD/(circle),ON,(what ends it): the arcs of CATIA and NCL."""
        arc = arctext.tool_on(self, statement, self._tangent, self._towards)
        self._tangent = self._towards = None
        self._arcs[index] = arc
        self._place(index, arc.end or [NAN] * 3)

    def _merged(self, lines: IndexArray, bulk: IndexArray) -> FloatArray:
        """Return the points (k, 6) of the bulk and of the unusual lines in their order."""
        if not self._points:
            return self._scan.goto
        result = np.full((len(lines), 6), np.nan)
        result[np.searchsorted(lines, bulk)] = self._scan.goto
        keys = np.array(sorted(self._points), dtype=np.int64)
        result[np.searchsorted(lines, keys)] = [self._points[int(key)] for key in keys]
        return result

    def _rapids(self, lines: IndexArray) -> tuple[BoolArray, BoolArray]:
        """Return which points (k,) a RAPID applies to, the next one only, and which it suspends."""
        k = len(lines)
        rapid = _last_before(lines, np.flatnonzero(self._scan.code == RAPID), self._rapid)
        if self._dialect.feed_cancels_rapid:
            rapid[_last_before(lines, self._feeds) > rapid] = _NEVER
        suspends = rapid > _last_before(lines, self._cycles, self._cycled)
        is_rapid = rapid > _NEVER
        self._rapid, self._cycled = bool(is_rapid[k]), bool(is_rapid[k] and not suspends[k])
        return is_rapid[:k], suspends[:k]

    def _all_arcs(self, lines: IndexArray, bulk: IndexArray) -> ArcRecords:
        """Return the arcs of the bulk and of the unusual lines in their order."""
        at = np.union1d(bulk, np.array(sorted(self._arcs), dtype=np.int64))
        m, rows = len(at), np.searchsorted(at, bulk)
        numbers, tangent = np.full((m, 7), np.nan), np.full((m, 3), np.nan)
        eighth, sign, sweep = (np.full(m, np.nan) for _ in range(3))
        free, turns = np.zeros(m, dtype=np.bool_), np.zeros(m, dtype=np.int32)
        numbers[rows], eighth[rows] = self._scan.circle[:, :7], self._scan.circle[:, 7]
        for line, arc in self._arcs.items():
            row = int(np.searchsorted(at, line))
            numbers[row], eighth[row], sign[row] = arc.numbers, arc.eighth, arc.sign
            free[row], turns[row], sweep[row] = arc.is_free, arc.turns, arc.sweep
            tangent[row] = arc.tangent or [NAN] * 3
        self._by_dialect(eighth, turns, sign, free, sweep)
        return ArcRecords(
            tag=np.searchsorted(lines, at).astype(np.int32),
            line=(at + self._scan.block.first_line).astype(np.int32),
            centre=numbers[:, :3],
            normal=numbers[:, 3:6] * sign[:, None],
            tangent=tangent,
            radius=numbers[:, 6],
            turns=turns,
            sweep=sweep,
            rise=self._rises(at),
            free=free,
        )

    def _rises(self, at: IndexArray) -> FloatArray:
        """Return the rise (m,) of each arc: the first behind an ARCSLP; the last of these waits."""
        found = np.full(len(at), np.nan)
        rises, self._rise = {-1: self._rise, **self._slopes}, NAN
        for line, rise in rises.items():
            row = int(np.searchsorted(at, line))
            if row < len(at):
                found[row] = rise
            else:
                self._rise = rise
        return found

    def _by_dialect(
        self,
        eighth: FloatArray,
        turns: IntArray,
        sign: FloatArray,
        free: BoolArray,
        sweep: FloatArray,
    ) -> None:
        """Fill in what records leave to the dialect: sense, and the meaning of their ``eighth``."""
        eleven = ~np.isnan(eighth)
        meaning = self._dialect.eighth_field
        clockwise = np.full(len(sign), self._dialect.arc_sense is ArcSense.CLOCKWISE)
        if meaning is not EighthField.TOLERANCE:
            clockwise |= eleven
        unsaid = np.isnan(sign)
        sign[unsaid] = np.where(clockwise[unsaid], -1.0, 1.0)
        if self._dialect.arc_sense is ArcSense.OPEN:
            free[unsaid & ~eleven] = True
        if meaning is EighthField.TOLERANCE:
            return
        swept = eleven & (turns == 0)
        if meaning is EighthField.EITHER:
            swept &= eighth > _TOLERANCE
        sweep[swept] = np.radians(eighth[swept])

    def _carry_arc(self, motions: Motions) -> None:
        """Prepend the arc that waits from the block before; keep one that waits for the next."""
        arcs = motions.arcs
        if self._pending is not None:
            first = replace(self._pending, tag=np.zeros_like(self._pending.tag))
            arcs = ArcRecords.concat([first, arcs])
        double = np.flatnonzero(np.diff(arcs.tag) == 0)
        if len(double):
            text = "two arcs without a GOTO between them"
            raise self.faults.error("APT035", text, int(arcs.line[double[0] + 1]))
        waits = arcs.tag == len(motions.lines)
        self._pending = arcs.rows(np.flatnonzero(waits)) if waits.any() else None
        motions.arcs = arcs.rows(np.flatnonzero(~waits))


def _last_before(
    lines: IndexArray, words: IndexArray | list[int], carried: bool = False
) -> IndexArray:
    """Return the line (k + 1,) of the last word before each point, -1 earlier, ``_NEVER`` none."""
    last = np.full(len(lines) + 1, _NEVER, dtype=np.int64)
    if carried:
        last[0] = -1
    at = np.array(words, dtype=np.int64)
    last[np.searchsorted(lines, at)] = at
    return last
