"""What a joint does after it turned round: lost motion that stays, a friction spike that goes."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.model import ModelFile
from postproc.trace.effect import JOINTS, LINK, TOOL, WHOLE, Part, PathEffect, register, seen
from postproc.trace.phases import DEAD
from postproc.trace.scene import Piece, Scene, Stage
from postproc.trace.signals import last_motion, memory, since_change
from postproc.units import DEG, MS

KINDS = ("decay", "bump")
"""How a spike goes: a decay with a time constant, or half a wave of a length."""
LENGTHS = (0.02, 0.04, 0.08, 0.16)
"""Times [s] of it that are tried, then refined: spikes are 50 to 200 ms long."""
SHORTEST, LONGEST = 0.005, 0.5
SHIFTS = tuple(MS * t for t in (0.0, 8.0, 20.0, 40.0))
"""Delays [s] after the command's turning point that are tried, then refined."""
WAYS = tuple(DEG * w for w in (0.0, 1e-3, 1.6e-3, 2.5e-3, 4e-3, 6.3e-3, 1e-2))
"""How far [rad] the command goes back before the joint sticks: of friction before sliding."""
CLOSE = 5.0 * MS
"""How far a delay is refined at once [s]."""
LATEST = 0.1
"""Longest delay [s]."""
_HALF, _SPIKE, _USED = slice(0, 6), slice(6, 12), slice(12, 24)
_KIND, _LENGTH, _SHIFT, _WAY = 24, 25, 26, 27
_SAME = 1e-9
_STEP, _STEP_SHIFT = 0.05, 2e-3
"""Share of the length, and delay [s], by which slopes are found."""

_Row = tuple[BoolArray, FloatArray, float]
"""Which rows (n,) of an output are known, their values less the mean, independent ones."""


