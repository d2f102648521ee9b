"""Effects along the path, as a trace has shown them, taken off a program.

The program is timed as a controller drives it, the effects act on the course of its joints, and
each point of a cut is shifted by what the real tool misses it where it comes nearest. Where that
leaves too much the feed is lowered. What only makes the tool late moves nothing: the nearest place
stays.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from postproc.arrays import ROUNDING, BoolArray, FloatArray, IntArray
from postproc.cell import Cell
from postproc.compensation.drive import KNOT, Drive, check_size, driven, run_of
from postproc.emitters import motions_of
from postproc.gap import EFFECTS
from postproc.geometry import inverse
from postproc.kinematics import Kinematics
from postproc.model import AlongPath, ModelFile, MoveRole, Plan
from postproc.paths import Paths
from postproc.process import LEAST_SHARE
from postproc.records import dataclass
from postproc.trace import PATH_EFFECTS, PLANNER, REST, known_effects
from postproc.units import DEG, UM

SETTLED = 5.0 * UM
"""A tool that is off the path by no more [m], root mean square, needs no shift; no promise is finer
than that: the corners of blends are not in it."""
LEAST_DOUBT = 0.1
"""No effect is known better than by this share of it: ramps and the form of a corner, which say how
much of it shows, are the controller's own."""
BLOCK = 0.024
"""A controller keeps the speed over motions that last so long [s]: two of its cycles of 12 ms."""
STEEPEST = 1.0
"""A shift may change by this much [m] per metre of a cut. It has to change where a joint turns back
by all that the joint loses; how far the speed drops there is in the run."""
CORNER = 20.0 * DEG
"""From this turn [rad] on a point of a cut is a corner, beyond what shifts bend a line by."""
ROUNDS = 3
"""So often a program is shifted by what its own run misses."""
FEEDS = 5
"""So often the feed is set by what the shifts have left."""
FEED_CHANGE = (0.4, 1.2)
"""A share of the feed is multiplied by no less and no more at once."""


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
        """Return a plan whose cuts are shifted by what the tool would miss them, and slowed.

        What shifts leave beyond what a corner may be passed by, they cannot answer: there the feed
        is lowered, to where the tool is near enough or the process takes no less. Of all that were
        tried the nearest to the path that is nowhere, in the mean and at most, further off it than
        the plan, also where the effects are as uncertain as a diagnosis left something beside them.
        """
        is_cut = np.asarray(plan.role) == MoveRole.CUT
        rest = _rest(file)
        begin, drive = self.run(plan)
        place, point = _places(drive, begin[is_cut])
        missed = drive.missed(place, point)
        check_size(missed, file)
        size = _rms(np.linalg.norm(missed, axis=1))
        doubt = np.clip(rest[0] / max(size, SETTLED), LEAST_DOUBT, 1.0).item()
        plan = replace(plan, shift_along=np.zeros((len(plan), 3)))
        plain = _Level.of(drive, place, point, plan, doubt)
        levels = [plain]
        # blending may take the other half
        bound, least = 0.5 * self.cell.motion.corner_tolerance, self.cell.process.least_feed
        move = np.searchsorted(begin, place, "right") - 1
        # a shift against what comes and goes after a joint turns back would turn it once more
        lasting = {n: PATH_EFFECTS.get(n).lasting(theta) for n, theta in self.effects.items()}
        shifting, share = replace(self, effects=lasting), np.ones(len(plan))
        for _ in range(FEEDS) if plain.rms[0] >= SETTLED else ():
            now = shifting.shifted(_slowed(plan, share, least), is_cut)
            levels.append(_Level.of(self.run(now)[1], place, point, now, doubt))
            off = np.zeros(len(plan))
            np.maximum.at(off, move, levels[-1].off)
            wanted = np.clip(bound / np.maximum(off, SETTLED), *FEED_CHANGE)
            before, share = share, np.clip(share * wanted, LEAST_SHARE, 1.0)
            if (share == before).all():
                break
        good = [level for level in levels if level.is_no_worse(plain, rest[0])]
        best = min(good, key=lambda level: level.fourth)
        off_path = (plain.rms[0], plain.most[0], best.rms[0], best.most[0])
        kept = np.nan_to_num(best.plan.speed / plan.speed, nan=1.0)[is_cut]
        slowed = (int(np.sum(kept < 1.0)), float(kept.min(initial=1.0)))
        # what the diagnosis left was left at the whole feed: of a lower one nobody knows how much
        low = float(np.hypot(min(best.rms), 0.0 if slowed[0] else rest[1]))
        high = float(np.linalg.norm([max(best.rms), rest[2], SETTLED]))
        told = AlongPath(tuple(sorted(self.effects)), *off_path, rest[0], low, high, *slowed)
        return replace(best.plan, along_path=told)

    def shifted(self, plan: Plan, is_cut: BoolArray) -> Plan:
        """Return a plan with its cuts (m,) shifted by what its own run misses."""
        tool = self.cell.tcp_of(plan.tool_of_moves)
        T_robroot_tcp = self.kinematics.fk(plan.q) @ tool
        wanted = T_robroot_tcp[:, :3, 3]
        shift, now = np.zeros_like(wanted), plan
        for number in range(ROUNDS):
            begin, drive = self.run(now)
            missed = drive.missed(begin + 1.0, wanted)
            missed[~is_cut] = 0.0
            # what one round leaves comes of the shifts themselves
            shift = shift - (1.0 if number == 0 else 0.5) * missed
            shift = _gentle(shift, wanted, is_cut)
            now = self._shifted(plan, T_robroot_tcp, tool, shift)
        return now

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
    and larger; fourth: the largest root mean fourth power, squared; off: at each place, as known.
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
        sizes = (1.0 - doubt, 1.0 + doubt)
        runs = [drive, *(replace(drive, real=drive.under(size)) for size in sizes)]
        offs = [np.linalg.norm(run.missed(place, point), axis=1) for run in runs]
        most = tuple(float(off.max(initial=0.0)) for off in offs)
        # fourth powers: a few places far off are worse than many a little
        fourth = max(_rms(off**2) for off in offs)
        return cls(tuple(map(_rms, offs)), most, fourth, offs[0], plan)

    def is_no_worse(self, other: _Level, rest: float) -> bool:
        """Return whether it is no worse, nor by more than ``rest`` if the effects are others."""
        pairs = [*zip(self.rms, other.rms, strict=True), *zip(self.most, other.most, strict=True)]
        known = self.rms[0] <= other.rms[0] and self.most[0] <= other.most[0]
        return known and all(mine <= others + rest for mine, others in pairs)


def _slowed(plan: Plan, share: FloatArray, least: float) -> Plan:
    """Return a plan at shares (m,) of its feeds, in steps that keep a program short."""
    step = np.maximum(np.ceil(share / LEAST_SHARE - ROUNDING) * LEAST_SHARE, min(1.0, least))
    speed, duration = np.asarray(plan.speed) * step, np.asarray(plan.duration) / step
    return replace(plan, speed=speed, duration=duration)


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
    any_size = (0.0, np.inf)
    rms = file.values(REST, "contour_rms_mm", within=any_size)
    low, high = np.asarray(file.values(REST, "contour_rms_ci_mm", (2,), within=any_size))
    return float(np.asarray(rms)), float(low), float(high)


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
