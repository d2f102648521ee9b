"""One stage of the way from the program to the tool: what went in, what came out, and where.

A ``Scene`` is the sampled set-point with everything that effects are functions of; a ``Stage`` is
the difference that is to be explained there, in columns: six joint angles or three coordinates.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from functools import cached_property

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray
from postproc.kinematics import Kinematics
from postproc.records import dataclass
from postproc.trace.phases import DEAD, Phases, phases_of
from postproc.trace.recording import Recording
from postproc.trace.signals import Course, last_motion

SETTLE = 0.25
"""Rows [s] at the begin of a stretch that starts in motion: what was before is not known."""


class Scene:
    """The set-point of a recording and the arm that follows it.

    Args:
        recording: rows; kinematics: of the arm; tool: (3,) TCP in the flange [m].
        reference: (n, 6) angles that the stage starts from [rad]; the command unless told.
    """

    def __init__(
        self,
        recording: Recording,
        kinematics: Kinematics,
        tool: FloatArray,
        reference: FloatArray | None = None,
    ) -> None:
        self.recording = recording
        self.kinematics = kinematics
        self.tool = tool
        self.reference = recording.command if reference is None else reference
        self.stretches = recording.stretches
        self.time = recording.time
        self._kept: dict[tuple[object, ...], FloatArray] = {}

    def rows(self, index: AnyIntArray) -> Scene:
        """Return the scene of some rows (k,), rising."""
        part = self.recording.rows(index)
        return Scene(part, self.kinematics, self.tool, self.reference[index])

    @cached_property
    def courses(self) -> list[Course]:
        """The reference of each stretch as a function of time."""
        return [Course(self.time[rows], self.reference[rows]) for rows in self.stretches]

    @cached_property
    def ways(self) -> list[Course]:
        """The tool point of the reference of each stretch as a function of time."""
        points = carried(self.kinematics, self.reference, self.tool)
        return [Course(self.time[rows], points[rows]) for rows in self.stretches]

    @cached_property
    def commanded(self) -> list[Course]:
        """The tool point of the command of each stretch as a function of time."""
        return [Course(self.time[rows], self.points[rows]) for rows in self.stretches]

    @cached_property
    def single(self) -> list[list[Course]]:
        """The reference of each joint in each stretch."""
        parts = self.stretches
        return [
            [Course(self.time[rows], self.reference[rows, joint, None]) for rows in parts]
            for joint in range(6)
        ]

    @cached_property
    def speed(self) -> FloatArray:
        """(n, 6) of the reference [rad/s]."""
        pairs = zip(self.courses, self.stretches, strict=True)
        return np.concatenate([course.rate(self.time[rows]) for course, rows in pairs])

    @cached_property
    def points(self) -> FloatArray:
        """(n, 3) tool point of the command [m], robroot."""
        return carried(self.kinematics, self.recording.command, self.tool)

    @cached_property
    def jacobian(self) -> FloatArray:
        """(n, 3, 6) of the tool point [m/rad] at the command."""
        return np.asarray(self.kinematics.jacobian(self.recording.command, self.tool)[:, :3, :])

    @cached_property
    def phases(self) -> Phases:
        """What each row is part of."""
        return phases_of(self.recording, self.points, self.stretches)

    @cached_property
    def last_motion(self) -> FloatArray:
        """(n, 6) sign of each joint's last commanded motion."""
        signs = np.zeros_like(self.recording.command)
        for rows in self.stretches:
            for joint in range(6):
                signs[rows, joint] = last_motion(self.recording.command[rows, joint], DEAD)
        return signs

    def kept(self, key: tuple[object, ...], make: Callable[[], FloatArray]) -> FloatArray:
        """Return what ``make`` returns, made once for each key."""
        if key not in self._kept:
            self._kept[key] = make()
        return self._kept[key]

    @cached_property
    def known(self) -> BoolArray:
        """(n,) rows whose past is known: enough of it was recorded, or the arm stood before.

        Where a joint stands within its play before its first motion, nobody knows.
        """
        known = np.ones(len(self.time), dtype=np.bool_)
        top = np.abs(self.speed).max(axis=0).max(initial=1e-9)
        for rows in self.stretches:
            if np.abs(self.speed[rows][0]).max() > 0.01 * top:
                known[rows] = self.time[rows] - self.time[rows.start] > SETTLE
            signs = self.last_motion[rows]
            known[rows] &= ((signs != 0.0) | ~signs.any(axis=0)).all(axis=1)
        return known

    def even(self, rows: slice) -> FloatArray:
        """Return times (m,) at equal steps over a stretch."""
        time = self.time[rows]
        cycle = max(self.recording.cycle, 1e-6)
        return np.asarray(time[0] + cycle * np.arange(int((time[-1] - time[0]) / cycle) + 2))


def carried(kinematics: Kinematics, q: FloatArray, tool: FloatArray) -> FloatArray:
    """Return tool points (n, 3) [m] in robroot of joint angles (n, 6)."""
    T = kinematics.fk(q)
    return np.asarray(T[:, :3, :3] @ tool + T[:, :3, 3])


@dataclass(frozen=True, slots=True)
class Piece:
    """Columns (n, k) by which parameters ``index`` (k,) of an effect act on one output."""

    output: int
    index: tuple[int, ...]
    columns: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """What is to be explained at one stage.

    Args:
        name: ``joints``, ``link``, ``tool`` or ``whole``.
        scene: where.
        gap: (m, n) difference of each output [rad or m]; NaN where not known.
        known: parameters of effects that are taken off the gap already, by name.
    """

    name: str
    scene: Scene
    gap: FloatArray
    known: Mapping[str, FloatArray] = field(default_factory=dict)

    @property
    def in_joints(self) -> bool:
        """Whether an output is a joint, rather than a coordinate of the tool point."""
        return self.name in ("joints", "link")

    def lift(self, joint: int, index: tuple[int, ...], columns: FloatArray) -> list[Piece]:
        """Return what columns (n, k) of one joint's displacement [rad] do to the outputs."""
        if self.in_joints:
            return [Piece(joint, index, columns)]
        J = self.scene.jacobian
        return [Piece(axis, index, J[:, axis, joint, None] * columns) for axis in range(3)]

    def lifted(self, joints: FloatArray) -> FloatArray:
        """Return the outputs (m, n) of joint displacements (n, 6) [rad]."""
        if self.in_joints:
            return np.ascontiguousarray(joints.T[: len(self.gap)])
        return np.asarray(np.einsum("naj,nj->an", self.scene.jacobian, joints))

    def at_tool(self, outputs: FloatArray) -> FloatArray:
        """Return the displacement (n, 3) [m] of the tool point of outputs (m, n)."""
        if not self.in_joints:
            return outputs.T
        J = self.scene.jacobian[:, :, : len(outputs)]
        return np.asarray(np.einsum("naj,jn->na", J, outputs))

    def rows(self, index: AnyIntArray) -> Stage:
        """Return the stage at some rows (k,), rising."""
        return Stage(self.name, self.scene.rows(index), self.gap[:, index], self.known)
