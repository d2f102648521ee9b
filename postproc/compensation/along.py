"""Effects along the path, as a trace has shown them, taken off a program.

The program is timed as a controller drives it, the effects act on the course of its joints, and
each point of a cut is shifted by what the real tool misses it where it comes nearest; again, until
no point comes closer. What only makes the tool late moves nothing: the nearest place stays.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray, forward_filled
from postproc.cell import Cell
from postproc.emitters import EMITTERS, emitter_of, motions_of
from postproc.errors import EmitError, SourceRef
from postproc.gap import EFFECTS
from postproc.geometry import inverse
from postproc.kinematics import Kinematics
from postproc.model import AlongPath, ModelFile, MoveRole, Plan
from postproc.paths import Paths, bends_of, chains, durations
from postproc.records import dataclass
from postproc.timing import RAMP, chain_profile
from postproc.trace import (
    JOINTS,
    PATH_EFFECTS,
    PLANNER,
    REST,
    Recording,
    Scene,
    Stage,
    known_effects,
)
from postproc.units import DEG, MM, UM

CYCLE = 0.004
"""Interpolator cycle [s] in which a run is sampled."""
KNOT = 0.5 * MM
"""Way [m] between two places of a run at which its speed is known."""
BEHIND, AHEAD = 0.1, 0.3
"""The tool is at a place at most so much [s] before or after its command."""
SETTLED = 5.0 * UM
"""A tool that is off the path by no more [m], root mean square, needs no shift."""
BLOCK = 0.024
"""A controller keeps the speed over motions that last so long [s]: two of its cycles of 12 ms."""
STEEPEST = 1.0
"""A shift may change by this much [m] per metre of a cut. It has to change where a joint turns back
by all that the joint loses; how far the speed drops there is in the run."""
CORNER = 20.0 * DEG
"""From this turn [rad] on a point of a cut is a corner, beyond what shifts bend a line by."""
ROUNDS = 4
"""So often the program is run."""
AT_ONCE = 200_000
"""Samples of a run that effects act on together."""
OVERLAP = 5_000
"""Samples before these of which effects remember: 20 s."""


def split(file: ModelFile) -> tuple[ModelFile, dict[str, FloatArray]]:
    """Return a model without what is along the path, and the parameters of effects that repeat.

    A name that is known both along the path and at rest is along the path if its table is.
    """
    along = known_effects(file)
    other = {*PLANNER, REST, *(name for name, _ in PATH_EFFECTS if name not in EFFECTS)}
    kept = {n: t for n, t in file.effects.items() if n not in along and n not in other}
    return replace(file, effects=kept), along


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A run in time, with the tool where effects along the path leave it.

    place (n,): motion and share of it, every ``CYCLE``; commanded, real (n, 3) tool point [m],
    robroot.
    """

    place: FloatArray
    commanded: FloatArray
    real: FloatArray

    def missed(self, place: FloatArray, point: FloatArray | None = None) -> FloatArray:
        """Return the way (k, 3) [m] to the real tool's path from places (k,) of the run.

        Args:
            place: motion and share, rising.
            point: (k, 3) [m] robroot; None: where the command is there.
        """
        at = np.interp(place, self.place, np.arange(len(self.place)))
        if point is None:
            point = np.stack([np.interp(place, self.place, c) for c in self.commanded.T], axis=1)
        middle = np.rint(at).astype(np.int64)
        best, nearest = np.full(len(place), np.inf), middle.copy()
        for step in range(-int(BEHIND / CYCLE), int(AHEAD / CYCLE) + 1):
            row = np.clip(middle + step, 0, len(self.real) - 1)
            square = np.sum((self.real[row] - point) ** 2, axis=1)
            closer = square < best
            best, nearest = np.where(closer, square, best), np.where(closer, row, nearest)
        found = self.real[nearest] - point
        for low in (nearest - 1, nearest):
            start, end = (np.clip(low + k, 0, len(self.real) - 1) for k in (0, 1))
            span = self.real[end] - self.real[start]
            square = np.maximum(np.sum(span**2, axis=1), 1e-18)
            share = np.sum((point - self.real[start]) * span, axis=1) / square
            way = self.real[start] + np.clip(share, 0.0, 1.0)[:, None] * span - point
            shorter = np.sum(way**2, axis=1) < np.sum(found**2, axis=1)
            found = np.where(shorter[:, None], way, found)
        return np.asarray(found)


