"""Start, end and curve of every executed motion, in the frames that are in force for it."""

from __future__ import annotations

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, taken
from postproc.controller import MotionType, Trace
from postproc.geometry import (
    Circles,
    around,
    axis_angle,
    circles,
    inverse,
    rotation_about,
    rotation_from_abc,
    spline_points,
    spline_tangents,
    transform,
)
from postproc.kinematics import Kinematics
from postproc.paths.externals import Externals
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Curves:
    """Motions in columns of length m.

    Args:
        trace: the motions.
        T_robroot_flange: (m, 4, 4) flange at the end [m].
        T_start, T_end: (m, 4, 4) TCP in $BASE; NaN start where there is no motion before.
        axis, angle: (m, 3) and (m,) [rad] of the rotation from start to end.
        length: (m,) way of the TCP [m], straight for PTP.
        circle: (m,) row of ``circles``, -1 for none.
        circles: arcs in $BASE.
        tangents: (m, 3) derivative at start and at end of SPL motions.
        bad_circles: motions whose three points are on no circle.
    """

    trace: Trace
    T_robroot_flange: FloatArray
    T_start: FloatArray
    T_end: FloatArray
    axis: FloatArray
    angle: FloatArray
    length: FloatArray
    circle: AnyIntArray
    circles: Circles
    tangents: tuple[FloatArray, FloatArray]
    bad_circles: AnyIntArray

    @property
    def sweep(self) -> FloatArray:
        """(m,) angle that a motion goes round [rad], 0 for all but arcs."""
        return np.append(self.circles.sweep, 0.0)[self.circle]

    def poses(self, row: AnyIntArray, share: FloatArray) -> FloatArray:
        """Return T_base_tcp (n, 4, 4) at ``share`` (n,) of path motions ``row`` (n,)."""
        T = self.T_end[row]
        inner = np.flatnonzero(share < 1.0)
        if not len(inner):
            return T
        i, s = row[inner], share[inner]
        R = self.T_start[i, :3, :3] @ rotation_about(self.axis[i], self.angle[i] * s)
        start, end = self.T_start[i, :3, 3], self.T_end[i, :3, 3]
        p = start + s[:, None] * (end - start)
        number = self.circle[i]
        bent = np.flatnonzero(number >= 0)
        if len(bent):
            c, k = self.circles, number[bent]
            p[bent] = around(start[bent], c.centre[k], c.normal[k], c.sweep[k] * s[bent])
        soft = np.flatnonzero(self.trace.motion_type[i] == MotionType.SPL)
        if len(soft):
            at_start, at_end = self.tangents
            j = i[soft]
            p[soft] = spline_points(start[soft], end[soft], at_start[j], at_end[j], s[soft])
        T[inner] = transform(R, p)
        return T

    def flange(
        self, row: AnyIntArray, share: FloatArray, externals: Externals, external: FloatArray
    ) -> FloatArray:
        """Return T_robroot_flange (n, 4, 4) at ``share`` of path motions ``row``."""
        trace = self.trace
        tools, bases = _rows(trace)
        T_tcp_flange = taken(inverse(trace.tools), tools[row])
        T_robroot_base = taken(trace.bases, bases[row])
        if externals:
            T_robroot_base = (
                externals.shift(self.external_at(row, share, external)) @ T_robroot_base
            )
        T: FloatArray = T_robroot_base @ self.poses(row, share) @ T_tcp_flange
        return T

    def external_at(self, row: AnyIntArray, share: FloatArray, external: FloatArray) -> FloatArray:
        """Return external axes (n, k) at ``share`` of motions, in step with the way."""
        if not external.shape[1]:
            return np.zeros((len(row), 0))
        before = external[np.maximum(row - 1, 0)]
        between: FloatArray = before + share[:, None] * (external[row] - before)
        return between


