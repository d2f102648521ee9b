"""The planning problem: one toolpath in one cell, the poses and strokes it asks for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from postproc.arrays import ROUNDING, BoolArray, FloatArray, IndexArray
from postproc.cell import Cell, PathEntry
from postproc.geometry import angle_between, twist_about
from postproc.kinematics import Kinematics, wrist_distance
from postproc.model import CUTS, WORKING, MotionKind, ToolPath
from postproc.planning.states.place import Placement, cross_axes, finer_spins, rounded_spin
from postproc.planning.states.settings import Settings
from postproc.planning.states.tilt import UPRIGHT, cut_into, entered_anew
from postproc.process import (
    back_off,
    in_material,
    in_the_cut,
    least_feeds,
    on_the_way_out,
    out_of_cut,
)
from postproc.records import dataclass
from postproc.stiffness import joint_compliance
from postproc.units import DEG, TURN

Compliance = Callable[[FloatArray], FloatArray]
HELD = "held pose"
"""Column of a toolpath, (n, 15): R_base_tcp by rows of a pose to hold, joints near it [rad]."""
_PRINTED = 2e-5 * DEG
"""Spins are read from a program as closely; nearer to one of those that are planned they are it."""
_PLANNED = 0.001 * DEG


@dataclass(frozen=True)
class Problem:
    """Everything that candidates, checks and routes need; no state of its own.

    ``normal`` (n, 3) unit, robroot: across tool axis and path, per tag. ``c_joint``: joint
    compliance (m, 6) [rad/(N*m)] of configurations (m, 6), None without stiffness.
    ``tilts`` (T, 2): lead and side [rad] to search at tags that may tilt, none at all first.
    """

    toolpath: ToolPath
    cell: Cell
    kinematics: Kinematics
    placement: Placement
    settings: Settings
    normal: FloatArray
    c_joint: Compliance | None
    tilts: FloatArray = field(default_factory=lambda: UPRIGHT)

    def __len__(self) -> int:
        """Return the number of tags."""
        return len(self.toolpath)

    @cached_property
    def is_working(self) -> BoolArray:
        """(n,) tags at which the tool cuts, drills or touches."""
        return np.isin(np.asarray(self.toolpath.kind), WORKING)

    @cached_property
    def is_contact(self) -> BoolArray:
        """(n,) tags where the tool may touch the workpiece: it works, or is on its way out."""
        return self.is_working | (in_the_cut(self.toolpath) & ~self.placement.may_tilt)

    @cached_property
    def fine(self) -> int:
        """How many spins of the finest grid there are to one of the cell's."""
        return self.settings.fine(len(self.tilts))

    @cached_property
    def finest_spins(self) -> FloatArray:
        """(S,) the finest grid of spins [rad]: ``fine`` to each of the cell's, or its only one."""
        wishes, given = self.cell.optimize, self.settings.spins
        return finer_spins(wishes.step, *wishes.range, self.fine) if len(given) > 1 else given

    @cached_property
    def pins(self) -> FloatArray:
        """(n,) the spin that each tag is pinned to [rad], NaN for none."""
        pins, asked = np.full(len(self), np.nan), self.cell.optimize.pins
        for tag in range(len(self) if asked else 0):
            pins[tag] = asked.get(self.toolpath.tag_name(tag), np.nan)
        return np.where(np.isnan(pins), self._held_spins, pins)

    @cached_property
    def _held_spins(self) -> FloatArray:
        """(n,) the spin of the pose that each tag is to hold [rad], NaN for none."""
        if HELD not in self.toolpath.extra:
            return np.full(len(self), np.nan)
        R_base_tcp = np.asarray(self.toolpath.extra[HELD])[:, :9].reshape(-1, 3, 3)
        place = self.placement
        R = np.swapaxes(place.R_base_tcp, 1, 2) @ np.nan_to_num(R_base_tcp)
        spin = twist_about(R, place.tool_axis)
        near = np.round(spin / _PLANNED) * _PLANNED
        spin = rounded_spin(np.where(np.abs(spin - near) < _PRINTED, near, spin))
        return np.where(np.isfinite(R_base_tcp).all(axis=(1, 2)), spin, np.nan)

    @cached_property
    def least_feeds(self) -> FloatArray:
        """(n,) lowest feed [m/s] that the process takes at each tag, 0 where any will do."""
        return least_feeds(self.toolpath, self.cell)

    @cached_property
    def strokes(self) -> Strokes:
        """The strokes by which holes and points are reached and left."""
        return strokes_of(self.toolpath, self.cell.motion.approach)

    @cached_property
    def lifts(self) -> FloatArray:
        """(n,) [m] by how much the tool backs off from a tag before any motion but a cut.

        No farther than the CAM file itself where its next point is straight behind the cut and the
        tool does not lean.
        """
        inside = in_material(self.toolpath, self.cell)
        own = np.where(self.placement.may_tilt, np.inf, self._own_ways_out)
        far = out_of_cut(self.toolpath, self.cell)
        far = np.where(self._is_led_out, back_off(self.cell), far)
        return np.where(inside, np.minimum(far, own), 0.0)

    @cached_property
    def _is_led_out(self) -> BoolArray:
        """(n,) tags behind which the CAM file itself goes on in rapid."""
        return np.append(~np.isin(np.asarray(self.toolpath.kind), CUTS)[1:], False)

    @cached_property
    def _own_ways_out(self) -> FloatArray:
        """(n,) [m] by how much the rapid behind a tag backs off straight, infinite for others."""
        path, ways = self.toolpath, np.full(len(self), np.inf)
        rapid = np.flatnonzero(np.asarray(path.kind)[1:] == MotionKind.RAPID)
        a, b = (tags + rapid for tags in (0, 1))
        leaves = on_the_way_out(path.points[a], -path.axes[a], path.points[b], -path.axes[b])
        length = np.linalg.norm(path.points[b] - path.points[a], axis=1)
        ways[a] = np.where(leaves & (length > 0.0), length, np.inf)
        return ways

    @cached_property
    def ways_out(self) -> FloatArray:
        """(n,) [m] the way along its axis that the tool must have free at a tag to leave or enter.

        ``lifts`` where neither a cut nor a rapid another way follows; ``ways_in`` where it is known
        before any pose that a cut begins there. Else 0.
        """
        goes_on = cut_into(self.toolpath)
        goes_on |= np.asarray(self.toolpath.kind) == MotionKind.RAPID
        goes_on = np.append(goes_on[1:], False)
        ways = np.where(goes_on & np.isinf(self._own_ways_out), 0.0, self.lifts)
        entered = entered_anew(self.toolpath) | (np.arange(len(self)) == 0)
        return np.where(entered, np.maximum(ways, self.ways_in), ways)

    @cached_property
    def ways_in(self) -> FloatArray:
        """(n,) [m] from how high above a tag the tool comes down into a cut that begins there.

        Wherever the CAM file does not lead into it: at its first point, behind tags left out, and
        where a cut is entered again. 0 at tags that no cut can begin at.
        """
        is_cut = np.isin(np.asarray(self.toolpath.kind), CUTS)
        ways = np.where(is_cut, out_of_cut(self.toolpath, self.cell), 0.0)
        if self.cell.motion.path_entry is PathEntry.NONE:
            ways[:1] = 0.0
        return ways

    def tilt_of(self, tags: IndexArray, T_base_tcp: FloatArray) -> FloatArray | None:
        """Return the angle (m,) [rad] of the tool axis to the CAM data's; None: no tilt allowed."""
        if len(self.tilts) == 1:
            return None
        axis = T_base_tcp[:, :3, :3] @ self.placement.tool_axis
        return angle_between(axis, self.placement.axis_base(tags))

    def way_out(
        self, tags: IndexArray, attitude: FloatArray, branch: IndexArray, q: FloatArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Return where the tool stands when it has backed off by ``ways_out`` from tags (m,).

        T_base_tcp (m, 4, 4), joints (m, 6) [rad], and whether it can: reach, limits, singularity.

        Args:
            tags: (m,).
            attitude: (m, 3) [rad].
            branch: (m,).
            q: (m, 6) joints at the tags [rad].
        """
        T = self.placement.tcp(tags, attitude, self.ways_out[tags])
        top, reached = self.solve(T, self.placement.external[tags], branch, q)
        return T, top, np.asarray(reached & self.within(top) & self.regular(top))

    def solve(
        self,
        T_base_tcp: FloatArray,
        external: FloatArray,
        branch: IndexArray,
        q_near: FloatArray,
    ) -> tuple[FloatArray, BoolArray]:
        """Return the joints (m, 6) that reach TCP poses (m, 4, 4) in the given branches.

        The external axes stand at ``external`` (m, k) [m or rad]. Every joint takes the turn
        nearest to ``q_near``, whether or not within limits; the second value says where the pose
        is within reach.
        """
        return self.solve_flange(self.placement.flange(T_base_tcp, external), branch, q_near)

    def solve_flange(
        self, T_robroot_flange: FloatArray, branch: IndexArray, q_near: FloatArray
    ) -> tuple[FloatArray, BoolArray]:
        """Return as ``solve`` the joints that reach flange poses (m, 4, 4)."""
        q, valid = self.kinematics.ik_in(T_robroot_flange, branch)
        return nearest_turn(q, q_near), valid

    def standing(self, external: FloatArray) -> Problem:
        """Return the problem with the external axes at (k,) [m or rad] all along."""
        place = self.placement
        rows = np.tile(external, (len(self), 1))
        turn = place.base(rows)[..., :3, :3] @ np.swapaxes(
            place.base(place.external)[..., :3, :3], -1, -2
        )
        normal = (turn @ self.normal[:, :, None])[:, :, 0]
        return replace(self, placement=replace(place, external=rows), normal=normal)

    def within(self, q: FloatArray) -> BoolArray:
        """Return (m,) whether all joints keep the margin of the cell from their limits."""
        return self.kinematics.within_limits(q, self.cell.limits.joint_margin)

    def regular(self, q: FloatArray) -> BoolArray:
        """Return (m,) whether the wrist keeps its distance from the straight pose."""
        return np.asarray(
            wrist_distance(self.kinematics, q) >= self.cell.limits.singularity - ROUNDING
        )


def nearest_turn(q: FloatArray, q_near: FloatArray) -> FloatArray:
    """Return angles shifted by whole turns to lie within half a turn of ``q_near``."""
    moved: FloatArray = q + TURN * np.round((q_near - q) / TURN)
    return moved


def stiffness_of(cell: Cell) -> Compliance | None:
    """Return joint compliance as a function of the configuration, None without stiffness.

    What a model of the arm knows goes before the cell's constant.
    """
    if cell.joint_compliance is not None:
        return cell.joint_compliance
    if cell.joint_stiffness is None:
        return None
    constant = joint_compliance(cell.joint_stiffness)
    return lambda q: np.broadcast_to(constant, q.shape)


def path_normals(toolpath: ToolPath, placement: Placement) -> FloatArray:
    """Return the normal (n, 3) of the path in the work plane, robroot.

    The work plane is normal to the tool axis; the normal lies in it, across the way from the tag
    before to the tag behind. Where the way has no part in that plane (a single hole, a plunge)
    the tool frame's second cross axis at spin 0 stands in.
    """
    points = np.asarray(toolpath.points)
    tags = np.arange(len(points))
    axis = placement.axis_base(tags)
    along = np.zeros_like(points)
    along[1:] += np.diff(points, axis=0)
    along[:-1] += np.diff(points, axis=0)
    across = np.cross(axis, along)
    size = np.linalg.norm(across, axis=1, keepdims=True)
    stand_in = placement.R_base_tcp @ cross_axes(placement.tool_axis)[1]
    normal = np.where(size > ROUNDING, across / np.maximum(size, ROUNDING), stand_in)
    R_robroot_base = placement.base(placement.external)[..., :3, :3]
    return np.asarray(normal[:, None] @ np.swapaxes(R_robroot_base, -1, -2))[:, 0]


@dataclass(frozen=True, slots=True)
class Strokes:
    """Heights above the tag along the tool axis, (n,) [m]; 0 for tags without a stroke.

    ``top``: where the tool arrives and leaves; ``clear``: where the feed starts; ``depth``: how
    far below the tag the tip goes.
    """

    is_stroke: BoolArray
    top: FloatArray
    clear: FloatArray
    depth: FloatArray

    def levels(self, tags: IndexArray) -> list[FloatArray]:
        """Return the heights (m,) [m] at which strokes of tags (m,) end, but for the tag's own."""
        found: list[FloatArray] = []
        for height in (self.top[tags], self.clear[tags], -self.depth[tags]):
            if height.any() and not any(np.array_equal(height, known) for known in found):
                found.append(height)
        return found


def strokes_of(toolpath: ToolPath, approach: float) -> Strokes:
    """Return the strokes of a toolpath.

    A hole takes them from its cycle: the tool arrives at the higher of clearance and retract
    height. A hole without a cycle (a point of a list without a depth) is a point to touch: the
    tool comes down from ``approach`` [m] above it and goes back there.
    """
    n = len(toolpath)
    is_stroke = np.asarray(toolpath.kind) == MotionKind.HOLE
    heights = np.zeros((len(toolpath.cycles) + 1, 3))
    for i, cycle in enumerate(toolpath.cycles):
        heights[i] = max(cycle.clearance, cycle.retract), cycle.clearance, cycle.depth
    heights[-1] = approach, approach, 0.0
    rows = heights[np.asarray(toolpath.cycle)] if n else np.zeros((0, 3))
    rows = np.where(is_stroke[:, None], rows, 0.0)
    return Strokes(is_stroke, rows[:, 0], rows[:, 1], rows[:, 2])