def driven(
    paths: Paths, cell: Cell, kinematics: Kinematics, effects: Mapping[str, FloatArray]
) -> Drive:
    """Return a run in time under effects along the path."""
    place, time, way, q = _timed(paths, cell)
    even = np.arange(0.0, time[-1] + CYCLE, CYCLE)
    # a controller takes the corners out of its ramps, along the path
    count = max(1, int(0.5 * RAMP / CYCLE))
    far = np.pad(np.interp(even, time, way), (count, count), "edge")
    far = np.convolve(far, np.ones(2 * count + 1) / (2 * count + 1), "valid")
    where = np.interp(far, way, place)
    command = np.stack([np.interp(far, way, column) for column in q.T], axis=1)
    actual = command + _displaced(even, command, cell, kinematics, effects)
    motion = np.clip(np.ceil(where).astype(np.int64) - 1, 0, len(paths) - 1)
    tool = cell.tcp_of(paths.station.tool[motion])[:, :3, 3]
    return Drive(where, *(_carried(kinematics, angles, tool) for angles in (command, actual)))


def _carried(kinematics: Kinematics, q: FloatArray, tool: FloatArray) -> FloatArray:
    T = kinematics.fk(q)
    return np.asarray(np.einsum("nij,nj->ni", T[:, :3, :3], tool) + T[:, :3, 3])


def _displaced(
    time: FloatArray,
    command: FloatArray,
    cell: Cell,
    kinematics: Kinematics,
    effects: Mapping[str, FloatArray],
) -> FloatArray:
    """Return what effects do to the joints (n, 6) [rad] of a course."""
    found = np.zeros_like(command)
    tool = np.asarray(cell.tool.T_flange_tcp[:3, 3])
    for first in range(0, len(time), AT_ONCE):
        rows = slice(max(0, first - OVERLAP), first + AT_ONCE)
        count = len(time[rows])
        one = np.ones(count, dtype=np.int32)
        scene = Scene(Recording("", time[rows], one, one, command[rows]), kinematics, tool)
        stage = Stage(JOINTS, scene, np.zeros((6, count)))
        parts = [PATH_EFFECTS.get(n).part(stage, t, False).value for n, t in effects.items()]
        total = np.sum(parts, axis=0).T if parts else np.zeros((count, 6))
        found[first : first + AT_ONCE] = total[first - rows.start :]
    return found