@register
class ReversalError(PathEffect):
    """theta: six half gaps, six spikes, which of the twelve are free, then the course.

    The course: kind, length and delay of the spike, and how far back the joint sticks.
    Positive: the joint stays behind its motion.
    """

    name = "reversal_error"
    title = "joints stay behind after they turn round: play, or friction"
    action = "avoid reversals of the joint in the cut, lower the feed there, or compensate friction"
    stages = (JOINTS, LINK, TOOL, WHOLE)
    keys = ("half_gap_deg", "spike_deg", "spike_course", "spike_s", "delay_ms", "back_deg")

    def start(self, stage: Stage, rest: FloatArray, sigma: FloatArray) -> FloatArray | None:
        """Find course, delay, and which joints show anything, by straight regressions."""
        scene = stage.scene
        turned = [np.isfinite(since_change(scene.time, s)).any() for s in scene.last_motion.T]
        if not any(turned):
            return None
        rows = []
        for row in rest:
            good = np.isfinite(row)
            worth = memory(row, scene.stretches) if stage.in_joints else 1.0
            rows.append((good, row[good] - row[good].mean(), max(2.0, float(good.sum() / worth))))
        tried: list[tuple[float, list[float]]] = []
        for kind in range(len(KINDS)):
            theta = np.zeros(_WAY + 1)
            theta[_KIND], theta[_LENGTH] = kind, LENGTHS[-2]
            # where it begins, then how long it lasts, then again where
            places = list(product(WAYS, SHIFTS if stage.in_joints else SHIFTS[:1]))
            for at, choices in (
                ((_WAY, _SHIFT), places),
                ((_LENGTH,), list(product(LENGTHS))),
                ((_WAY, _SHIFT), places),
            ):
                costs = []
                for choice in choices:
                    theta[list(at)], theta[_USED] = choice, 1.0
                    cost, used = self._regression(stage, theta, rows)
                    theta[_USED] = used
                    costs.append((cost, theta.tolist()))
                tried.append(min(costs))
                theta = np.array(tried[-1][1])
        del sigma
        best = np.array(min(tried)[1])
        return best if best[_USED].any() else None

    @staticmethod
    def _regression(stage: Stage, theta: FloatArray, rows: list[_Row]) -> tuple[float, FloatArray]:
        """Return the cost of a course, and which of the twelve (12,) pay for themselves."""
        cost, used = 0.0, np.zeros(12)
        columns = [_kept(stage.scene, joint, theta) for joint in range(6)]
        turns = [joint for joint in range(6) if columns[joint][:, 1].any()]
        for output, (good, y, count) in enumerate(rows):
            mine = [joint for joint in turns if not stage.in_joints or joint == output]
            whole = float(y @ y)
            options = [(count * np.log(max(whole, 1e-30)), np.zeros(0, dtype=np.int64))]
            if mine:
                index = np.array([k for joint in mine for k in (joint, 6 + joint)])
                if stage.in_joints:
                    X = columns[output][good]
                else:
                    J = stage.scene.jacobian[good, output]
                    X = np.concatenate([columns[k][good] * J[:, k, None] for k in mine], axis=1)
                X = X - X.mean(axis=0)
                gram, right = X.T @ X, X.T @ y
                choices = [[0], [1], [0, 1]] if stage.in_joints else [list(range(len(index)))]
                for choice in choices:
                    part = gram[np.ix_(choice, choice)]
                    fit = np.linalg.lstsq(part, right[choice], rcond=None)[0]
                    left = max(whole - float(fit @ right[choice]), 1e-30)
                    price = len(choice) * np.log(count)
                    options.append((count * np.log(left) + price, index[choice]))
            best = min(options, key=lambda option: option[0])
            cost += best[0]
            used[best[1]] = 1.0
        return cost, used

    def part(self, stage: Stage, theta: FloatArray, tangent: bool = True) -> Part:
        """Leave each joint behind its last motion, more so for a while."""
        scene = stage.scene
        joints = np.zeros_like(scene.reference)
        pieces: list[Piece] = []
        for joint in range(6):
            free = [k for k in (joint, 6 + joint) if theta[12 + k]]
            if not free or (stage.in_joints and joint >= len(stage.gap)):
                continue
            columns = _kept(scene, joint, theta)
            if not columns[:, 1].any():
                continue
            some = columns[:, [k // 6 for k in free]]
            joints[:, joint] = some @ theta[free]
            index = tuple(free)
            if tangent and theta[6 + joint] and theta[18 + joint]:
                for place, step in ((_LENGTH, _STEP * theta[_LENGTH]), (_SHIFT, _STEP_SHIFT)):
                    other = theta.copy()
                    other[place] += step
                    more = _columns(scene, joint, *other[_KIND:])[:, 1] - columns[:, 1]
                    some = np.column_stack([some, more / step * theta[6 + joint]])
                    index = (*index, place)
            if tangent:
                pieces += stage.lift(joint, index, some)
        return Part(stage.lifted(joints), pieces)

    def joined(self, theta: FloatArray, more: FloatArray) -> FloatArray:
        """Return summed heights, and the course of the larger spikes."""
        both = max(theta, more, key=lambda part: float(np.abs(part[_SPIKE]).max())).copy()
        both[:12] = theta[:12] + more[:12]
        both[_USED] = np.maximum(theta[_USED], more[_USED])
        return both

    def lasting(self, theta: FloatArray) -> FloatArray:
        """Return the half gaps without the spikes."""
        stays = theta.copy()
        stays[_SPIKE] = 0.0
        stays[_USED] = stays[:12] != 0.0
        return stays

    def widths(self, theta: FloatArray) -> FloatArray:
        """Return a twentieth of a degree for heights; any course is as likely."""
        widths = np.full(len(theta), np.inf)
        widths[:12] = 0.05 * DEG
        return widths

    def moved(self, theta: FloatArray, step: FloatArray) -> FloatArray:
        """Return new heights, length and delay; the kind and the way were found before."""
        new = theta.copy()
        free = np.flatnonzero(theta[_USED])
        new[free] += step[free]
        near = 0.3 * theta[_LENGTH]
        new[_LENGTH] += np.clip(step[_LENGTH], -near, near)
        new[_LENGTH] = np.clip(new[_LENGTH], SHORTEST, LONGEST)
        shift = theta[_SHIFT] + np.clip(step[_SHIFT], -CLOSE, CLOSE)
        new[_SHIFT] = np.clip(shift, 0.0, LATEST)
        return new

    def count(self, theta: FloatArray) -> int:
        """Return the heights, kind, length, delay and way."""
        return int(np.sum(theta[_USED])) + 4

    def table(self, stage: Stage, theta: FloatArray, deviation: FloatArray) -> dict[str, Any]:
        """Return half gaps, and the largest heights of the spikes."""
        del stage, deviation
        # heights belong together: what is read back is what was fitted
        is_used = theta[_USED] > 0.0
        return {
            "half_gap_deg": seen(theta[_HALF], DEG, is_used[:6]),
            "spike_deg": seen(theta[_SPIKE], DEG, is_used[6:]),
            "spike_course": KINDS[int(theta[_KIND])],
            "spike_s": float(np.round(theta[_LENGTH], 5)),
            "delay_ms": float(np.round(theta[_SHIFT] / MS, 4)),
            "back_deg": float(np.round(theta[_WAY] / DEG, 6)),
        }

    def read(self, model: ModelFile, table: Mapping[str, Any]) -> FloatArray | None:
        """Return the heights of a file."""
        theta = np.zeros(_WAY + 1)
        theta[_HALF] = np.nan_to_num(np.asarray(model.values(self.name, "half_gap_deg", (6,))))
        bounds = {"spike_s": (SHORTEST, LONGEST), "delay_ms": (0.0, LATEST)}
        keys = (("spike_deg", _SPIKE), ("spike_s", _LENGTH), ("delay_ms", _SHIFT))
        theta[_LENGTH] = LENGTHS[-2]
        for key, place in (*keys, ("back_deg", _WAY)):
            shape = (6,) if place is _SPIKE else ()
            value = model.values(self.name, key, shape, True, bounds.get(key, (-np.inf, np.inf)))
            theta[place] = theta[place] if value is None else np.nan_to_num(value)
        theta[_USED] = theta[:12] != 0.0
        theta[_KIND] = model.choice(self.name, "spike_course", KINDS)
        return theta


def _kept(scene: Scene, joint: int, theta: FloatArray) -> FloatArray:
    """Return ``_columns``, kept for the courses that are tried."""
    course = theta[_KIND:].tolist()
    if course[1] not in LENGTHS or course[2] not in SHIFTS:
        return _columns(scene, joint, *course)
    return scene.kept(
        ("after a reversal", joint, *course), partial(_columns, scene, joint, *course)
    )


def _columns(
    scene: Scene, joint: int, kind: float, length: float, shift: float, way: float
) -> FloatArray:
    """Return the columns (n, 2) of one joint: half a gap, and the height of its spike."""
    columns = np.zeros((len(scene.time), 2))
    position = scene.recording.command[:, joint]
    dead = max(DEAD, way)
    signs = scene.kept(
        ("turns", joint, way),
        lambda: np.concatenate([last_motion(position[r], dead, way) for r in scene.stretches]),
    )
    for rows in scene.stretches:
        time = scene.time[rows]
        turned = since_change(time, signs[rows])
        late = np.searchsorted(time, time - shift + _SAME, side="right") - 1
        at = np.maximum(late, 0)
        sign = signs[rows][at]
        columns[rows, 0] = -sign
        since = np.where(late >= 0, turned[at] + time - shift - time[at], np.inf) / length
        if KINDS[int(kind)] == "decay":
            columns[rows, 1] = -sign * np.exp(-since)
        else:
            columns[rows, 1] = -sign * np.sin(np.pi * np.minimum(since, 1.0))
    return columns
