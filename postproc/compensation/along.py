"""Effects along the path, as a trace has shown them, taken off a program.

The program is timed as a controller drives it, the effects act on the course of its joints, and
each point of a cut is shifted by what the real tool misses it where it comes nearest; again, until
no point comes closer. What only makes the tool late moves nothing: the nearest place stays.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from postproc.arrays import ROUNDING, BoolArray, FloatArray, IntArray
from postproc.cell import Cell
from postproc.compensation.drive import KNOT, Drive, driven, run_of
from postproc.emitters import motions_of
from postproc.gap import EFFECTS
from postproc.geometry import inverse
from postproc.kinematics import Kinematics
from postproc.model import AlongPath, ModelFile, MoveRole, Plan
from postproc.paths import Paths
from postproc.records import dataclass
from postproc.trace import (
    PATH_EFFECTS,
    PLANNER,
    REST,
    known_effects,
)
from postproc.units import DEG, UM

SETTLED = 5.0 * UM
"""A tool that is off the path by no more [m], root mean square, needs no shift."""
BLOCK = 0.024
"""A controller keeps the speed over motions that last so long [s]: two of its cycles of 12 ms."""
STEEPEST = 1.0
"""A shift may change by this much [m] per metre of a cut. It has to change where a joint turns back
by all that the joint loses; how far the speed drops there is in the run."""
LESS, FADE = 6, 10
"""So often shifts are halved where they make something worse, and at so many points around less."""
CORNER = 20.0 * DEG
"""From this turn [rad] on a point of a cut is a corner, beyond what shifts bend a line by."""
ROUNDS = 3
"""So often a program is shifted by what its own run misses."""


def split(file: ModelFile) -> tuple[ModelFile, dict[str, FloatArray]]:
    """Return a model without what is along the path, and the parameters of effects that repeat.

    A name that is known both along the path and at rest is along the path if its table is.
    """
    along = known_effects(file)
    other = {*PLANNER, REST, *(name for name, _ in PATH_EFFECTS if name not in EFFECTS)}
    kept = {n: t for n, t in file.effects.items() if n not in along and n not in other}
    return replace(file, effects=kept), along


@dataclass(frozen=True, slots=True, eq=False)
class Follower:
    """What takes effects along the path off the programs of a cell."""

    cell: Cell
    kinematics: Kinematics
    effects: Mapping[str, FloatArray]

    def run(self, plan: Plan) -> tuple[FloatArray, Drive]:
        """Return where each move of a plan begins in the drive of its program, and the drive."""
        paths, motion = run_of(plan, self.cell, self.kinematics)
        drive = driven(paths, self.cell, self.kinematics, self.effects)
        return motion.astype(np.float64), drive

    def missed(self, plan: Plan) -> Callable[[IntArray, FloatArray], FloatArray]:
        """Return moves (n,) and places on them 0..1 (n,) to the way (n, 3) [m] to the real path."""
        begin, drive = self.run(plan)
        return lambda move, share: drive.missed(np.asarray(begin[move] + share))

    def compensated(self, plan: Plan, file: ModelFile) -> Plan:
        """Return a plan whose cuts are shifted by what the tool would miss them.

        Of all that were tried the nearest to the path that is nowhere, in the mean and at most,
        further off it than the plan, also where the effects are as uncertain as a diagnosis left
        something beside them.
        """
        is_cut = np.asarray(plan.role) == MoveRole.CUT
        tool = self.cell.tcp_of(plan.tool_of_moves)
        T_robroot_tcp = self.kinematics.fk(plan.q) @ tool
        wanted = T_robroot_tcp[:, :3, 3]
        rest = _rest(file)
        begin, drive = self.run(plan)
        place, point = _places(drive, begin[is_cut])
        size = _rms(np.linalg.norm(drive.missed(place, point), axis=1))
        doubt = min(1.0, rest[0] / max(size, SETTLED))
        plan = replace(plan, shift_along=np.zeros_like(wanted))
        plain = _Level.of(drive, place, point, plan, doubt)
        levels, shift = [plain], np.zeros_like(wanted)
        found = [PATH_EFFECTS.get(name).lost(theta) for name, theta in self.effects.items()]
        lost = np.flatnonzero(np.any(found, axis=0)).astype(np.int32)
        for hold in (False, True) if plain.rms[0] >= SETTLED else ():
            shift, run, now = np.zeros_like(wanted), (begin, drive), plan
            for number in range(ROUNDS):
                missed = run[1].missed(run[0] + 1.0, wanted)
                missed[~is_cut] = 0.0
                # what one round leaves comes of the shifts themselves
                shift = shift - (1.0 if number == 0 else 0.5) * missed
                shift = _gentle(shift, wanted, is_cut)
                now = self._shifted(plan, T_robroot_tcp, tool, shift)
                if hold:
                    q = _held(np.asarray(plan.q), np.asarray(now.q), is_cut, lost)
                    shift = (self.kinematics.fk(q) @ tool)[:, :3, 3] - wanted
                    now = self._shifted(plan, T_robroot_tcp, tool, shift)
                run = self.run(now)
                levels.append(_Level.of(run[1], place, point, now, doubt))
        good = [level for level in levels if level.is_no_worse(plain, rest[0])]
        share = np.ones(len(wanted))
        for _ in range(LESS):
            over = place[levels[-1].off > plain.most[0]]
            if len(good) > 1 or len(levels) == 1 or len(over) == 0:
                break
            near = np.unique(np.searchsorted(begin, over, "right") - 1)
            away = np.full(len(wanted), FADE)
            for step in range(1 - FADE, FADE):
                np.minimum.at(away, np.clip(near + step, 0, len(wanted) - 1), abs(step))
            share = share * (0.5 + 0.5 * away / FADE)
            now = self._shifted(plan, T_robroot_tcp, tool, share[:, None] * shift)
            levels.append(_Level.of(self.run(now)[1], place, point, now, doubt))
            good = [level for level in levels if level.is_no_worse(plain, rest[0])]
        best = min(good, key=lambda level: level.fourth)
        off = (plain.rms[0], plain.most[0], best.rms[0], best.most[0])
        ends = (min(best.rms), max(best.rms))
        low, high = (float(np.hypot(k, r)) for k, r in zip(ends, rest[1:], strict=True))
        told = AlongPath(tuple(sorted(self.effects)), *off, rest[0], low, high)
        return replace(best.plan, along_path=told)

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


@dataclass(frozen=True, slots=True, eq=False)
class _Level:
    """How far [m] off its path the tool is in a run of a plan.

    rms, most: root mean square and largest as the effects are known, then where they are smaller
    and larger; fourth: the largest root mean fourth power, squared; off: the
    largest at each place.
    """

    rms: tuple[float, ...]
    most: tuple[float, ...]
    fourth: float
    off: FloatArray
    plan: Plan

    @classmethod
    def of(
        cls, drive: Drive, place: FloatArray, point: FloatArray, plan: Plan, doubt: float
    ) -> _Level:
        sizes = (1.0 - doubt, 1.0 + doubt) if doubt else ()
        runs = [drive, *(replace(drive, real=drive.under(size)) for size in sizes)]
        offs = [np.linalg.norm(run.missed(place, point), axis=1) for run in runs]
        most = tuple(float(off.max(initial=0.0)) for off in offs)
        # fourth powers: a few places far off are worse than many a little
        fourth = max(_rms(off**2) for off in offs)
        return cls(tuple(map(_rms, offs)), most, fourth, np.max(offs, axis=0), plan)

    def is_no_worse(self, other: _Level, rest: float) -> bool:
        """Return whether it is no worse, nor by more than ``rest`` if the effects are others."""
        pairs = [*zip(self.rms, other.rms, strict=True), *zip(self.most, other.most, strict=True)]
        known = self.rms[0] <= other.rms[0] and self.most[0] <= other.most[0]
        return known and all(mine <= others + rest for mine, others in pairs)


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


def _legs(point: FloatArray, is_cut: BoolArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return length (m - 1,) and direction between points (m, 3), and corners (m,) of cuts."""
    span = np.diff(point, axis=0)
    length = np.linalg.norm(span, axis=1)
    way = span / np.maximum(length, 1e-9)[:, None]
    cut = is_cut[1:] & is_cut[:-1] & (length > 0.0)
    turns = cut[1:] & cut[:-1] & (np.sum(way[1:] * way[:-1], axis=1) < np.cos(CORNER))
    corner = np.r_[False, turns, False]
    return np.where(cut & ~corner[1:] & ~corner[:-1], length, np.inf), way, corner