def _timed(paths: Paths, cell: Cell) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return place, time [s], way [m] and joints (k, 6) at knots of a run.

    The way of joint motions is the angle of their joints [rad].
    """
    row, share, q, *_ = paths.in_order()
    q = forward_filled(q)
    trace, length = paths.trace, paths.curves.length
    before = np.where(np.diff(row, prepend=-1) == 0, np.roll(share, 1), 0.0)
    turned = np.linalg.norm(np.diff(q, axis=0, prepend=q[:1]), axis=1)
    step = np.where(trace.is_cp[row], length[row] * (share - before), turned)
    parts = np.where(trace.is_cp[row], np.ceil(step / KNOT), 1).astype(np.int64).clip(1)
    number = np.repeat(np.arange(len(row)), parts)
    inner = np.arange(len(number)) - np.repeat(np.cumsum(parts) - parts, parts) + 1.0
    inner = inner / parts[number]
    place = (row + before)[number] + (inner * (share - before)[number])
    last = np.concatenate([q[:1], q[:-1]])
    fine = last[number] + inner[:, None] * (q - last)[number]
    way = step[number] / parts[number]
    motion = row[number]
    needed = durations(paths, cell)
    spent = needed[motion] * (inner * (share - before)[number])
    speed, push = trace.column("speed"), trace.column("acceleration")
    corner = np.full(len(paths), np.inf)
    cp = np.flatnonzero(trace.is_cp)
    if len(cp) > 1:
        corner[cp[:-1]] = bends_of(paths, cp).corner_speeds(length[cp], push[cp])
    chain = chains(paths)[motion]
    for first in np.flatnonzero(np.diff(chain, prepend=-1) != 0).tolist():
        own = slice(first, first + int(np.searchsorted(chain[first:], chain[first], "right")))
        if not trace.is_cp[motion[first]] or way[own].sum() <= 0.0:
            continue
        ends = np.r_[motion[own][1:] != motion[own][:-1], True]
        slow = np.where(ends, corner[motion[own]], np.inf)[:-1]
        top = np.maximum(speed[motion[own]], 1e-6)
        knots = np.r_[0.0, np.cumsum(way[own])]
        spent[own] = chain_profile(knots, top, push[motion[own]], RAMP, slow).duration
    return place, np.cumsum(spent), np.cumsum(way), fine


def run_of(plan: Plan, cell: Cell, kinematics: Kinematics) -> tuple[Paths, IntArray]:
    """Return how a plan's program is run, and the motion (m,) of each move.

    Raises:
        EmitError: CMP007 if the emitter does not know, CMP004 if the program is another.
    """
    with EMITTERS.blame(cell.krl.emitter):
        paths = emitter_of(cell).paths(plan, cell, kinematics)
    if paths is None:
        raise EmitError(
            "CMP007",
            f"the emitter {cell.krl.emitter!r} does not know how the joints move between the "
            "points: effects that follow the motion cannot be compensated",
            SourceRef(cell.path),
        )
    motion = motions_of(plan, paths.trace.is_cp, paths.q)
    if motion is None:
        raise EmitError(
            "CMP004", "the program is not that of the plan", SourceRef(plan.toolpath.path)
        )
    return paths, motion


@dataclass(frozen=True, slots=True, eq=False)
class Follower:
    """What takes effects along the path off the programs of a cell."""

    cell: Cell
    kinematics: Kinematics
    effects: Mapping[str, FloatArray]

    def run(self, plan: Plan) -> tuple[FloatArray, Drive]:
        """Return where each move of a plan begins in the drive of its program, and the drive."""
        paths, motion = run_of(plan, self.cell, self.kinematics)
        return motion.astype(np.float64), driven(paths, self.cell, self.kinematics, self.effects)

    def missed(self, plan: Plan) -> Callable[[IntArray, FloatArray], FloatArray]:
        """Return moves (n,) and places on them 0..1 (n,) to the way (n, 3) [m] to the real path."""
        begin, drive = self.run(plan)
        return lambda move, share: drive.missed(np.asarray(begin[move] + share))

    def compensated(self, plan: Plan, file: ModelFile) -> Plan:
        """Return a plan whose cuts are shifted by what the tool would miss them."""
        is_cut = np.asarray(plan.role) == MoveRole.CUT
        tool = self.cell.tcp_of(plan.tool_of_moves)
        T_robroot_tcp = self.kinematics.fk(plan.q) @ tool
        wanted = T_robroot_tcp[:, :3, 3]
        shift, now = np.zeros_like(wanted), plan
        levels: list[tuple[float, float, float, Plan]] = []
        place, point = np.zeros(0), np.zeros((0, 3))
        for number in range(ROUNDS):
            begin, drive = self.run(now)
            if number == 0:
                place, point = _places(drive, begin[is_cut])
            off = np.linalg.norm(drive.missed(place, point), axis=1)
            # fourth powers: a few places far off are worse than many a little
            levels.append((_rms(off**2), _rms(off), float(off.max(initial=0.0)), now))
            if levels[-1][1] < SETTLED:
                break
            missed = drive.missed(begin + 1.0, wanted)
            missed[~is_cut] = 0.0
            # what one round leaves comes of the shifts themselves
            shift = _gentle(shift - (1.0 if number == 0 else 0.5) * missed, wanted, is_cut)
            now = self._shifted(plan, T_robroot_tcp, tool, shift)
        _, plain_rms, plain_most, _ = levels[0]
        better = [level for level in levels if level[1] <= plain_rms]
        _, rms, most, best = min(better, key=lambda level: level[0])
        names = tuple(sorted(self.effects))
        told = AlongPath(names, plain_rms, plain_most, rms, most, *_rest(file))
        return replace(best, along_path=told)

    def _shifted(
        self, plan: Plan, T_robroot_tcp: FloatArray, tool: FloatArray, shift: FloatArray
    ) -> Plan:
        """Return a plan with tool points shifted (m, 3) [m], robroot; where it can reach them."""
        T = np.array(T_robroot_tcp)
        T[:, :3, 3] += shift
        near = np.asarray(plan.q)
        found, valid = self.kinematics.ik_in(T @ inverse(tool), self.kinematics.slot(near))
        found = self.kinematics.split_wrist(self.kinematics.nearest(found, near), near)
        inside = self.kinematics.within_limits(found, self.cell.limits.joint_margin)
        good = valid & inside & (np.linalg.norm(shift, axis=1) > 0.0)
        T_base_robroot = plan.T_base_tcp @ inverse(T_robroot_tcp)
        moved = np.einsum("nij,nj->ni", T_base_robroot[:, :3, :3], shift) * good[:, None]
        T_base_tcp = np.array(plan.T_base_tcp)
        T_base_tcp[:, :3, 3] += moved
        before = np.zeros_like(moved) if plan.compensation is None else plan.compensation
        q = np.where(good[:, None], found, near)
        return replace(
            plan,
            q=q,
            T_base_tcp=T_base_tcp,
            compensation=before + moved,
            shift_along=shift * good[:, None],
        )


def as_planned(plan: Plan) -> Callable[[Paths], FloatArray]:
    """Return what takes the shifts of a plan off its run again, for a check of its text."""
    shift = np.asarray(plan.shift_along)

    def off(paths: Paths) -> FloatArray:
        motion = motions_of(plan, paths.trace.is_cp, paths.q)
        place = np.concatenate([np.arange(1.0, len(paths) + 1.0), paths.row + paths.share])
        if motion is None:
            return np.zeros((len(place), 3))
        return -np.stack([np.interp(place, motion + 1.0, s) for s in shift.T], axis=1)

    return off


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def _rest(file: ModelFile) -> tuple[float, float, float]:
    """Return what a diagnosis has left off the path [m]: root mean square, and its interval."""
    if REST not in file.effects:
        return (0.0, 0.0, float("nan"))
    rms = file.values(REST, "contour_rms_mm")
    ends = file.values(REST, "contour_rms_ci_mm", (2,))
    low, high = (0.0, float("nan")) if ends is None else ends.tolist()
    return float(0.0 if rms is None else rms), low, high


def _places(drive: Drive, begin: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return places (k,) in steps of ``KNOT`` in motions that begin at some, and the command."""
    way = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(drive.commanded, axis=0), axis=1))]
    even = np.interp(np.arange(0.0, way[-1], KNOT), way, drive.place)
    even = even[np.isin(np.ceil(even) - 1.0, begin)]
    point = np.stack([np.interp(even, drive.place, c) for c in drive.commanded.T], axis=1)
    return even, point


