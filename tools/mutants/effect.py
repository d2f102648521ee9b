"""What a text makes the machine do, to tell whether a mutant does harm: by execution, not by rule.

Two texts are the *same* where every motion goes the same way at the same speed, blended alike, with
the same things happening in between. They do the *same work* where every cut does, with spindle,
coolant and all calls alike at each; then the ways through the air differ, and have to be free of
collision at every millimetre.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray
from postproc.cell import Cell
from postproc.collision import Scene
from postproc.controller import Blend, EventWord, MotionType, TraceEvent
from postproc.geometry import angle_between
from postproc.kinematics import build
from postproc.krl import parse_files
from postproc.paths import Paths, durations, joint_paths, run_in_cell
from postproc.process import ALONG_AXIS, on_the_way_out

NEAR = 1.05e-5
"""Points nearer than this [m] are the same: the tolerance of ``verify`` and rounding."""
SAME_AXIS = 1e-4
BENT = 0.25
"""Share of the turn of the tool by which it may be beside the shortest one between two points."""
SPARE = 3e-5
"""How far [m] arcs made of other points may be apart: the path tolerance and the samples."""
_STEP = 1e-3
_REACH = 3.5
_STATES = ("spindle", "coolant")


@dataclass(frozen=True, slots=True)
class Called:
    """A call or a wait before a cut."""

    word: EventWord
    name: str
    value: str


@dataclass(frozen=True, slots=True)
class Work:
    """A cut: points (s, 3) [m] and tool axes (s, 3) in $BASE, speed, and what is on.

    ``tilt`` (s,): how far axes may be apart: by the tilt that the cell allows, and, between the
    ends of a motion, by a share of the turn from one to the other.
    """

    points: FloatArray
    axes: FloatArray
    speed: float
    calls: tuple[object, ...]
    tilt: FloatArray

    @property
    def lasting(self) -> tuple[object, ...]:
        """What stays as it is behind the cut: what is on, tool and base; no calls before it."""
        return tuple(one for one in self.calls if not isinstance(one, Called))

    def is_like(self, other: Work, spare: float = SPARE) -> bool:
        """Return whether another cut is the same, or comes to it on its own line.

        ``spare`` [m]: how far a way made of other points may be off.
        """
        alike = abs(self.speed - other.speed) <= 1e-3 * self.speed and self.calls == other.calls
        if not alike:
            return False
        if self.points.shape != other.points.shape:
            return self._is_led_to_by(other) or self._goes_as(other, spare)
        same = np.abs(self.points - other.points).max(initial=0.0) < NEAR or self._goes_as(
            other, spare
        )
        turned = np.abs(self.axes - other.axes).max(axis=1, initial=0.0)
        return bool(same and (turned < self.tilt).all()) or self._is_led_to_by(other)

    def _goes_as(self, other: Work, spare: float) -> bool:
        """Return whether another cut goes the same way, whatever points it is made of."""
        if min(len(self.points), len(other.points)) < 2:
            return False
        ends = [np.abs(self.points[i] - other.points[i]).max() < NEAR for i in (0, -1)]
        lengths = [
            np.linalg.norm(np.diff(work.points, axis=0), axis=1).sum() for work in (self, other)
        ]
        return bool(
            ends[1]
            and abs(lengths[0] - lengths[1]) < max(spare, 0.01 * lengths[0])
            and max(self._off(other), other._off(self)) < spare
        )

    def _off(self, other: Work) -> float:
        """Return how far points or axes are off the line through the points of another cut."""
        a, b = other.points[:-1], other.points[1:]
        way = b - a
        square = np.maximum(np.einsum("ij,ij->i", way, way), 1e-18)
        worst = 0.0
        for point, axis, tilt in zip(self.points[1:], self.axes[1:], self.tilt[1:], strict=True):
            share = np.clip(np.einsum("ij,ij->i", point - a, way) / square, 0.0, 1.0)
            gap = np.linalg.norm(point - a - share[:, None] * way, axis=1)
            near = int(gap.argmin())
            part = float(share[near])
            turned = np.abs(axis - (1.0 - part) * other.axes[near] - part * other.axes[near + 1])
            worst = max(worst, float(gap[near]), np.inf if turned.max() > tilt else 0.0)
        return worst

    def _is_led_to_by(self, other: Work) -> bool:
        """Return whether another straight cut only begins farther back on the same line."""
        if not len(self.points) or not len(other.points):
            return False
        end, start, back = self.points[-1], self.points[0], other.points[0]
        way = np.linalg.norm(end - back)
        line = (end - back) / max(float(way), 1e-12)
        off = [p - back - ((p - back) @ line) * line for p in (*self.points, *other.points)]
        turned = np.abs(np.vstack([self.axes, other.axes]) - self.axes[-1]).max()
        return bool(
            np.abs(other.points[-1] - end).max() < NEAR
            and np.abs(off).max() < NEAR
            and turned < SAME_AXIS
            and np.linalg.norm(end - start) <= way + NEAR
        )


def joined(works: list[Work]) -> list[Work]:
    """Return cuts that follow each other with the same speed and state as one."""
    found: list[Work] = []
    for work in works:
        last = found[-1] if found else None
        if last is not None and (last.speed, last.lasting) == (work.speed, work.calls):
            points, axes = (
                np.vstack([a, b]) for a, b in ((last.points, work.points), (last.axes, work.axes))
            )
            tilt = np.concatenate([last.tilt, work.tilt])
            found[-1] = replace(last, points=points, axes=axes, tilt=tilt)
        else:
            found.append(work)
    return found


class Effect:
    """An executed text; path motions up to the speed ``feed`` [m/s] cut."""

    def __init__(self, files: Mapping[str, bytes], cell: Cell, feed: float) -> None:
        modules = parse_files(files)
        arm = build(cell.robot)
        trace = run_in_cell(modules, modules[0].name, cell, arm)
        self._paths: Paths = joint_paths(trace, cell, arm)
        self._cell, self._feed = cell, feed

    @cached_property
    def motions(self) -> tuple[FloatArray, ...]:
        """Everything that tells motions apart, in columns."""
        paths, trace = self._paths, self._paths.trace
        blend = np.where(trace.blend == Blend.DISTANCE, trace.column("cdis"), 0.0)
        cptp = np.array([dict(item.system)["$APO.CPTP"] for item in trace.settings] or [0.0])
        share = np.where(trace.blend == Blend.AXES, cptp[trace.setting], 0.0)
        angle = np.where(trace.blend == Blend.OTHER, trace.column("cori"), 0.0)
        numbers = (blend, share, angle, trace.column("load_mass"), trace.column("advance"))
        return (
            np.column_stack([trace.motion_type, trace.blend, *numbers]),
            np.hstack([paths.q, paths.external]),
            np.column_stack([paths.row, paths.share, paths.q_sample]),
            durations(paths, self._cell),
        )

    @cached_property
    def events(self) -> list[tuple[object, ...]]:
        """What happens between motions."""
        return [
            (event.motion, event.word, event.name, repr(event.value), event.arguments)
            for event in self._paths.trace.events
        ]

    @cached_property
    def works(self) -> list[Work]:
        """The cuts in order; the last one is the end of the program."""
        paths, trace = self._paths, self._paths.trace
        speed = trace.column("speed")
        cuts = np.flatnonzero(trace.is_cp & (speed <= self._feed) & (paths.curves.length > NEAR))
        allowed = self._cell.optimize.tilt
        allowed_tilt = SAME_AXIS + 2.0 * max(map(abs, (*allowed.lead, *allowed.side)))
        found, low = [], 0
        on: dict[str, object] = {}
        events = list(trace.events)
        for cut in (*cuts.tolist(), len(trace)):
            calls: list[object] = []
            while low < len(events) and events[low].motion <= cut:
                self._note(events[low], on, calls)
                low += 1
            state = (*sorted(on.items()), *calls)
            if cut == len(trace):
                found.append(Work(np.zeros((0, 3)), np.zeros((0, 3)), 0.0, state, np.zeros(0)))
                break
            tool = int(paths.station.tool[cut])
            share = np.linspace(0.0, 1.0, 9 if trace.motion_type[cut] == MotionType.LIN else 200)
            T = paths.curves.poses(np.full(len(share), cut), share)
            axes = T[:, :3, :3] @ np.asarray(self._cell.tools[tool].axis)
            state = (*state, tool, int(paths.station.base[cut]))
            turn = BENT * float(angle_between(axes[0], axes[-1]))
            tilt = allowed_tilt + np.where((share > 0.0) & (share < 1.0), turn, 0.0)
            found.append(Work(T[:, :3, 3], axes, float(speed[cut]), state, tilt))
        return found

    def _note(self, event: TraceEvent, on: dict[str, object], calls: list[object]) -> None:
        """Note what an event switches, or that it happens."""
        name = event.name.lower()
        family = next((state for state in _STATES if state in name), "")
        if event.word is EventWord.HOOK and family and name.endswith("_off"):
            on.pop(family, None)
        elif event.word is EventWord.HOOK and family:
            on[family] = (name, event.arguments)
        else:
            calls.append(Called(event.word, name, repr(event.value)))

    def is_same(self, other: Effect) -> bool:
        """Return whether another text makes the machine do the very same."""
        return self.events == other.events and self.moves_as(other)

    def moves_as(self, other: Effect) -> bool:
        """Return whether another text makes the same motions, whatever happens in between."""
        return all(
            mine.shape == its.shape and np.allclose(mine, its, rtol=1e-9, atol=1e-9, equal_nan=True)
            for mine, its in zip(self.motions, other.motions, strict=True)
        )

    def is_slower_in_the_air(self, other: Effect) -> bool:
        """Return whether another text goes the same ways, cuts as fast and is elsewhere no faster.

        Blended by no more, and with the same things in between.
        """
        a, b = self._paths, other._paths
        if self.events != other.events or len(a) != len(b) or len(a.q_sample) != len(b.q_sample):
            return False
        speeds = [paths.trace.column("speed") for paths in (a, b)]
        cut = a.trace.is_cp & (speeds[0] <= self._feed)
        kinds, its_kinds = self.motions[0], other.motions[0]
        shares = [np.array([s.ptp for s in p.trace.settings])[p.trace.setting] for p in (a, b)]
        return bool(
            np.array_equal(kinds[:, :2], its_kinds[:, :2])
            and (its_kinds[:, 2:5] <= kinds[:, 2:5]).all()
            and np.array_equal(kinds[:, 5:], its_kinds[:, 5:], equal_nan=True)
            and np.allclose(self.motions[1], other.motions[1], atol=1e-9, equal_nan=True)
            and np.allclose(self.motions[2], other.motions[2], atol=1e-9, equal_nan=True)
            and np.allclose(speeds[0][cut], speeds[1][cut])
            and (speeds[1] <= speeds[0] + 1e-12).all()
            and (shares[1] <= shares[0] + 1e-12).all()
        )

    def does_the_same_work(self, other: Effect, spare: float = SPARE) -> bool:
        """Return whether another text makes the same cuts, ``spare`` [m] off at most."""
        both = ((self.works, other.works), (joined(self.works), joined(other.works)))
        return any(
            len(mine) == len(its)
            and all(a.is_like(b, spare) for a, b in zip(mine, its, strict=True))
            for mine, its in both
        )

    def _touching(self, motion: AnyIntArray, point: FloatArray, axis: FloatArray) -> BoolArray:
        """Return the steps (s,) to samples (s + 1) from the one before on which it may touch."""
        paths, trace = self._paths, self._paths.trace
        cut = trace.is_cp & (trace.column("speed") <= self._feed)
        last = np.maximum.accumulate(np.where(cut, np.arange(len(cut)), -1))
        end, tool = paths.end_point, paths.end_axis
        way = np.diff(end, axis=0, prepend=np.nan)
        leaves = np.einsum("mi,mi->m", way, tool) <= -ALONG_AXIS * np.linalg.norm(way, axis=1)
        # a cut that leaves the part along the tool axis has ended where it began
        from_ = np.where(leaves, np.arange(len(cut)) - 1, np.arange(len(cut)))[last[motion[1:]]]
        out = trace.is_cp[motion[1:]] & (last[motion[1:]] >= 0)
        for at in (slice(None, -1), slice(1, None)):
            out &= on_the_way_out(end[from_], tool[from_], point[at], axis[at])
        return np.asarray(cut[motion[1:]] | out)

    def is_free(self, known: Effect) -> bool:
        """Return whether nothing collides, looked at every millimetre of the arm's way.

        The cutter may touch the part in cuts, and on the straight way out of the last one. Steps
        that a text ``known`` to be free makes as well are not looked at again.
        """
        if not self._cell.solids:
            return True
        arm = build(self._cell.robot)
        seen = {step.tobytes() for step in known.steps}
        scenes = {
            tool: Scene.shared(self._cell.with_tool(tool), arm)
            for tool in np.unique(self._paths.station.tool).tolist()
        }
        for step in self.steps:
            if step.tobytes() in seen or not np.isfinite(step).all():
                continue
            a, b = step[2:].reshape(2, -1)
            way = np.abs(b - a)
            count = int((way[:6].sum() * _REACH + way[6:].sum()) / _STEP) + 2
            dense = a + np.linspace(0.0, 1.0, count)[:, None] * (b - a)
            if scenes[int(step[0])].check(dense, bool(step[1])).hit.any():
                return False
        return True

    @cached_property
    def steps(self) -> FloatArray:
        """The steps (s, 2 + 2 (6 + k)): tool, whether it may touch, joints before and behind."""
        paths = self._paths
        motion, share, q, point, axis = paths.in_order()
        external = paths.curves.external_at(motion, share, paths.external)
        q = np.hstack([q, external])
        touch = self._touching(motion, point, axis)
        return np.column_stack([paths.station.tool[motion[1:]], touch, q[:-1], q[1:]])
