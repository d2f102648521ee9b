"""What the motors give, against what rigid links, the tool and friction need.

Torque of a joint = rigid body (inverse dynamics where the links' inertias are known, else the pull
of gravity alone) + what its motor turns + viscous and Coulomb friction + a constant. All joints are
one least squares: a weight at the flange pulls at each of them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.arrays import runs as equal_runs
from postproc.cell import Cell, Tool
from postproc.geometry import skew
from postproc.kinematics import Kinematics, dynamics_of
from postproc.records import dataclass
from postproc.trace.evidence import FOLDS, Verdict, folds_of
from postproc.trace.fit import values_of
from postproc.trace.scene import Scene
from postproc.trace.signals import Course, memory
from postproc.units import DEG

if TYPE_CHECKING:
    from postproc.trace.answer import PathDiagnosis

SLIDES = 0.3 * DEG
"""Speed [rad/s] at which a gear's friction is near its sliding value: Coulomb's step is a tanh."""
STICKS = 0.1 * SLIDES
"""A joint that is slower holds any friction up to the sliding one: its rows tell nothing."""
SURE = 3.0
"""A number is told that is so many of its standard deviations."""
LEAST = 1e-6
"""No motor tells its torque closer [N m]."""
PAYS = 0.05
"""Least share of the torque left on other rows by which an unknown weight shrinks it."""
FLAT = 0.995
"""Share of a limit, or of the largest torque, from which a joint stands at it."""
HELD = 3
"""Rows at a limit one after the other that are no chance."""
OWN = ("viscous_Nms_per_rad", "coulomb_Nm", "motor_inertia_kgm2", "constant_Nm")
"""Numbers of each joint."""
WEIGHT = ("mass_kg", "moment_x_kgm", "moment_y_kgm", "moment_z_kgm")
"""Of a weight at the flange beyond the cell's tool; first moments in the axes of the flange."""


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """wanted (n, 6) torque beyond the known; own (n, 6, 4), shared (n, 6, p) columns; good (n, 6).

    share (6,): weight of a row of each joint.
    """

    wanted: FloatArray
    own: FloatArray
    shared: FloatArray
    good: BoolArray
    share: FloatArray

    def solved(self, rows: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Return the numbers of least squares over some rows (n,), and their deviations."""
        k, p = self.own.shape[2], self.shared.shape[2]
        N, g = np.zeros((6 * k + p, 6 * k + p)), np.zeros(6 * k + p)
        for joint in range(6):
            use = self.good[:, joint] & rows
            at = np.r_[joint * k : (joint + 1) * k, 6 * k : 6 * k + p]
            X = np.concatenate([self.own[use, joint], self.shared[use, joint]], axis=1)
            N[np.ix_(at, at)] += self.share[joint] * (X.T @ X)
            g[at] += self.share[joint] * (X.T @ self.wanted[use, joint])
        # no weight pulls with more than all that was measured
        size = np.sqrt(np.mean(np.where(self.good, self.wanted, 0.0) ** 2))
        N.flat[6 * k * (6 * k + p + 1) :: 6 * k + p + 1] += (
            np.mean(self.shared**2, axis=(0, 1)) / max(size, LEAST) ** 2
        )
        scale = 1.0 / np.sqrt(np.maximum(N.diagonal(), 1e-30))
        inverse = (
            scale
            * np.linalg.pinv(N * scale * scale[:, None], 1e-9, hermitian=True)
            * scale[:, None]
        )
        return inverse @ g, np.sqrt(np.maximum(inverse.diagonal(), 0.0))

    def left(self, theta: FloatArray) -> FloatArray:
        """Return the torque (n, 6) that numbers leave."""
        k = self.own.shape[2]
        own = np.einsum("njk,jk->nj", self.own, theta[: 6 * k].reshape(6, k))
        return np.asarray(self.wanted - own - self.shared @ theta[6 * k :])

    def sized(self, scene: Scene) -> _Rows:
        """Return the rows weighed by the noise of each joint and how long it lasts."""
        left = np.where(
            self.good, self.left(self.solved(np.ones(len(self.good), np.bool_))[0]), 0.0
        )
        worth = np.array([memory(row, scene.stretches) for row in left.T])
        level = np.maximum(self.rms(left), LEAST)
        return replace(self, share=1.0 / (worth * level**2))

    def withheld(self, fold: IntArray) -> FloatArray:
        """Return the torque (n, 6) left on rows that were not fitted."""
        left = np.empty_like(self.wanted)
        for number in range(FOLDS):
            out = fold == number
            left[out] = self.left(self.solved(~out)[0])[out]
        return left

    def rms(self, values: FloatArray) -> FloatArray:
        """Return the root mean squares (6,) of (n, 6) over the good rows."""
        squares = np.where(self.good, values, 0.0) ** 2
        return np.asarray(np.sqrt(squares.sum(axis=0) / np.maximum(self.good.sum(axis=0), 1)))


def torques(found: PathDiagnosis) -> dict[str, Any] | None:
    """Return friction, payload and limits as a table, None where no torque was recorded."""
    recorded = bool(found.stages) and found.stages[0].scene.recording.torque is not None
    if not recorded:
        return None
    verdict, cell = found.verdicts[0], found.cell
    scene = verdict.stage.scene
    torque = np.asarray(scene.recording.torque)
    q, qd, qdd = _driven(verdict)
    known, shared = _rigid(cell, scene.kinematics, q, qd, qdd)
    own = np.stack([qd, np.tanh(qd / SLIDES), qdd, np.ones_like(q)], axis=2)
    size, most = np.abs(torque), cell.robot.torque_max
    top = np.nanmax(size, axis=0, initial=0.0)
    held = np.stack([_long(row) for row in (size >= FLAT * top).T], axis=1)
    good = np.isfinite(torque) & scene.known[:, None] & (np.abs(qd) > STICKS)
    rows = _Rows(torque - known, own, shared, good & ~held, np.ones(6)).sized(scene)
    theta, deviation = rows.solved(np.ones(len(q), dtype=np.bool_))
    fold = folds_of(verdict.stage, max(1.0, float(verdict.worth.max())))
    left = rows.rms(rows.withheld(fold))
    # one that stands still stands at its largest torque too: at a limit it gives less than asked
    is_short = np.abs(torque - rows.left(theta)) - size > SURE * left
    held &= is_short if most is None else is_short | (size >= FLAT * most)
    numbers, doubt = (v[: own.shape[2] * 6].reshape(6, -1) for v in (theta, deviation))
    joints = []
    for joint in np.flatnonzero(rows.good.sum(axis=0) > 2 * len(OWN)).tolist():
        pairs = zip(OWN, numbers[joint], doubt[joint], strict=True)
        joints.append(
            {"joint": joint + 1}
            | {name: _told(value, SURE * width) for name, value, width in pairs}
            | {"rms_after_Nm": _told(left[joint]), "saturated_rows": int(held[:, joint].sum())}
        )
    told = {"judged_on": found.withheld_on, "joints": joints}
    if shared.shape[2] > len(WEIGHT):
        return told | {"not_observable": ["payload", "inertia of the links"]}
    bare = replace(rows, shared=shared[:, :, :0])
    more = bare.rms(bare.withheld(fold)) / np.maximum(left, LEAST)
    is_there = np.sum(more**2) * (1.0 - PAYS) ** 2 > 6.0
    weight = dict(zip(WEIGHT, theta[-4:].tolist(), strict=True))
    return told | {"payload": weight if is_there else None}


def _driven(verdict: Verdict) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return angles, speeds, accelerations (n, 6) that the named effects make of the command."""
    scene, stage = verdict.stage.scene, verdict.stage
    q = np.array(scene.recording.command)
    if stage.in_joints:
        thetas = {name: verdict.fitted.thetas[name] for name in verdict.adopted}
        for value in values_of(stage, thetas).values():
            q[:, : len(value)] += value.T
    parts = [(Course(scene.time[r], q[r]).spline, scene.time[r]) for r in scene.stretches]
    rates = [np.concatenate([spline(time, order) for spline, time in parts]) for order in (1, 2)]
    return q, rates[0], rates[1]


def _rigid(
    cell: Cell, kinematics: Kinematics, q: FloatArray, qd: FloatArray, qdd: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the torque (n, 6) of links and tool, and columns (n, 6, p) of what is not known."""

    def of(tool: Tool) -> FloatArray | None:
        arm = dynamics_of(cell.robot, tool)
        return None if arm is None else arm.torques(q, qd, qdd)

    known = of(cell.tool)
    if known is not None:
        places = [np.zeros(3), np.zeros(3), *np.eye(3), *-np.eye(3)]
        tools = [replace(cell.tool, mass=1.0, com=c, inertia=None) for c in places]
        tools[0] = replace(tools[0], mass=0.0)
        nothing, mass, *moved = (np.asarray(of(tool)) for tool in tools)
        # a kilogram on either side turns as hard: the half of the difference is its first moment
        moments = [0.5 * (moved[k] - moved[k + 3]) for k in range(3)]
        return known, np.stack([mass - nothing, *moments], axis=2)
    frames = np.asarray(kinematics.link_frames(q))[:, 1:]
    axes = np.einsum("njab,jb->nja", frames[..., :3, :3], kinematics.chain.axes)
    columns = np.zeros((len(q), 6, 24))
    pull = skew(np.asarray(cell.robot.gravity))
    for link in range(6):
        for joint in range(link + 1):
            lever = frames[:, link, :3, 3] - frames[:, joint, :3, 3]
            arms = np.concatenate([lever[:, :, None], frames[:, link, :3, :3]], axis=2)
            # what holds a weight: axis . (g x lever)
            columns[:, joint, 4 * link : 4 * link + 4] = np.einsum(
                "na,ab,nbk->nk", axes[:, joint], pull, arms
            )
    return np.zeros_like(q), columns


def _long(mask: BoolArray) -> BoolArray:
    """Return which rows (n,) are in runs of at least ``HELD``."""
    found = np.zeros_like(mask)
    for low, high in equal_runs(mask.astype(np.int32)):
        found[low:high] = mask[low] and high - low >= HELD
    return found


def _told(value: float, least: float = 0.0) -> float | None:
    return float(f"{value:.6g}") if abs(value) > least else None