def _gentle(shift: FloatArray, point: FloatArray, is_cut: BoolArray) -> FloatArray:
    """Return shifts (m, 3) that change by at most ``STEEPEST`` of the way between corners of cuts.

    Midway between the least such curve above and the largest below. A corner is where both legs,
    shifted each by its own, meet.
    """
    span = np.diff(point, axis=0)
    length = np.linalg.norm(span, axis=1)
    way = span / np.maximum(length, 1e-9)[:, None]
    cut = is_cut[1:] & is_cut[:-1] & (length > 0.0)
    turns = cut[1:] & cut[:-1] & (np.sum(way[1:] * way[:-1], axis=1) < np.cos(CORNER))
    corner = np.r_[False, turns, False]
    step = np.where(cut & ~corner[1:] & ~corner[:-1], STEEPEST * length, np.inf)
    above, below = shift.copy(), shift.copy()
    for k in range(1, len(shift)):
        above[k] = np.maximum(above[k], above[k - 1] - step[k - 1])
        below[k] = np.minimum(below[k], below[k - 1] + step[k - 1])
    for k in range(len(shift) - 2, -1, -1):
        above[k] = np.maximum(above[k], above[k + 1] - step[k])
        below[k] = np.minimum(below[k], below[k + 1] + step[k])
    found = 0.5 * (above + below)
    at = np.flatnonzero(corner)
    across = [np.eye(3) - w[:, :, None] * w[:, None, :] for w in (way[at - 1], way[at])]
    both = np.einsum("nij,nj->ni", across[0], found[at - 1])
    both = both + np.einsum("nij,nj->ni", across[1], found[at + 1])
    met = np.linalg.solve(across[0] + across[1], both[..., None])[..., 0]
    # a sharp corner would meet far away: both legs end there, whatever their shifts
    most = np.maximum(*(np.linalg.norm(found[at + k], axis=1) for k in (-1, 1)))
    size = np.linalg.norm(met, axis=1)
    found[at] = met * np.minimum(1.0, most / np.maximum(size, 1e-12))[:, None]
    return found
