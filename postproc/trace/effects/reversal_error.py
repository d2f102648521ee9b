"""What a joint does after it turned round: lost motion that stays, a friction spike that goes."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.model import ModelFile
from postproc.trace.effect import JOINTS, LINK, TOOL, WHOLE, Part, PathEffect, register, seen
from postproc.trace.scene import Piece, Scene, Stage
from postproc.trace.signals import memory, since_change
from postproc.units import DEG, MS

COURSES = tuple((kind, length) for kind in ("decay", "bump") for length in (0.02, 0.05, 0.1, 0.2))
"""How a spike goes: a decay with this time constant [s], or half a wave of this length; spikes are
50 to 200 ms long."""
SHIFTS = np.array([0.0, 4.0, 8.0, 12.0, 20.0, 30.0, 45.0]) * MS
"""Delays [s] after the command's turning point that are tried."""
TELLS = 0.005 * DEG
"""A half gap that is less sure [rad] is not told."""
_HALF, _SPIKE, _USED = slice(0, 6), slice(6, 12), slice(12, 24)
_COURSE, _SHIFT = 24, 25
_SAME = 1e-9
_USUAL = 1
"""The course by which the delay is found: a decay in 50 ms."""


@register
class ReversalError(PathEffect):
    """theta: six half gaps, six spikes, which of the twelve are free, course and delay.

    Positive: the joint stays behind its motion.
    """

    name = "reversal_error"
    title = "joints stay behind after they turn round: play, or friction"
    action = "avoid reversals of the joint in the cut, lower the feed there, or compensate friction"
    stages = (JOINTS, LINK, TOOL, WHOLE)
    keys = ("half_gap_deg", "spike_deg", "spike_course", "spike_s", "delay_ms")

    def start(self, stage: Stage, rest: FloatArray, sigma: FloatArray) -> FloatArray | None:
        """Find course, delay, and which joints show anything, by straight regressions."""
        scene = stage.scene
        turned = [np.isfinite(since_change(scene.time, s)).any() for s in scene.last_motion.T]
        if not any(turned):
            return None
        best, found = np.inf, None
        stretches = scene.stretches
        worth = [memory(row, stretches) if stage.in_joints else 1.0 for row in rest]
        shift = 0.0
        for tried in ([(s, _USUAL) for s in SHIFTS], [(None, c) for c in range(len(COURSES))]):
            for other, number in tried if stage.in_joints else tried[:1]:
                theta = np.zeros(_SHIFT + 1)
                theta[_USED], theta[_COURSE] = 1.0, number
                theta[_SHIFT] = shift if other is None else other
                cost, used = self._regression(stage, theta, rest, worth)
                theta[_USED] = used
                if cost < best and used.any():
                    best, found = cost, theta
            shift = shift if found is None else float(found[_SHIFT])
        del sigma
        return found

    def _regression(
        self, stage: Stage, theta: FloatArray, rest: FloatArray, worth: list[float]
    ) -> tuple[float, FloatArray]:
        """Return the cost of a course, and which of the twelve (12,) pay for themselves."""
        pieces = self.part(stage, theta).pieces
        cost, used = 0.0, np.zeros(12)
        for output, row in enumerate(rest):
            mine = [p for p in pieces if p.output == output]
            good = np.isfinite(row)
            y = row[good] - row[good].mean()
            count = max(2.0, good.sum() / worth[output])
            options: list[tuple[float, tuple[int, ...]]] = [
                (count * np.log(max(float(y @ y), 1e-30)), ())
            ]
            index = [k for p in mine for k in p.index]
            nothing = np.zeros((len(row), 0))
            X = np.concatenate([nothing, *(p.columns for p in mine)], axis=1)[good]
            choices = [(0,), (1,), (0, 1)] if stage.in_joints else [tuple(range(len(index)))]
            for choice in choices if mine else []:
                part = X[:, list(choice)] - X[:, list(choice)].mean(axis=0)
                fit = np.linalg.lstsq(part, y, rcond=None)[0]
                left = max(float(np.sum((y - part @ fit) ** 2)), 1e-30)
                price = len(choice) * np.log(count)
                options.append((count * np.log(left) + price, tuple(index[k] for k in choice)))
            best = min(options)
            cost += best[0]
            used[list(best[1])] = 1.0
        return cost, used

    def part(self, stage: Stage, theta: FloatArray, tangent: bool = True) -> Part:
        """Leave each joint behind its last motion, more so for a while."""
        del tangent
        scene = stage.scene
        course, shift = int(theta[_COURSE]), float(theta[_SHIFT])
        joints = np.zeros_like(scene.reference)
        pieces: list[Piece] = []
        for joint in range(6):
            free = [k for k in (joint, 6 + joint) if theta[12 + k]]
            if not free or (stage.in_joints and joint >= len(stage.gap)):
                continue
            key = ("after a reversal", joint, course, shift)
            columns = scene.kept(key, partial(_columns, scene, joint, course, shift))
            if not columns[:, 1].any():
                continue
            some = columns[:, [k // 6 for k in free]]
            joints[:, joint] = some @ theta[free]
            pieces += stage.lift(joint, tuple(free), some)
        return Part(stage.lifted(joints), pieces)

    def widths(self, theta: FloatArray) -> FloatArray:
        """Return a twentieth of a degree."""
        return np.full(len(theta), 0.05 * DEG)

    def moved(self, theta: FloatArray, step: FloatArray) -> FloatArray:
        """Return new heights; course and delay were found before."""
        new = theta.copy()
        free = np.flatnonzero(theta[_USED])
        new[free] += step[free]
        return new

    def count(self, theta: FloatArray) -> int:
        """Return the heights, course and delay."""
        return int(np.sum(theta[_USED])) + 2

    def table(self, stage: Stage, theta: FloatArray, deviation: FloatArray) -> dict[str, Any]:
        """Return half gaps, and the largest heights of the spikes."""
        del stage
        kind, length = COURSES[int(theta[_COURSE])]
        unsure = np.where(theta[_USED] > 0.0, deviation[:12], np.inf)
        return {
            "half_gap_deg": seen(theta[_HALF], unsure[:6], TELLS, DEG),
            "spike_deg": seen(theta[_SPIKE], unsure[6:], TELLS, DEG),
            "spike_course": kind,
            "spike_s": length,
            "delay_ms": float(theta[_SHIFT] / MS),
        }

    def read(self, model: ModelFile, table: Mapping[str, Any]) -> FloatArray | None:
        """Return the heights of a file."""
        half = model.values(self.name, "half_gap_deg", (6,))
        spike = model.values(self.name, "spike_deg", (6,), optional=True)
        theta = np.zeros(_SHIFT + 1)
        theta[_HALF] = np.nan_to_num(np.zeros(6) if half is None else half)
        theta[_SPIKE] = np.nan_to_num(np.zeros(6) if spike is None else spike)
        theta[_USED] = theta[:12] != 0.0
        course = (table.get("spike_course", "decay"), table.get("spike_s", 0.05))
        theta[_COURSE] = COURSES.index(course) if course in COURSES else 1
        theta[_SHIFT] = float(table.get("delay_ms", 0.0)) * MS
        return theta


def _columns(scene: Scene, joint: int, course: int, shift: float) -> FloatArray:
    """Return the columns (n, 2) of one joint: half a gap, and the height of its spike."""
    kind, length = COURSES[course]
    columns = np.zeros((len(scene.time), 2))
    for rows in scene.stretches:
        time = scene.time[rows]
        sign = scene.last_motion[rows, joint]
        late = np.searchsorted(time, time - shift + _SAME, side="right") - 1
        sign = np.where(late >= 0, sign[np.maximum(late, 0)], sign[0])
        columns[rows, 0] = -sign
        since = since_change(time, sign) / length
        if kind == "decay":
            columns[rows, 1] = -sign * np.exp(-since)
        else:
            inside = np.minimum(since, 1.0)
            columns[rows, 1] = -sign * np.sin(np.pi * inside)
    return columns
