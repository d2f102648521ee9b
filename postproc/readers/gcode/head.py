"""A rotary head as the cell states it: words A, B, C to the axis of the tool.

No file says about what its rotary words turn, nor which way: ``[import] head`` does, from the
machine to the tool, each letter with the sense and the axis of the CAM coordinates about which a
growing angle turns the tool by the right hand: ``C+z B+y``. ``tip`` behind it: X, Y, Z are of the
tool tip also without G43.4.
"""

from __future__ import annotations

import re

import numpy as np

from postproc.arrays import FloatArray
from postproc.errors import UsageError
from postproc.geometry import AXES, rotation_about
from postproc.records import dataclass
from postproc.units import DEG

UPRIGHT = np.array([0.0, 0.0, 1.0])
"""The tool axis of a machining centre, from the tip to the holder."""
_JOINT = re.compile(r"([ABC])([+-])([xyz])")
_TIP = "tip"


@dataclass(frozen=True, slots=True)
class Head:
    """Letters from the machine to the tool with the axis (3,) that each turns about.

    ``of_tip``: coordinates are those of the tip whether the control is told so or not.
    """

    joints: tuple[tuple[str, tuple[float, ...]], ...]
    of_tip: bool = False

    @property
    def letters(self) -> str:
        """The rotary words that the head has."""
        return "".join(letter for letter, _ in self.joints)

    def axis(self, degrees: dict[str, float]) -> FloatArray:
        """Return the tool axis (3,) from tip to holder; NaN where a joint is not known."""
        axis: FloatArray = UPRIGHT
        for letter, about in reversed(self.joints):
            angle = degrees.get(letter, np.nan) * DEG
            axis = rotation_about(np.array(about), angle) @ axis
        return axis + 0.0


def head_of(text: str | None) -> Head | None:
    """Return the head that a text such as ``C+z B+y`` describes, None without one."""
    if text is None:
        return None
    words = text.replace(",", " ").split()
    of_tip = words[-1:] == [_TIP]
    found = [_JOINT.fullmatch(word) for word in words[: len(words) - of_tip]]
    letters = [match[1] for match in found if match]
    if not found or None in found or len(set(letters)) != len(found):
        text = f"no head {text!r}, expected letters with sense and axis, from the machine to the"
        raise UsageError("GCD018", f"{text} tool: C+z B+y, and tip behind them if so")
    joints = []
    for match in found:
        assert match is not None  # noqa: S101 - looked at above
        joints.append((match[1], tuple(AXES[match[2] + match[3]].tolist())))
    return Head(tuple(joints), of_tip)