def _held(q: FloatArray, shifted: FloatArray, is_cut: BoolArray, joints: IntArray) -> FloatArray:
    """Return shifted joints (m, 6) [rad] of cuts, some between the places where they turn back.

    A joint that was sent further has to come back before it turns: it turns there, and what it
    loses adds to its shift. Held, it loses no more than it would without a shift.
    """
    found = shifted.copy()
    cut = is_cut[1:] & is_cut[:-1]
    ends = np.flatnonzero(np.diff(np.r_[False, cut, False].astype(np.int8)))
    for joint in joints.tolist():
        step = np.diff(q[:, joint])
        for first, last in ends.reshape(-1, 2).tolist():
            moves = first + np.flatnonzero(np.abs(step[first:last]) > ROUNDING)
            turns = moves[1:][np.sign(step[moves[1:]]) != np.sign(step[moves[:-1]])].tolist()
            if not len(moves):
                continue
            # how far it goes where the cut begins and ends is free
            way = float(np.sign(step[moves[0]]))
            known = [-np.inf * way, *q[turns, joint], np.inf * way * (-1) ** len(turns)]
            edge = [first, *turns, last]
            for k in range(len(turns) + 1):
                own = slice(edge[k], edge[k + 1] + 1)
                low, high = sorted(known[k : k + 2])
                found[own, joint] = np.clip(found[own, joint], low, high)
    return found


def _gentle(shift: FloatArray, point: FloatArray, is_cut: BoolArray) -> FloatArray:
    """Return shifts (m, 3) that change by at most ``STEEPEST`` of the way between corners of cuts.

    Midway between the least such curve above and the largest below. A corner is where both legs,
    shifted each by its own, meet.
    """
    length, way, corner = _legs(point, is_cut)
    step = STEEPEST * length
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
