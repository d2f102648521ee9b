"""All axes answer the same time late: the controller's, or of whoever recorded them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from postproc.arrays import FloatArray
from postproc.model import ModelFile
from postproc.trace.contour import LONGEST
from postproc.trace.delays import delayed
from postproc.trace.effect import JOINTS, WHOLE, Part, PathEffect, moving, register
from postproc.trace.scene import Piece, Stage
from postproc.units import DEG, MS

SLOW = 0.5 * DEG
"""A joint that stays slower [rad/s] tells no time."""


@register
class ControllerDelay(PathEffect):
    """The reference, one time shift of all joints later: the shift [s], and a share of 0 to 1.

    The share is of the mean of the places half a cycle before and behind: what a straight line
    between two samples is, and no part of an arm. Whoever shifts a record by no whole cycle, or
    brings two clocks to one, leaves that much in it.
    """

    name = "controller_delay"
    title = "all joints follow the command by one delay"
    action = "shift the command in time where a process must meet the tool; a path is not changed"
    stages = (JOINTS, WHOLE)
    rivals = ("servo_lag", "clock_offset")
    keys = ("delay_ms",)
    usual: ClassVar[float] = 0.03
    most: ClassVar[float] = LONGEST
    has_share: ClassVar[bool] = True

    def start(self, stage: Stage, rest: FloatArray, sigma: FloatArray) -> FloatArray | None:
        """Begin without a delay, where a joint moves."""
        del rest, sigma
        return np.zeros(1 + self.has_share) if moving(stage, SLOW).any() else None

    def part(self, stage: Stage, theta: FloatArray, tangent: bool = True) -> Part:
        """Move every joint to where its reference was."""
        value, rate = delayed(stage, float(theta[0]))
        if not self.has_share:
            return Part(value, [Piece(k, (0,), row[:, None]) for k, row in enumerate(rate)])
        if not tangent and not theta[1]:
            return Part(value, [])
        half = 0.5 * stage.scene.recording.cycle
        around = [delayed(stage, float(theta[0]) + by)[0] for by in (-half, half)]
        between = 0.5 * (around[0] + around[1]) - value
        columns = np.stack([rate, between], axis=2)
        pieces = [Piece(output, (0, 1), column) for output, column in enumerate(columns)]
        return Part(value + theta[1] * between, pieces)

    def widths(self, theta: FloatArray) -> FloatArray:
        """Return some cycles of a controller, and any share."""
        return np.array([self.usual, 1.0])[: len(theta)]

    def moved(self, theta: FloatArray, step: FloatArray) -> FloatArray:
        """Return the delay, and a share that is one."""
        moved = theta + step
        moved[1:] = np.clip(moved[1:], 0.0, 1.0)
        return np.asarray(moved)

    def count(self, theta: FloatArray) -> int:
        """Return how many there are: most records were shifted by nobody."""
        return int(np.sum(theta != 0.0))

    def table(self, stage: Stage, theta: FloatArray, deviation: FloatArray) -> dict[str, Any]:
        """Return the delay."""
        del stage, deviation
        return {self.keys[0]: float(np.round(theta[0] / MS, 4))}

    def read(self, model: ModelFile, table: Mapping[str, Any]) -> FloatArray | None:
        """Return the delay of a file."""
        del table
        value = model.values(self.name, self.keys[0], within=(-self.most, self.most))
        return None if value is None else np.array([float(value), 0.0])[: 1 + self.has_share]
