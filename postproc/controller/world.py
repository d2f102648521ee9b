"""What a program finds on the controller it is run for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field

import numpy as np

from postproc.arrays import FloatArray
from postproc.controller.trace import Trace
from postproc.krl import Aggregate, Axes, Pose
from postproc.records import dataclass


@dataclass(slots=True)
class World:
    """What the program finds on the controller.

    Args:
        tools: TOOL_DATA by number; bases: BASE_DATA by number [mm, deg], in $WORLD.
        T_world_robroot: (4, 4) $ROBROOT [m].
        points: named points that are not in the files, such as the home position, and the data of
            its form.
        joints: returns the joints (6,) [rad] at the end of a trace, for joint motions relative to
            a Cartesian target.
        hooks: routines of the integrator, in upper case: their calls are events, and trusted where
            the routine is in none of the files; one that is there is run as any other.
        stopping: those of them whose lines, as the cell says, stop the advance run first.
        accept: names, in upper case, of what cannot be judged and is taken on trust.
    """

    tools: Mapping[int, Pose] = field(default_factory=dict)
    bases: Mapping[int, Pose] = field(default_factory=dict)
    points: Mapping[str, Pose | Axes | Aggregate] = field(default_factory=dict)
    T_world_robroot: FloatArray = field(default_factory=lambda: np.eye(4))
    joints: Callable[[Trace], FloatArray | None] = lambda _trace: None
    hooks: frozenset[str] = frozenset()
    stopping: frozenset[str] = frozenset()
    accept: frozenset[str] = frozenset()