def curves_of(
    trace: Trace, kinematics: Kinematics, externals: Externals, external: FloatArray
) -> Curves:
    """Return the curves of a trace; ``external`` (m, k) at the ends [m or rad]."""
    tools, bases = _rows(trace)
    T_tcp_flange = inverse(trace.tools) if len(trace.tools) else np.zeros((0, 4, 4))
    T_robroot_base = trace.bases[bases]
    if externals:
        T_robroot_base = externals.shift(external) @ T_robroot_base
    T_end = _targets(trace)
    flange = T_robroot_base @ T_end @ T_tcp_flange[tools]
    joints = np.flatnonzero(trace.is_axes)
    if len(joints):
        flange[joints] = kinematics.fk(trace.target[joints])
        T_base_robroot = inverse(T_robroot_base[joints])
        T_end[joints] = T_base_robroot @ flange[joints] @ trace.tools[tools[joints]]
    _hold_orientation(trace, T_end, flange, T_robroot_base, tools, bases, external, externals)
    T_start = _starts(trace, T_end, flange, tools, bases, external, externals)
    arcs, circle, bad = _arcs(trace, T_start, T_end, flange, T_robroot_base @ T_end)
    axis, angle = np.zeros((len(trace), 3)), np.zeros(len(trace))
    moving = np.flatnonzero(trace.is_cp & np.isfinite(T_start[:, 0, 3]))
    if len(moving):
        axis[moving], angle[moving] = axis_angle(T_start[moving, :3, :3], T_end[moving, :3, :3])
    length = np.linalg.norm(T_end[:, :3, 3] - T_start[:, :3, 3], axis=1)
    bent = circle >= 0
    length[bent] = arcs.radius[circle[bent]] * arcs.sweep[circle[bent]]
    tangents = _tangents(trace, T_start, T_end)
    return Curves(
        trace,
        flange,
        T_start,
        T_end,
        axis,
        angle,
        np.nan_to_num(length, nan=0.0),
        circle,
        arcs,
        tangents,
        bad,
    )


def _rows(trace: Trace) -> tuple[AnyIntArray, AnyIntArray]:
    """Return the rows (m,) of tool and base of every motion."""
    tool = np.array([s.tool for s in trace.settings] or [0], dtype=np.int64)
    base = np.array([s.base for s in trace.settings] or [0], dtype=np.int64)
    return tool[trace.setting], base[trace.setting]


def _targets(trace: Trace) -> FloatArray:
    """Return T_base_tcp (m, 4, 4) of Cartesian targets, the unit transform for joint targets."""
    T = np.tile(np.eye(4), (len(trace), 1, 1))
    rows = np.flatnonzero(~trace.is_axes)
    T[rows, :3, 3] = trace.target[rows, :3]
    T[rows, :3, :3] = rotation_from_abc(trace.target[rows, 3:])
    return T


def _hold_orientation(
    trace: Trace,
    T_end: FloatArray,
    flange: FloatArray,
    T_robroot_base: FloatArray,
    tools: AnyIntArray,
    bases: AnyIntArray,
    external: FloatArray,
    externals: Externals,
) -> None:
    """Let ``$ORI_TYPE=#CONSTANT`` hold the orientation in which a path motion starts."""
    constant = np.array([s.system["$ORI_TYPE"] == "CONSTANT" for s in trace.settings] or [False])
    for row in np.flatnonzero(constant[trace.setting] & trace.is_cp).tolist():
        if row == 0:
            continue
        T_base = trace.bases[bases[row]]
        if externals:
            T_base = externals.shift(external[row - 1 : row])[0] @ T_base
        T_tool = trace.tools[tools[row]]
        T_end[row, :3, :3] = (inverse(T_base) @ flange[row - 1] @ T_tool)[:3, :3]
        flange[row] = T_robroot_base[row] @ T_end[row] @ inverse(T_tool)


def _starts(
    trace: Trace,
    T_end: FloatArray,
    flange: FloatArray,
    tools: AnyIntArray,
    bases: AnyIntArray,
    external: FloatArray,
    externals: Externals,
) -> FloatArray:
    """Return where each motion begins, in its own frames: the end of the motion before."""
    T_start = np.full_like(T_end, np.nan)
    if len(trace) < 2:
        return T_start
    T_start[1:] = T_end[:-1]
    changed = (tools[1:] != tools[:-1]) | (bases[1:] != bases[:-1])
    rows = np.flatnonzero(changed) + 1
    if len(rows):
        T_robroot_base = trace.bases[bases[rows]]
        if externals:
            T_robroot_base = externals.shift(external[rows - 1]) @ T_robroot_base
        T_start[rows] = inverse(T_robroot_base) @ flange[rows - 1] @ trace.tools[tools[rows]]
    return T_start


