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
    """The reference, one time shift of all joints later."""

    name = "controller_delay"
    title = "all joints follow the command by one delay"
    action = "shift the command in time where a process must meet the tool; a path is not changed"
    stages = (JOINTS, WHOLE)
    rivals = ("servo_lag", "clock_offset")
    keys = ("delay_ms",)
    usual: ClassVar[float] = 0.03
    most: ClassVar[float] = LONGEST

    def start(self, stage: Stage, rest: FloatArray, sigma: FloatArray) -> FloatArray | None:
        """Begin without a delay, where a joint moves."""
        del rest, sigma
        return np.zeros(1) if moving(stage, SLOW).any() else None

    def part(self, stage: Stage, theta: FloatArray, tangent: bool = True) -> Part:
        """Move every joint to where its reference was."""
        del tangent
        value, rate = delayed(stage, float(theta[0]))
        pieces = [Piece(output, (0,), row[:, None]) for output, row in enumerate(rate)]
        return Part(value, pieces)

    def widths(self, theta: FloatArray) -> FloatArray:
        """Return some cycles of a controller."""
        return np.full(len(theta), self.usual)

    def table(self, stage: Stage, theta: FloatArray, deviation: FloatArray) -> dict[str, Any]:
        """Return the delay."""
        del stage, deviation
        return {self.keys[0]: float(np.round(theta[0] / MS, 4))}

    def read(self, model: ModelFile, table: Mapping[str, Any]) -> FloatArray | None:
        """Return the delay of a file."""
        del table
        value = model.values(self.name, self.keys[0], within=(-self.most, self.most))
        return None if value is None else np.atleast_1d(value)
