"""Where the tool stands at each tag: the tool axis is given, the spin about it is free.

A pose of a tag is a function of its *attitude* (3,) [rad]: spin, lead, side tilt. The tip stays on
the CAM point whatever the attitude; the spin counts about the CAM axis, then the tool is tilted.

Spin 0 is the input's own orientation where it gave one. Otherwise a direction fixed to the part,
projected on the plane across the tool axis, tells where the tool frame's first cross axis points;
the part axis that stays best clear of all tool axes is taken. Where every part axis comes close to
some tool axis (a path all around a sphere) the direction is carried along by the smallest
rotation from tag to tag instead (parallel transport), which never fails on a path that turns
less than 180 degrees between tags.
"""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import ROUNDING, BoolArray, FloatArray, IndexArray, taken
from postproc.cell import Cell
from postproc.errors import PlanError
from postproc.geometry import inverse, rotation_about, rotation_from_vector, transform
from postproc.model import ToolPath
from postproc.paths import Externals
from postproc.planning.states.tilt import tilt_vectors
from postproc.records import dataclass
from postproc.units import TURN

SPIN_GRID = 1e-9
"""Spins are rounded to multiples of this [rad] before poses are built."""
NO_POSE = (
    "only joint angles are given, and nothing in the file proves that they are for the cell's arm; "
    "a Cartesian target is needed"
)
_CLEAR = 0.1
_ACROSS = {0: (1, 2), 1: (2, 0), 2: (0, 1)}


@dataclass(frozen=True, slots=True)
class Placement:
    """Poses of all tags as functions of the attitude.

    Args:
        R_base_tcp: (n, 3, 3) orientation at spin 0; p_base_tcp: (n, 3) [m].
        T_robroot_base: (4, 4) with all external axes at 0; T_tcp_flange: (4, 4).
        tool_axis: (3,) unit, TCP axes, out of the tool into the part.
        reference: what spin 0 is, in words.
        given: (n,) tags whose pose the input gives; at others stands that of a tag beside them.
        feed: (n, 3) unit feed direction across the tool axis, workpiece frame; NaN at tags that
            may not tilt.
        external: (n, k) where the external axes stand at each tag [m or rad].
        axes: the external axes that move along the toolpath; None: nothing moves, k = 0.
    """

    R_base_tcp: FloatArray
    p_base_tcp: FloatArray
    T_robroot_base: FloatArray
    T_tcp_flange: FloatArray
    tool_axis: FloatArray
    reference: str
    given: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    feed: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    external: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    axes: Externals | None = None

    def __post_init__(self) -> None:
        """Take all tags as given and none as free to tilt where nothing else is said."""
        if len(self.given) != len(self.p_base_tcp):
            object.__setattr__(self, "given", np.ones(len(self.p_base_tcp), dtype=np.bool_))
        if len(self.feed) != len(self.p_base_tcp):
            object.__setattr__(self, "feed", np.full(self.p_base_tcp.shape, np.nan))
        if self.axes is None:
            object.__setattr__(self, "external", np.zeros((len(self.p_base_tcp), 0)))

    def __len__(self) -> int:
        """Return the number of tags."""
        return len(self.p_base_tcp)

    @property
    def may_tilt(self) -> BoolArray:
        """(n,) tags whose tool axis may leave that of the CAM data."""
        return np.isfinite(self.feed[:, 0])

    def axis_base(self, tags: IndexArray) -> FloatArray:
        """Return the CAM tool axis (m, 3) in the workpiece frame, into the part."""
        axis: FloatArray = taken(self.R_base_tcp, tags) @ self.tool_axis
        return axis

    def tilts(self, tags: IndexArray, attitude: FloatArray) -> FloatArray:
        """Return by what (m, 3) [rad] attitudes tilt the tool: axis times angle, workpiece frame.

        Zero at tags that may not tilt, and where ``attitude`` (m,) is the spin alone.
        """
        if attitude.ndim == 1 or not attitude[:, 1:].any():
            return np.zeros((len(tags), 3))
        return tilt_vectors(-self.axis_base(tags), self.feed[tags], attitude[:, 1:])

    def rotation(self, tags: IndexArray, attitude: FloatArray) -> FloatArray:
        """Return R_base_tcp (m, 3, 3) of tags (m,) at attitudes (m, 3) or spins (m,) [rad]."""
        spin = attitude if attitude.ndim == 1 else attitude[:, 0]
        turn = rotation_about(self.tool_axis, spin)
        R: FloatArray = taken(self.R_base_tcp, tags) @ turn
        tilts = self.tilts(tags, attitude)
        return rotation_from_vector(tilts) @ R if tilts.any() else R

    def tcp(
        self, tags: IndexArray, attitude: FloatArray, lift: FloatArray | float = 0.0
    ) -> FloatArray:
        """Return T_base_tcp (m, 4, 4); ``lift`` [m] backs the tool off along its axis.

        Args:
            tags: (m,) indices.
            attitude: (m, 3) spin, lead, side tilt [rad], or spins (m,) alone.
            lift: (m,) or one for all.
        """
        R, p = self.rotation(tags, attitude), taken(self.p_base_tcp, tags)
        if np.any(lift):
            axis = self.axis_base(tags)
            tilts = self.tilts(tags, attitude)
            if tilts.any():
                axis = np.einsum("mij,mj->mi", rotation_from_vector(tilts), axis)
            p = p - axis * np.asarray(lift, dtype=np.float64)[..., None]
        return transform(R, p)

    def base(self, external: FloatArray) -> FloatArray:
        """Return T_robroot_base with the external axes at (..., k) [m or rad].

        (..., 4, 4), or (4, 4) where none moves.
        """
        if self.axes is None:
            return self.T_robroot_base
        shift = self.axes.shift(external.reshape(-1, external.shape[-1]))
        return (shift @ self.T_robroot_base).reshape(*external.shape[:-1], 4, 4)

    def flange(self, T_base_tcp: FloatArray, external: FloatArray) -> FloatArray:
        """Return T_robroot_flange (m, 4, 4) of TCP poses in the workpiece frame.

        Args:
            T_base_tcp: (m, 4, 4).
            external: (m, k) where the external axes stand [m or rad].
        """
        T_robroot_tcp: FloatArray = self.base(external) @ T_base_tcp
        rows = T_robroot_tcp.reshape(-1, 4) @ self.T_tcp_flange  # one product, not one for each
        return rows.reshape(T_robroot_tcp.shape)

    def backed_off(self, T_robroot_flange: FloatArray, height: FloatArray) -> FloatArray:
        """Return flange poses (m, 4, 4) moved back along the tool axis by heights (m,) [m]."""
        axis_flange = self.T_tcp_flange[:3, :3].T @ self.tool_axis
        T: FloatArray = T_robroot_flange.copy()
        T[:, :3, 3] -= height[:, None] * (T[:, :3, :3] @ axis_flange)
        return T