def _arcs(
    trace: Trace,
    T_start: FloatArray,
    T_end: FloatArray,
    flange: FloatArray,
    T_robroot_tcp: FloatArray,
) -> tuple[Circles, AnyIntArray, AnyIntArray]:
    """Return circles, their rows per motion, and motions without a circle.

    With ``CA`` the motion ends on the circle at that angle, not at the target; ``T_end``,
    ``flange`` and the start of the next motion are moved there.
    """
    rows = np.array(sorted(trace.auxiliary), dtype=np.int64)
    number = np.full(len(trace), -1, dtype=np.int32)
    if not len(rows):
        nothing = np.zeros((0, 3))
        return (
            Circles(nothing, nothing, np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.bool_)),
            number,
            rows.astype(np.int32),
        )
    auxiliary = np.stack([trace.auxiliary[row][:3] for row in rows.tolist()])
    if trace.angle:
        _turn_by_angle(trace, rows, auxiliary, T_start, T_end, flange, T_robroot_tcp)
    found = circles(T_start[rows, :3, 3], auxiliary, T_end[rows, :3, 3])
    good: BoolArray = found.valid & np.isfinite(found.radius)
    for place, row in enumerate(rows.tolist()):
        if row in trace.angle and np.isfinite(T_start[row, 0, 3]):
            _set_arc(found, place, row, trace, auxiliary[place], T_start[row, :3, 3])
            good[place] = found.valid[place]
    number[rows[good]] = np.flatnonzero(good)
    return found, number, rows[~good].astype(np.int32)


def _turn_by_angle(
    trace: Trace,
    rows: AnyIntArray,
    auxiliary: FloatArray,
    T_start: FloatArray,
    T_end: FloatArray,
    flange: FloatArray,
    T_robroot_tcp: FloatArray,
) -> None:
    """Move the ends of arcs with CA onto their circles, one after the other."""
    place_of = {int(row): place for place, row in enumerate(rows)}
    for row in sorted(trace.angle):
        start = T_start[row, :3, 3]
        target = T_end[row, :3, 3].copy()
        arc = circles(start[None], auxiliary[place_of[row]][None], target[None])
        if not arc.valid[0] or not np.isfinite(start).all():
            continue
        angle = np.array([trace.angle[row]])
        T_end[row, :3, 3] = around(start[None], arc.centre, arc.normal, angle)[0]
        T_base_tcp_old = transform(T_end[row, :3, :3], target)
        T_robroot_base = T_robroot_tcp[row] @ inverse(T_base_tcp_old)
        T_tcp_flange = inverse(T_robroot_tcp[row]) @ flange[row]
        flange[row] = T_robroot_base @ T_end[row] @ T_tcp_flange
        if row + 1 < len(T_start):
            T_start[row + 1, :3, 3] = T_end[row, :3, 3]


def _set_arc(
    found: Circles, place: int, row: int, trace: Trace, auxiliary: FloatArray, start: FloatArray
) -> None:
    """Give an arc with CA its angle: start, auxiliary point and target only fix the circle."""
    target = trace.target[row, :3]
    arc = circles(start[None], auxiliary[None], target[None])
    angle = trace.angle[row]
    found.centre[place], found.radius[place] = arc.centre[0], arc.radius[0]
    found.normal[place] = arc.normal[0] * (1.0 if angle > 0.0 else -1.0)
    found.sweep[place] = abs(angle)
    found.valid[place] = bool(arc.valid[0])


def _tangents(
    trace: Trace, T_start: FloatArray, T_end: FloatArray
) -> tuple[FloatArray, FloatArray]:
    if not (trace.motion_type == MotionType.SPL).any():
        nothing = np.zeros((0, 3))
        return nothing, nothing
    same = (trace.block[1:] == trace.block[:-1]) & (trace.block[1:] >= 0)
    start, end = T_start[:, :3, 3], T_end[:, :3, 3]
    start = np.where(np.isfinite(start), start, end)
    return spline_tangents(start, end, np.r_[False, same], np.r_[same, False])
