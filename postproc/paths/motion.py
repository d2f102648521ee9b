"""From executed motions to joint paths: where every axis is, all along the program.

Joint targets are taken as they are; Cartesian PTP targets by S and T as the controller does (S is
the branch, each bit of T the sign of one axis; without them the nearest turn of the branch
where the robot stands). A path motion keeps the branch it starts in, and its joints follow
continuously: at every sampled pose the same branch of the inverse kinematics, the nearest turn.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, numbered, taken
from postproc.cell import Cell
from postproc.controller import Trace
from postproc.errors import Finding, RunKind, Severity, SourceRef
from postproc.geometry import STEP_SWEEP, inverse
from postproc.kinematics import Kinematics
from postproc.paths.curves import Curves, curves_of
from postproc.paths.externals import Externals
from postproc.records import dataclass
from postproc.timing import Samples, resolved
from postproc.units import DEG, TURN

STEP_LENGTH = 0.015
"""Longest piece [m] of a path motion between two sampled poses."""
STEP_ANGLE = 3.0 * DEG
"""Largest turn [rad] of the tool between two sampled poses."""
MAX_SAMPLES = 1_500_000
"""Beyond this the pieces get longer."""
NEAR_ZERO = 2.0 * DEG
"""Within this of 0 a controller may override the turn bit of an axis."""
_CHUNK = 10_000
_LEAP = 20.0 * DEG

_STILL = 1e-5
"""A joint motion shorter than this [rad] goes nowhere: what acted before it, still acts."""


class Poses(NamedTuple):
    """Sampled poses of a run in order of time, k of them.

    row (k,) motion; share (k,) of it, 1 at its end; q (k, 6) [rad]; point (k, 3) TCP [m] and
    axis (k, 3) tool axis, both in the part.
    """

    row: AnyIntArray
    share: FloatArray
    q: FloatArray
    point: FloatArray
    axis: FloatArray


@dataclass(frozen=True, slots=True)
class Paths:
    """Joint paths of a trace of m motions, sampled along the path motions.

    Args:
        trace: what was run; curves: starts, ends, arcs, lengths.
        external: (m, k) external axes at the ends [m or rad].
        q: (m, 6) joints at the end of each motion [rad], NaN where out of reach.
        row, share: (s,) motion and place on it (0, 1] of each sample; q_sample: (s, 6);
            point: (s, 3) TCP and axis: (s, 3) tool axis, both in the part (CAM coordinates).
        end_point, end_axis: (m, 3) the same at the end of every motion.
        findings: what could not be reached.
        shift: what ``point`` and ``end_point`` have on top of the commanded motions, if anything.
    """

    trace: Trace
    curves: Curves
    external: FloatArray
    q: FloatArray
    row: AnyIntArray
    share: FloatArray
    q_sample: FloatArray
    point: FloatArray
    axis: FloatArray
    end_point: FloatArray
    end_axis: FloatArray
    findings: tuple[Finding, ...]
    station: Station
    shift: Shift | None = None

    def __len__(self) -> int:
        """Return the number of motions."""
        return len(self.q)

    @property
    def stands(self) -> BoolArray:
        """(m,) joint motions that go nowhere, as at the head of a sub-program."""
        step = np.full(len(self), np.inf)
        step[1:] = np.abs(np.diff(self.q, axis=0)).max(axis=1)
        return np.asarray(~self.trace.is_cp & (step < _STILL))

    def in_order(self, low: int = 0, high: int | None = None) -> Poses:
        """Return samples of path motions and ends of PTP motions, in order of time.

        Of motions ``low`` to ``high`` - 1.
        """
        own = slice(*np.searchsorted(self.row, [low, len(self) if high is None else high]))
        ptp = low + np.flatnonzero(~self.trace.is_cp[low:high])
        row = np.concatenate([self.row[own], ptp])
        order = np.argsort(row, kind="stable")
        return Poses(
            row[order],
            np.concatenate([self.share[own], np.ones(len(ptp))])[order],
            taken(np.concatenate([self.q_sample[own], self.q[ptp]]), order),
            taken(np.concatenate([self.point[own], self.end_point[ptp]]), order),
            taken(np.concatenate([self.axis[own], self.end_axis[ptp]]), order),
        )

    def points_at(self, row: AnyIntArray, share: FloatArray) -> FloatArray:
        """Return the TCP (n, 3) [m] in the part at ``share`` (n,) of path motions ``row`` (n,)."""
        station = self.station
        T = self.curves.flange(row, share, station.externals, self.external)
        external = self.curves.external_at(row, share, self.external)
        points: FloatArray = station.in_part(T, external, row)[0]
        if self.shift is not None:
            points = points + self.shift.at(row, share)
        return points


@dataclass(frozen=True, slots=True)
class Shift:
    """Shift of the tool along path motions: ``value`` (k, 3) [m], part, at ``place`` (k,).

    A place is twice the number of the motion, plus the share of it.
    """

    place: FloatArray
    value: FloatArray

    def at(self, row: AnyIntArray, share: FloatArray) -> FloatArray:
        """Return the shift (n, 3) [m] at ``share`` (n,) of path motions ``row`` (n,)."""
        where = 2.0 * row + share
        return np.stack([np.interp(where, self.place, v) for v in self.value.T], axis=1)


@dataclass(frozen=True, slots=True)
class Station:
    """Parts, real tools and external axes of a cell.

    ``tool``, ``base`` (m,): index of each motion's tool and base in the cell: those of the numbers
    that the program has selected. The part of a motion is that of its base.
    """

    cell: Cell
    externals: Externals
    tool: AnyIntArray
    base: AnyIntArray

    @classmethod
    def of(cls, trace: Trace, cell: Cell) -> Station:
        """Return the station of a trace; a number that the cell does not have is its first."""
        tools = {tool.number: index for index, tool in enumerate(cell.tools)}
        bases = {base.number: index for index, base in enumerate(cell.bases)}
        rows = [
            (tools.get(setting.tool_number, 0), bases.get(setting.base_number, 0))
            for setting in trace.settings
        ]
        tool, base = np.array(rows or [(0, 0)], dtype=np.int64)[trace.setting].T
        return cls(cell, Externals.of(cell), tool, base)

    def in_part(
        self, T_robroot_flange: FloatArray, external: FloatArray, row: AnyIntArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the real TCP (n, 3) [m] and tool axis (n, 3) in the part, at motions ``row``."""
        T_part_robroot = inverse(self.parts(external, row))
        tools = self.cell.tools
        if len(tools) == 1:
            T = T_part_robroot @ T_robroot_flange @ tools[0].T_flange_tcp
            return T[:, :3, 3].copy(), T[:, :3, :3] @ tools[0].axis
        own = self.tool[row]
        T = T_part_robroot @ T_robroot_flange @ self.cell.tcp_of(own)
        return T[:, :3, 3].copy(), np.einsum("nij,nj->ni", T[:, :3, :3], self.cell.axes_of(own))

    def turned_to_part(
        self, vectors: FloatArray, external: FloatArray, row: AnyIntArray
    ) -> FloatArray:
        """Return vectors (n, 3) of robroot in axes of the part, at motions ``row``."""
        T = self.parts(external, row)
        if T.ndim == 2:
            return np.asarray(vectors @ T[:3, :3])
        return np.asarray(np.einsum("nji,nj->ni", T[:, :3, :3], vectors))

    def parts(self, external: FloatArray, row: AnyIntArray) -> FloatArray:
        """Return T_robroot_part (n, 4, 4), or (4, 4) where it is one for all."""
        bases = self.cell.bases
        T = np.asarray(bases[0].T_robroot_base)
        if len(bases) > 1:
            T = np.array([base.T_robroot_base for base in bases])[self.base[row]]
        return self.externals.shift(external) @ T if self.externals else T


