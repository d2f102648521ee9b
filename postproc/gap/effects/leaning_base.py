"""The base leans under what it carries (an alternative, never named)."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Samples, load_moment, weight_moment
from postproc.gap.effect import Basis, Effect, Kind, Parameter, Setting, register

_PARTS = {"upper_arm": (2,), "forearm": (3, 4), "wrist": (5, 6)}
"""Links whose weight leans the base, by the size class or the robot's data."""
_TILTS = 2 * len(_PARTS) + 3


@register
class LeaningBase(Effect):
    """The robot root tilts with the overturning moment of arm and load.

    It turns about a point somewhere below: the height of that point is two more numbers for the
    weight and two for the load. Without it a wrong
    link geometry is named.
    """

    name = "leaning_base"
    title = "behaves like a base or column that leans under the arm"
    source = "rotation of the root in proportion to the moment on it"
    action = "put an indicator on the base plate and move the arm around"
    kind = Kind.ALTERNATIVE
    conditions = ("q1", "load")
    parameter_list = (
        *(Parameter(f"{part}_{axis}", 0.1) for part in _PARTS for axis in "xy"),
        *(Parameter(f"load_{axis}", 0.1) for axis in "xyz"),
        *(Parameter(f"{what}_shift_{axis}", 0.1) for what in ("weight", "load") for axis in "xy"),
    )
    """Tilts relative to joint 2's compliance: under each weight, then under load.

    Where the weight of a link pulls, the size class knows; how heavy it is, it does not."""

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn frame 0 about its axes, and shift it as a turn about a point one metre below."""
        del setting
        zero = np.zeros((len(samples), 3))
        compliance = float(samples.arm.reference.c_joint[1])
        link = np.zeros((len(samples), 7, 6, _TILTS + 4))
        for part, links in enumerate(_PARTS.values()):
            moment = compliance * weight_moment(samples, zero, links)
            for axis in range(2):
                link[:, 0, axis, 2 * part + axis] = moment[:, axis]
            _shift(link, _TILTS, moment)
        if samples.has("wrench"):
            load = compliance * load_moment(samples, zero)
            for axis in range(3):
                link[:, 0, axis, 2 * len(_PARTS) + axis] = load[:, axis]
            _shift(link, _TILTS + 2, load)
        return Basis(link=link)


def _shift(link: FloatArray, column: int, moment: FloatArray) -> None:
    """Add the shift along x and y that a turn by ``moment`` (n, 3) about a lower point gives."""
    link[:, 0, 3, column] += moment[:, 1]
    link[:, 0, 4, column + 1] -= moment[:, 0]