def place(toolpath: ToolPath, cell: Cell) -> Placement:
    """Return the placement of a toolpath in a cell.

    Raises:
        PlanError: PLN201 if the tool axis turns by 180 degrees between two tags and no part axis
            gives a reference either; PLN206 if a tag has no Cartesian target.
    """
    missing = np.flatnonzero(~has_pose(toolpath))
    if len(missing):
        raise PlanError("PLN206", NO_POSE, toolpath.source(int(missing[0])))
    tool_axis = np.asarray(cell.tool.axis, dtype=np.float64)
    if toolpath.rotations is not None:
        R, reference = np.array(toolpath.rotations), "orientation of the input"
    else:
        direction = -np.asarray(toolpath.axes)
        across, reference = _reference(direction)
        R = frames_across(direction, across, tool_axis)
    return Placement(
        R,
        np.asarray(toolpath.points),
        np.asarray(cell.T_robroot_base),
        inverse(cell.tool.T_flange_tcp),
        tool_axis,
        reference,
    )


def place_given(toolpath: ToolPath, cell: Cell) -> tuple[ToolPath, Placement]:
    """Return a toolpath and its placement with stand-ins where a tag has no Cartesian target.

    ``Placement.given`` says which are real.
    """
    filled, given = stand_ins(toolpath)
    return filled, replace(place(filled, cell), given=given)


def stand_ins(toolpath: ToolPath) -> tuple[ToolPath, BoolArray]:
    """Return a toolpath of finite poses, and which (n,) are those of the input.

    Where a tag has no Cartesian target that of the last one before (else of the first behind)
    stands in.
    """
    given = has_pose(toolpath)
    if given.all():
        return toolpath, given
    n = len(toolpath)
    if given.any():
        source = np.maximum.accumulate(np.where(given, np.arange(n), -1))
        source = np.where(source < 0, int(np.argmax(given)), source)
        points, axes = toolpath.points[source], toolpath.axes[source]
        rotations = None if toolpath.rotations is None else toolpath.rotations[source]
    else:
        points, axes, rotations = np.zeros((n, 3)), np.tile([0.0, 0.0, 1.0], (n, 1)), None
    return replace(toolpath, points=points, axes=axes, rotations=rotations), given