def top_speeds(cell: Cell) -> FloatArray:
    """Return the largest speeds (6 + k,) of the arm's axes and the external ones."""
    return np.append(cell.robot.qd_max, [axis.qd_max for axis in cell.external_axes])


def joint_paths(
    trace: Trace, cell: Cell, kinematics: Kinematics, step_length: float = STEP_LENGTH
) -> Paths:
    """Return the joint paths of a trace in a cell.

    Args:
        trace: executed motions.
        cell: its bases are the parts, its tools the real ones.
        kinematics: of the cell's robot.
        step_length: longest sampled piece [m].
    """
    return _Solver(trace, cell, kinematics, step_length).run()


class _Solver:
    """Works out one trace; motions in columns of length m."""

    def __init__(
        self, trace: Trace, cell: Cell, kinematics: Kinematics, step_length: float
    ) -> None:
        self.trace, self.cell, self.kinematics = trace, cell, kinematics
        self.externals = Externals.of(cell)
        self.station = Station.of(trace, cell)
        self.external = self.externals.values(np.asarray(trace.external))
        self.curves = curves_of(trace, kinematics, self.externals, self.external)
        self.row, self.share = self._samples(step_length)
        self.q = np.full((len(trace), 6), np.nan)
        self.slot = np.zeros(len(trace), dtype=np.int64)
        self.q_sample = np.full((len(self.row), 6), np.nan)
        self.point = np.full((len(self.row), 3), np.nan)
        self.axis = np.full((len(self.row), 3), np.nan)
        self.findings: list[Finding] = []
        # First sample of every motion: those of motion i are first[i]..first[i + 1] - 1.
        self.first = np.searchsorted(self.row, np.arange(len(trace) + 1))

    def run(self) -> Paths:
        """Return the joint paths."""
        waiting = self._joint_targets()
        joint = np.flatnonzero(~self.trace.is_cp)
        # from one joint motion to another, so that memory stays bounded
        parts = joint[np.flatnonzero(np.diff(self.first[joint] // _CHUNK, prepend=0))]
        start, told = 0, 0
        stops = {*waiting.tolist(), len(self.trace)}
        for index in sorted(stops.union(parts.tolist())):
            self._paths(start, index)
            start = index
            if index in stops:
                self._note_unreachable(told, index)
                told = index
                if index < len(self.trace):
                    self._nearest_target(index)
        self._resolve()
        ends = self.curves.T_robroot_flange
        end_point, end_axis = self.station.in_part(ends, self.external, np.arange(len(ends)))
        return Paths(
            self.trace,
            self.curves,
            self.external,
            self.q,
            self.row,
            self.share,
            self.q_sample,
            self.point,
            self.axis,
            end_point,
            end_axis,
            tuple(self.findings),
            self.station,
        )

    def _samples(self, step_length: float) -> tuple[AnyIntArray, FloatArray]:
        moving = np.flatnonzero(self.trace.is_cp)
        way = np.maximum(
            self.curves.length[moving] / step_length, self.curves.angle[moving] / STEP_ANGLE
        )
        way = np.maximum(way, self.curves.sweep[moving] / STEP_SWEEP)
        way = np.maximum(way, self._external_way(step_length)[moving])
        way = np.where(np.isfinite(way), way, 1.0)
        total = float(way.sum())
        if total > MAX_SAMPLES:
            way *= MAX_SAMPLES / total
        pieces = np.maximum(np.ceil(way - 1e-9), 1.0).astype(np.int64)
        which, number = numbered(pieces)
        return moving[which].astype(np.int32), (number + 1.0) / pieces[which]

    def _external_way(self, step_length: float) -> FloatArray:
        """Return how many steps (m,) the external axes make in each motion."""
        step = [step_length if axis.kind == "rail" else STEP_ANGLE for axis in self.externals.axes]
        way = np.abs(np.diff(self.external, axis=0, prepend=self.external[:1])) / np.array(step)
        return np.asarray(way.max(axis=1, initial=0.0))

    def _finding(self, kind: RunKind, motion: int, message: str) -> None:
        source = SourceRef(*self.trace.place(motion))
        self.findings.append(Finding(Severity.ERROR, kind, message, source=source))

    # ---------------------------------------------------------------------------------------- PTP

    def _joint_targets(self) -> AnyIntArray:
        """Fill q of all PTP targets that say their joints; return those that do not."""
        trace = self.trace
        self.q[trace.is_axes] = trace.target[trace.is_axes]
        cartesian = np.flatnonzero(~trace.is_cp & ~trace.is_axes)
        has_turn = (trace.status[cartesian] >= 0) & (trace.turn[cartesian] >= 0)
        rows = cartesian[has_turn]
        if len(rows):
            slots, valid = self.kinematics.ik(self.curves.T_robroot_flange[rows])
            branch = trace.status[rows] & 0b111
            self._by_turn(rows, slots[np.arange(len(rows)), branch], valid)
        return np.asarray(cartesian[~has_turn])

    def _by_turn(self, rows: AnyIntArray, q: FloatArray, valid: BoolArray) -> None:
        """Choose for each axis the value whose sign is that of its bit in T."""
        trace, kinematics = self.trace, self.kinematics
        negative = (trace.turn[rows][:, None] >> np.arange(6)) & 1 == 1
        wrong = (q < 0.0) != negative
        step = np.where(negative, -TURN, TURN)
        moved = np.where(wrong & (np.abs(q) > NEAR_ZERO), q + step, q)
        # An axis that may go round more than once stands at the value nearest to 0 of its sign.
        out = (moved < kinematics.q_min - 1e-9) | (moved > kinematics.q_max + 1e-9)
        self.q[rows] = np.where(out, q, moved)
        for place, row in enumerate(rows.tolist()):
            if not valid[place, int(trace.status[row]) & 0b111]:
                self._unreachable(row, valid[place])
            elif (out[place] & wrong[place]).any():
                axis = int(np.flatnonzero(out[place] & wrong[place])[0]) + 1
                self._finding(
                    RunKind.TURN,
                    row,
                    f"T {trace.turn[row]}: A{axis} has no such value within its limits",
                )

    def _unreachable(self, row: int, valid: BoolArray) -> None:
        others = "in no branch" if not valid.any() else f"with S {self.trace.status[row]}"
        self._finding(RunKind.UNREACHABLE, row, f"the target is out of reach {others}")

    def _nearest_target(self, row: int) -> None:
        """Fill q of a Cartesian PTP target without S and T from where the robot stands."""
        before = self.q[row - 1] if row else np.full(6, np.nan)
        known = bool(np.isfinite(before).all())
        if not known:
            before = self._rest()
            self._finding(
                RunKind.START, row, "the first motion gives neither S and T nor joint angles"
            )
        status = int(self.trace.status[row])
        slots, valid = self.kinematics.ik(self.curves.T_robroot_flange[row])
        slot = status & 0b111 if status >= 0 else int(self.kinematics.slot(before))
        if not valid[0, slot]:
            self._unreachable(row, valid[0])
            return
        self.q[row] = self.kinematics.nearest(
            self.kinematics.split_wrist(slots[0, slot], before), before
        )

    def _rest(self) -> FloatArray:
        home = self.cell.motion.home
        if home is not None:
            return np.asarray(home)
        return np.array([0.0, -90.0, 90.0, 0.0, 30.0, 0.0]) * DEG

    # ---------------------------------------------------------------------------------------- paths

    def _paths(self, start: int, stop: int) -> None:
        """Fill the samples of all path motions in start..stop-1; PTP ends in there are known."""
        low, high = int(self.first[start]), int(self.first[stop])
        if low == high:
            return
        row = self.row[low:high]
        fresh = np.r_[True, row[1:] != row[:-1]]
        is_first = fresh & ((row == 0) | ~self.trace.is_cp[np.maximum(row - 1, 0)])
        run = np.cumsum(is_first) - 1
        heads = np.flatnonzero(is_first)
        q_start = self._run_starts(row[heads])
        slot = self._branches(low + heads, q_start)
        self.slot[row] = slot[run]
        principal = np.full((high - low, 6), np.nan)
        for at in range(0, high - low, _CHUNK):
            part = slice(at, min(at + _CHUNK, high - low))
            inside = slice(low + part.start, low + part.stop)
            principal[part], self.point[inside], self.axis[inside] = self._solve(
                self.row[inside], self.share[inside]
            )
        self.q_sample[low:high] = _continued(principal, run, heads, q_start, self.kinematics)
        ends = np.r_[row[1:] != row[:-1], True]
        self.q[row[ends]] = self.q_sample[low:high][ends]

    def _run_starts(self, rows: AnyIntArray) -> FloatArray:
        """Return the joints (r, 6) in which runs of path motions begin."""
        q = np.where((rows > 0)[:, None], self.q[np.maximum(rows - 1, 0)], np.nan)
        for place in np.flatnonzero(~np.isfinite(q).all(axis=1)).tolist():
            row = int(rows[place])
            if row == 0:
                self._finding(
                    RunKind.START,
                    row,
                    "the first motion is a path motion: the pose of the arm is not known",
                )
            q[place] = self._rest()
        return q

    def _branches(self, heads: AnyIntArray, q_start: FloatArray) -> AnyIntArray:
        """Return the branch (r,) of each run: that of its start, or where it goes on."""
        slot = np.asarray(self.kinematics.slot(q_start)).astype(np.int64)
        T = self._flanges(self.row[heads], self.share[heads])
        slots, valid = self.kinematics.ik(T)
        gap = np.abs((slots - q_start[:, None, :] + np.pi) % TURN - np.pi).max(axis=2)
        gap = np.where(valid, gap, np.inf)
        best = gap.argmin(axis=1)
        rows = np.arange(len(heads))
        # At the border between two branches rounding must not decide.
        return np.where(gap[rows, slot] > gap[rows, best] + _LEAP, best, slot)

    def _flanges(self, row: AnyIntArray, share: FloatArray) -> FloatArray:
        """Return T_robroot_flange (n, 4, 4) at ``share`` (n,) of path motions ``row`` (n,)."""
        return self.curves.flange(row, share, self.externals, self.external)

    def _solve(
        self, row: AnyIntArray, share: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return principal joints (n, 6), TCP and tool axis (n, 3) in the part, at samples."""
        T = self._flanges(row, share)
        slots, valid = self.kinematics.ik(T)
        rows, slot = np.arange(len(T)), self.slot[row]
        external = self.curves.external_at(row, share, self.external)
        point, axis = self.station.in_part(T, external, row)
        return np.where(valid[rows, slot][:, None], slots[rows, slot], np.nan), point, axis

    def _resolve(self) -> None:
        """Put samples between those where an axis races, so that its largest speed is known."""
        begins = self.trace.is_cp.copy()
        begins[:1] = False  # nobody knows where the first motion comes from
        starts, mine = np.flatnonzero(begins), np.flatnonzero(begins[self.row])
        row = np.concatenate([starts, self.row[mine]])
        share = np.concatenate([np.zeros(len(starts)), self.share[mine]])
        q = np.vstack([self.q[starts - 1], self.q_sample[mine]])
        order = np.lexsort((share, row))
        coarse = Samples(row, share, self._places(row, share, q)).of(order)
        row, share, places = resolved(coarse, self._times(), top_speeds(self.cell), self._near)
        count = [np.bincount(rows, minlength=len(self.trace)) for rows in (coarse.row, row)]
        finer = count[0] != count[1]
        old, new = np.flatnonzero(~finer[self.row]), np.flatnonzero(finer[row] & (share > 0.0))
        if not len(new):
            return
        _, point, axis = self._solve(row[new], share[new])
        columns = (
            (self.row, row[new]),
            (self.share, share[new]),
            (self.q_sample, places[new, :6]),
            (self.point, point),
            (self.axis, axis),
        )
        merged = [np.concatenate([before[old], more]) for before, more in columns]
        order = np.lexsort((merged[1], merged[0]))
        self.share, self.q_sample, self.point, self.axis = (m[order] for m in merged[1:])
        self.row = merged[0][order].astype(np.int32)

    def _near(self, row: AnyIntArray, share: FloatArray, near: FloatArray) -> FloatArray:
        """Return where the axes are (n, 6 + k), nearest to ``near``; NaN out of reach."""
        q = self.kinematics.split_wrist(self._solve(row, share)[0], near[:, :6])
        return self._places(row, share, q + TURN * np.rint((near[:, :6] - q) / TURN))

    def _places(self, row: AnyIntArray, share: FloatArray, q: FloatArray) -> FloatArray:
        return np.hstack([q, self.curves.external_at(row, share, self.external)])

    def _times(self) -> FloatArray:
        """Return the time (m,) [s] of path motions at their programmed speed, as a feed asks."""
        speed, turning = (self.trace.column(n) for n in ("speed", "orientation_speed"))
        length = self.curves.length
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(length > 0.0, length / speed, self.curves.angle / turning)

    def _note_unreachable(self, low: int, high: int) -> None:
        own = slice(self.first[low], self.first[high])
        lost = np.unique(self.row[own][~np.isfinite(self.q_sample[own, 0])])
        for motion in lost[:20].tolist():
            more = f" ({len(lost)} such motions)" if len(lost) > 20 else ""
            self._finding(
                RunKind.UNREACHABLE, motion, f"the path leaves the reach of the arm{more}"
            )


def _continued(
    principal: FloatArray,
    run: AnyIntArray,
    heads: AnyIntArray,
    q_start: FloatArray,
    kinematics: Kinematics,
) -> FloatArray:
    """Return principal values (s, 6) shifted by whole turns to be continuous in runs; NaN stay."""
    known = np.isfinite(principal[:, 0])
    rows = np.arange(len(principal))
    last = np.maximum.accumulate(np.where(known, rows, -1))
    before = np.r_[-1, last[:-1]]
    from_start = before < heads[run]
    reference = np.where(
        from_start[:, None], taken(q_start, run), taken(principal, np.maximum(before, 0))
    )
    angles = kinematics.split_wrist(principal, reference)
    wraps = -np.rint((angles - reference) / TURN)
    wraps[~known] = 0.0
    total = np.cumsum(wraps, axis=0)
    offset = total[heads] - wraps[heads]
    return np.asarray(angles + TURN * (total - offset[run]))
