"""Each joint follows its command by a time of its own: the position loop."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.model import ModelFile
from postproc.trace.delays import SHORT, delayed, lagged, with_slopes
from postproc.trace.effect import JOINTS, WHOLE, Part, PathEffect, moving, register, seen
from postproc.trace.scene import Piece, Stage
from postproc.units import DEG, MS

FAST = 0.05 * DEG
"""A joint that stays slower [rad/s] stands: what is faster is behind, whether its time can be told
or not, and would else be taken for a reversal error."""
TELLS = 1.0 * MS
"""A delay that is less sure [s] is not told."""
LONGEST = 0.2
"""No position loop is slower [s]."""
LOOP = 0.05
"""Time [s] of a position loop of 20 per second, of the slow ones."""
RINGS = 0.5
"""Damping below which a loop would ring after each corner: no drive is tuned so."""
TRIED = SHORT * 2.0 ** np.arange(1, 10)
"""Time constants [s] from which a loop is searched, up to the longest."""


@register
class ServoLag(PathEffect):
    """Dead time and a loop of second order per joint: six delays, six constants [s], six [s^2].

    The delay is that of slow motions, dead time and time constant together; negative: the
    pre-control is too strong, and the joint runs ahead.
    """

    name = "servo_lag"
    title = "each joint runs behind its command by its own time while it moves"
    action = "lower the feed in corners, or tune the pre-control of the drives"
    stages = (JOINTS, WHOLE)
    rivals = ("controller_delay", "clock_offset")
    keys = ("delay_ms", "time_constant_ms", "loop_damping")

    def start(self, stage: Stage, rest: FloatArray, sigma: FloatArray) -> FloatArray | None:
        """Find delay and time constant of each joint by its speed and acceleration."""
        del sigma
        moves = moving(stage, FAST)
        if moves.sum() < 2:
            return None
        theta = np.zeros(18)
        if not stage.in_joints:
            return theta
        scene = stage.scene
        for joint in np.flatnonzero(moves[: len(rest)]).tolist():
            good = scene.known & np.isfinite(rest[joint])
            total, bend = 0.0, 0.0
            acceleration = np.gradient(scene.speed[:, joint], scene.time)
            for _ in range(4):
                value = lagged(stage, joint, (total, 0.0, 0.0))
                rate = self._rate(stage, joint, total)
                X = np.stack([rate, acceleration, np.ones(len(rate))], axis=1)[good]
                step = np.linalg.lstsq(X, (rest[joint] - value)[good], rcond=None)[0]
                total = float(np.clip(total + step[0], -LONGEST, LONGEST))
                bend = float(step[1])
            # to the second order a loop bends by half of first^2 less second, whatever its size
            second = np.clip(0.5 * TRIED**2 - bend, 0.0, (TRIED / (2.0 * RINGS)) ** 2)
            loops = zip(TRIED.tolist(), second.tolist(), strict=True)
            most = max(total + LOOP, SHORT)
            tried = [(total, 0.0, 0.0), *((total, *loop) for loop in loops if loop[0] <= most)]
            left = [np.var((rest[joint] - lagged(stage, joint, t))[good]) for t in tried]
            theta[joint::6] = tried[int(np.argmin(left))]
        return theta

    @staticmethod
    def _rate(stage: Stage, joint: int, total: float) -> FloatArray:
        return np.asarray(delayed(stage, total)[1][joint])

    def part(self, stage: Stage, theta: FloatArray, tangent: bool = True) -> Part:
        """Let each joint follow by its own time."""
        joints = np.zeros_like(stage.scene.reference)
        pieces: list[Piece] = []
        slow = ~moving(stage, FAST)
        for joint in range(6):
            times = (float(theta[joint]), float(theta[6 + joint]), float(theta[12 + joint]))
            if slow[joint] or (stage.in_joints and joint >= len(stage.gap)):
                continue
            if not tangent:
                joints[:, joint] = lagged(stage, joint, times)
                continue
            joints[:, joint], slopes = with_slopes(stage, joint, times)
            free = (joint, 6 + joint, 12 + joint)[: slopes.shape[1]]
            pieces += stage.lift(joint, free, slopes)
        return Part(stage.lifted(joints), pieces)

    def widths(self, theta: FloatArray) -> FloatArray:
        """Return the times of position loops from 20 to 50 per second."""
        return np.repeat([LOOP, LOOP, LOOP**2], len(theta) // 3)

    def moved(self, theta: FloatArray, step: FloatArray) -> FloatArray:
        """Return delays, time constants that are not negative, and loops that do not ring."""
        new = np.clip(theta + step, -LONGEST, LONGEST)
        loop = slice(6, None)
        # a loop that leaps to nothing never comes back
        new[loop] = np.maximum(new[loop], 0.5 * theta[loop])
        new[6:12] = np.minimum(new[6:12], 2.0 * theta[6:12])
        # pre-control takes off what a slow loop is late by, no more
        new[6:12] = np.minimum(new[6:12], np.maximum(new[:6] + LOOP, SHORT))
        new[12:] = np.minimum(new[12:], (new[6:12] / (2.0 * RINGS)) ** 2)
        return np.asarray(new)

    def count(self, theta: FloatArray) -> int:
        """Return how many delays and time constants there are."""
        return int(np.sum(theta != 0.0))

    def table(self, stage: Stage, theta: FloatArray, deviation: FloatArray) -> dict[str, Any]:
        """Return six delays, and the time constants."""
        is_sure = moving(stage, FAST) & (deviation[:6] < TELLS)
        # delay and loop belong together: what is read back is what was fitted
        constants = np.where(theta[6:12] >= SHORT, theta[6:12], 0.0)
        return {
            "delay_ms": seen(theta[:6], MS, is_sure),
            "time_constant_ms": seen(constants, MS),
            "loop_damping": seen(_damping(constants, theta[12:]), 1.0),
        }

    def read(self, model: ModelFile, table: Mapping[str, Any]) -> FloatArray | None:
        """Return the times of a file; None for one in seconds, which is of standing poses."""
        if "delay_ms" not in table:
            return None
        most = {"delay_ms": (-LONGEST, LONGEST), "time_constant_ms": (0.0, LONGEST)}
        theta = np.zeros((3, 6))
        for row, key in enumerate(most):
            known = model.values(self.name, key, (6,), row > 0, most[key])
            theta[row] = 0.0 if known is None else np.nan_to_num(known)
        damping = model.values(self.name, "loop_damping", (6,), True, (RINGS, np.inf))
        if damping is not None:
            theta[2] = np.nan_to_num(theta[1] / (2.0 * damping)) ** 2
        return np.asarray(theta.ravel())


def _damping(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the damping of loops, NaN for one of first order."""
    found = np.full(len(first), np.nan)
    both = (first > 0.0) & (second > 0.0)
    found[both] = first[both] / (2.0 * np.sqrt(second[both]))
    return found
