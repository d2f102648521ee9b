"""Lost motion in the gears: the joint rests on the flank that it came from."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Arm, Samples
from postproc.gap.effect import Basis, Effect, Setting, State, diagonal, per_joint, register
from postproc.model import ModelFile

_LEADING = "leading_joints"


@register
class Backlash(Effect):
    """Half the gap of each gear against the direction of the joint's last motion.

    The arm stays behind: a joint that came from below rests below its commanded angle. The sign
    is left free, some controllers over-compensate: such joints lead, and are named so. A half gap
    in a file is never negative.
    """

    name = "backlash"
    title = "backlash: the reading depends on the side a joint came from"
    source = "reversal error, half gap times sign of the last motion"
    action = "approach from one side, or enter the reversal error in the controller"
    needs = ("direction",)
    conditions = ("approach",)
    layout = (("half_gap_deg", 6),)
    parameter_list = per_joint(1.5e-4)
    """Six half gaps [rad], positive against the direction of the last motion."""

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Leave each joint behind where its last motion went."""
        del setting
        return Basis(joint=diagonal(-samples.column("direction")))

    def lost_motion(self, theta: FloatArray) -> FloatArray:
        """Return the whole gaps."""
        gap: FloatArray = 2.0 * np.abs(theta)
        return gap

    def is_unusual(self, theta: FloatArray, deviation: FloatArray) -> bool:
        """Return whether more leads than stays behind, as play would leave it."""
        z = theta / deviation
        leads, stays = (np.sum(np.maximum(side * z, 0.0) ** 2) for side in (-1.0, 1.0))
        return bool(leads > stays)

    def ends(self, theta: FloatArray, width: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return both ends of the intervals of the sizes; a gap is not below zero."""
        side = np.where(theta < 0.0, -1.0, 1.0)
        size = np.abs(theta)
        return side * np.maximum(size - width, 0.0), side * (size + width)

    def write(self, state: State, arm: Arm) -> dict[str, Any]:
        """Return the sizes, and the joints that lead instead of staying behind."""
        table = super().write(replace(state, theta=np.abs(state.theta)), arm)
        leading = [int(i) + 1 for i in np.flatnonzero(state.theta < 0.0)]
        return table | ({_LEADING: leading} if leading else {})

    def read(self, model: ModelFile, arm: Arm) -> State:
        """Return half gaps, those of leading joints below zero."""
        table = dict(model.effects[self.name])
        leading = table.pop(_LEADING, [])
        known = {**model.effects, self.name: table}
        state = super().read(replace(model, effects=known), arm)
        joints = [j for j in leading if isinstance(j, int) and 1 <= j <= 6]
        if not isinstance(leading, list) or len(joints) < len(leading):
            model.values(self.name, _LEADING, (0,))
        theta = state.theta.copy()
        theta[[j - 1 for j in joints]] *= -1.0
        return replace(state, theta=theta)
