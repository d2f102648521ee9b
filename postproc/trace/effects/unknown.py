"""What no effect of the library does, as a hypothesis of its own: it follows place or time.

Without it a lag that fits badly would still be the best there is. What repeats wherever a joint
comes by one angle, or wherever the tool comes by one place, or what creeps with time, is none of
the dynamic causes; each of them has to say more than that.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy.interpolate import BSpline

from postproc.arrays import FloatArray
from postproc.trace.effect import JOINTS, LINK, TOOL, WHOLE, Part, PathEffect, register
from postproc.trace.scene import Piece, Scene, Stage
from postproc.trace.signals import memory

CURVES = (0, 1, 4, 12, 36)
"""Pieces of the curve over a joint's angle; 1: straight, as a scale is; 0: none."""
CREEPS = 4
"""Pieces of the curve over the time since the begin of a run."""


@register
class Unknown(PathEffect):
    """theta: per output the pieces of its curve, whether place, whether time; then heights.

    Heights per output: place (9: all products of two coordinates and themselves), time, curves
    over the joint's angle (over all joints' where outputs are coordinates).
    """

    name = "unknown"
    title = "what follows place or time, and no effect of the library"
    action = "look for what the joint, the place or the time has in common"
    stages = (JOINTS, LINK, TOOL, WHOLE)
    keys = ()
    is_cause = False

    def start(self, stage: Stage, rest: FloatArray, sigma: FloatArray) -> FloatArray | None:
        """Find for each output what pays for itself."""
        del sigma
        heads = [self._best(stage, output, row) for output, row in enumerate(rest)]
        if not any(any(head) for head in heads):
            return None
        count = sum(_columns(stage, k, head).shape[1] for k, head in enumerate(heads))
        return np.concatenate([np.ravel(heads), np.zeros(count)]).astype(np.float64)

    @staticmethod
    def _best(stage: Stage, output: int, row: FloatArray) -> tuple[int, int, int]:
        good = stage.scene.known & np.isfinite(row)
        worth = memory(np.where(good, row, np.nan), stage.scene.stretches)
        y = row[good] - row[good].mean()
        count = max(2.0, len(y) / worth)
        best, found = count * np.log(max(float(y @ y), 1e-30)), (0, 0, 0)
        for curve in CURVES:
            for place, time in ((0, 0), (1, 0), (0, 1), (1, 1)):
                head = (curve, place, time)
                if not any(head):
                    continue
                X = _columns(stage, output, head)[good]
                # heights use up independent rows: with as many of both anything is explained
                spare = 1.0 - X.shape[1] / count
                if spare <= 0.0:
                    continue
                X = X - X.mean(axis=0)
                gram = X.T @ X
                gram[np.diag_indices_from(gram)] *= 1.0 + 1e-9
                gram[np.diag_indices_from(gram)] += 1e-30
                fit = np.linalg.solve(gram, X.T @ y)
                left = max(float(np.sum((y - X @ fit) ** 2)), 1e-30)
                cost = count * np.log(left / spare) + X.shape[1] * np.log(count)
                if cost < best:
                    best, found = cost, head
        return found

    def part(self, stage: Stage, theta: FloatArray, tangent: bool = True) -> Part:
        """Return the curves."""
        del tangent
        m = len(stage.gap)
        value = np.zeros_like(stage.gap)
        pieces: list[Piece] = []
        at = 3 * m
        for output, head in enumerate(theta[: 3 * m].reshape(m, 3).astype(int).tolist()):
            if not any(head):
                continue
            columns = _columns(stage, output, tuple(head))
            index = tuple(range(at, at + columns.shape[1]))
            at += columns.shape[1]
            value[output] = columns @ theta[list(index)]
            pieces.append(Piece(output, index, columns))
        return Part(value, pieces)


def _columns(stage: Stage, output: int, head: tuple[int, ...]) -> FloatArray:
    """Return what the heights of one output multiply (n, k)."""
    curve, place, time = head
    scene = stage.scene
    parts = [np.zeros((len(scene.time), 0))]
    if place:
        parts.append(scene.kept(("place",), partial(_place, scene)))
    if time:
        parts.append(scene.kept(("creep",), partial(_creep, scene)))
    if curve:
        for joint in [output] if stage.in_joints else range(3):
            key = ("curve", joint, curve)
            parts.append(scene.kept(key, partial(_curve, scene.reference[:, joint], curve)))
    return np.concatenate(parts, axis=1)


def _place(scene: Scene) -> FloatArray:
    far = scene.points - scene.points.mean(axis=0)
    x, y, z = (far / max(float(np.abs(far).max()), 1e-9)).T
    return np.stack([x, y, z, x * x, y * y, z * z, x * y, y * z, z * x], axis=1)


def _creep(scene: Scene) -> FloatArray:
    """Return curves over the time since the begin of each run, and over all rows."""
    since = np.empty(len(scene.time))
    run = scene.recording.run
    for number in np.unique(run):
        mine = run == number
        since[mine] = scene.time[mine] - scene.time[mine][0]
    whole = np.linspace(-1.0, 1.0, len(since))[:, None]
    return np.concatenate([_curve(since, CREEPS), whole], axis=1)


def _curve(values: FloatArray, pieces: int) -> FloatArray:
    """Return cubic splines of (n,) in pieces, less one that makes a constant; of one, a line."""
    low, high = float(values.min()), float(values.max())
    share = (values - low) / max(high - low, 1e-9)
    if pieces == 1:
        return share[:, None] - 0.5
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, pieces + 1), np.ones(3)])
    dense = BSpline.design_matrix(np.clip(share, 0.0, 1.0), knots, 3).toarray()
    return np.asarray(dense[:, 1:])