def has_pose(toolpath: ToolPath) -> BoolArray:
    """Return (n,) whether the tags have a Cartesian target, not only joints of another robot."""
    finite = np.isfinite(toolpath.points).all(axis=1) & np.isfinite(toolpath.axes).all(axis=1)
    if toolpath.rotations is not None:
        finite &= np.isfinite(toolpath.rotations).all(axis=(1, 2))
    return np.asarray(finite)


def frames_across(direction: FloatArray, across: FloatArray, tool_axis: FloatArray) -> FloatArray:
    """Return R (n, 3, 3) that lays the tool axis and its first cross axis as asked.

    Args:
        direction: (n, 3) unit, where ``tool_axis`` shall point.
        across: (n, 3) unit, normal to it, where the first cross axis shall point.
        tool_axis: (3,) one of the TCP axes, with sign. Its first cross axis is y for x, z for y,
            x for z.
    """
    main = int(np.argmax(np.abs(tool_axis)))
    first = _ACROSS[main][0]
    B_tcp = np.column_stack([tool_axis, np.eye(3)[first], np.cross(tool_axis, np.eye(3)[first])])
    B_base = np.stack([direction, across, np.cross(direction, across)], axis=-1)
    R: FloatArray = B_base @ B_tcp.T
    return R


def cross_axes(tool_axis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the two TCP axes (3,) across the tool axis, the reference of the spin first."""
    first, second = _ACROSS[int(np.argmax(np.abs(tool_axis)))]
    return np.eye(3)[first], np.eye(3)[second]


def _reference(direction: FloatArray) -> tuple[FloatArray, str]:
    along = np.abs(direction)
    worst = np.sqrt(np.maximum(0.0, 1.0 - along.max(axis=0) ** 2))
    best = int(np.argmax(np.round(worst, 6)))
    if worst[best] >= _CLEAR:
        fixed = np.eye(3)[best]
        across = fixed - direction * direction[:, best, None]
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        return across, f"part {'xyz'[best]}"
    start = np.eye(3)[int(np.argmin(along[0]))]
    return transported(direction, start), "parallel transport"


def transported(direction: FloatArray, start: FloatArray) -> FloatArray:
    """Carry a cross direction along by the smallest rotation between successive tool axes.

    Args:
        direction: (n, 3) unit tool axes.
        start: (3,) not parallel to the first; its part across the first axis is carried.

    Returns:
        (n, 3) unit, normal to ``direction``.

    Raises:
        PlanError: PLN201 where an axis is opposite to the one before.
    """
    across = np.empty_like(direction)
    u = start - direction[0] * float(direction[0] @ start)
    across[0] = u / np.linalg.norm(u)
    cross = np.cross(direction[:-1], direction[1:])
    cosine = np.einsum("ij,ij->i", direction[:-1], direction[1:])
    opposite = np.nonzero(cosine < -1.0 + ROUNDING)[0]
    if len(opposite):
        raise PlanError(
            "PLN201",
            f"the tool axis turns by 180 degrees between tags {opposite[0]} and "
            f"{opposite[0] + 1}; a tag in between is needed to fix the direction",
        )
    for i in range(1, len(direction)):
        k = cross[i - 1]
        u = across[i - 1]
        u = u * cosine[i - 1] + np.cross(k, u) + k * float(k @ u) / (1.0 + cosine[i - 1])
        u = u - direction[i] * float(direction[i] @ u)
        across[i] = u / np.linalg.norm(u)
    return across


def spin_values(step: float, low: float, high: float) -> FloatArray:
    """Return the grid of spins (S,) [rad]: multiples of ``step`` in [low, high].

    A range of a full turn or more gives [-180, 180) degrees: no spin stands in the grid twice.
    """
    if high - low >= TURN - ROUNDING:
        count = max(1, int(np.floor(TURN / step + ROUNDING)))
        return rounded_spin((np.arange(count) - count // 2) * step)
    first, last = int(np.ceil(low / step - ROUNDING)), int(np.floor(high / step + ROUNDING))
    if last < first:
        return rounded_spin(np.full(1, 0.5 * (low + high)))
    return rounded_spin(np.arange(first, last + 1) * step)


def finer_spins(step: float, low: float, high: float, fine: int) -> FloatArray:
    """Return the grid of ``spin_values`` with ``fine`` spins to each of its own (S,) [rad]."""
    if high - low < TURN - ROUNDING:
        return spin_values(step / fine, low, high)
    between = np.arange(fine) * (step / fine)
    return rounded_spin((spin_values(step, low, high)[:, None] + between).ravel())


def rounded_spin(spin: ArrayLike) -> FloatArray:
    """Round to the grid that makes poses independent of the machine's last digit."""
    rounded: FloatArray = np.round(np.asarray(spin, dtype=np.float64) / SPIN_GRID) * SPIN_GRID + 0.0
    return rounded
