"""The rows of a campaign as the effects see them: columns, geometry, loads. SI, axes of robroot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import FloatArray, IntArray, Rows
from postproc.errors import DataError
from postproc.gap.data.reference import ArmReference
from postproc.geometry import apply, inverse, skew
from postproc.kinematics import Kinematics
from postproc.measurement import MeasurementSet, SetUps, points_of_rows
from postproc.records import dataclass

COLUMN_NAMES = {
    "direction": tuple(f"dir{i}" for i in range(1, 7)),
    "qd": tuple(f"qd{i}_deg_s" for i in range(1, 7)),
    "wrench": ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm"),
    "time": ("time_s",),
    "temperature": ("temp_C",),
    "past": ("time_s", "fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm"),
}
"""Column of ``Samples`` to its names in the measurement file; any other is one by its own name."""


FADES = (300.0, 900.0, 2700.0)
"""Times [s] in which the trace of a load fades."""
_BY_ROW = (
    "q",
    "frames",
    "axes",
    "point",
    "load_point",
    "course",
    "seen",
    "loaded",
    "set_up",
    "references",
)


@dataclass(frozen=True, slots=True)
class Arm:
    """The nominal arm with the point that is measured, and what is assumed of its inside.

    ``p_flange_point`` (3,) [m]: tool centre point or reflector in the flange, what is measured;
    ``p_flange_load`` (3,) [m]: where the outside wrench acts, in the flange. ``tools``: the tool
    point (3,) [m] of each tool of the cell, for rows that name theirs; ``sees_tool``: what is
    measured is the tool point, no reflector.
    """

    kinematics: Kinematics
    p_flange_point: FloatArray
    p_flange_load: FloatArray
    reference: ArmReference
    tools: Mapping[str, FloatArray] = field(default_factory=dict)
    sees_tool: bool = False

    _constants: tuple[FloatArray, FloatArray, FloatArray] = field(
        init=False, repr=False, compare=False
    )

    def __post_init__(self) -> None:
        """Find what does not depend on the pose."""
        F = np.asarray(self.kinematics.link_frames(np.zeros(6)))
        steps = inverse(F[:6]) @ F[1:]
        T_6_flange = inverse(F[6]) @ self.kinematics.fk(np.zeros(6))
        origins = np.vstack([steps[:, :3, 3], apply(T_6_flange, self.p_flange_point)[None]])
        next_axis = np.einsum("kij,kj->ki", steps[:, :3, :3], self.kinematics.chain.axes)
        found = origins, next_axis, T_6_flange
        for values in found:
            values.flags.writeable = False
        object.__setattr__(self, "_constants", found)

    def link_constants(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return what does not depend on the pose.

        Returns:
            next_origin (7, 3): origin of frame k+1 in frame k (the last: the measured point);
            next_axis (6, 3): axis of joint k+1 in frame k; R_6_flange (3, 3).
        """
        origins, next_axis, T_6_flange = self._constants
        return origins, next_axis, T_6_flange[:3, :3]

    def geometry(self, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return frames (n, 7, 4, 4), flange (n, 4, 4) and joint axes (n, 3, 6), robroot."""
        frames = np.asarray(self.kinematics.link_frames(q))
        axes = frames[:, 1:, :3, :3] @ self.kinematics.chain.axes[:, :, None]
        return frames, frames[:, 6] @ self._constants[2], np.swapaxes(axes[..., 0], 1, 2)

    @property
    def reach(self) -> float:
        """Length of the arm from axis 3's link to the wrist, stretched as at zero angles [m]."""
        origins, _, _ = self.link_constants()
        return float(np.linalg.norm(origins[2] + origins[3] + origins[4]))


@dataclass(frozen=True, slots=True)
class Samples:
    """Rows with the geometry of the arm at ``q`` (n, 6) [rad]; a column not logged is None.

    frames: (n, 7, 4, 4) robroot and links 1..6; axes: (n, 3, 6) joint axes; point: (n, 3)
    nominal measured point; jacobian: (n, 3, 6) of it [m/rad]; load_point: (n, 3) where the wrench
    acts; course: (n,) the time [s], where it was not logged the number of the row: rows are taken
    to stand in the order of measuring; wrench (n, 6) ON the tool there [N, N*m]; temperature in
    degrees Celsius. past: (n, 18) what earlier loads have left of their torque on each joint, for
    each of ``FADES``, where loads and time were logged [N*m]. seen: (n, 3) the measured point of
    each row in the flange [m], where there are several; loaded: the same of where the wrench acts;
    set_up: (n, 2) numbers of station and reflector; references: (n, 3, k) what unknown ends of
    distances and planes move their points by, as they are read.
    """

    arm: Arm
    q: FloatArray
    frames: FloatArray
    axes: FloatArray
    point: FloatArray
    load_point: FloatArray
    course: FloatArray
    direction: FloatArray | None = None
    qd: FloatArray | None = None
    wrench: FloatArray | None = None
    time: FloatArray | None = None
    temperature: FloatArray | None = None
    past: FloatArray | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)
    seen: FloatArray | None = None
    loaded: FloatArray | None = None
    set_up: IntArray | None = None
    references: FloatArray | None = None

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.q)

    @property
    def jacobian(self) -> FloatArray:
        """(n, 3, 6) motion of the point per joint angle [m/rad]."""
        return self._motion_of(self.point)

    def flange(self) -> FloatArray:
        """Return (n, 3) the centre of the flange, robroot [m]."""
        origins, _, R_6_flange = self.arm.link_constants()
        at = origins[6] - R_6_flange @ self.arm.p_flange_point
        return np.asarray(apply(self.frames[:, 6], at))

    def has(self, name: str) -> bool:
        """Return whether a column was logged."""
        return name in self.extra or (name in COLUMN_NAMES and getattr(self, name) is not None)

    def column(self, name: str) -> FloatArray:
        """Return a logged column.

        Raises:
            DataError: GAP001 if it was not logged.
        """
        if not self.has(name):
            raise DataError("GAP001", f"needs the columns {', '.join(columns_of(name))}")
        return np.asarray(self.extra[name] if name in self.extra else getattr(self, name))

    def without(self, *names: str) -> Samples:
        """Return the same rows as if some columns had not been logged."""
        extra = {name: values for name, values in self.extra.items() if name not in names}
        gone: dict[str, Any] = dict.fromkeys(set(names) & set(COLUMN_NAMES))
        return replace(self, extra=extra, **gone)

    def at(self, q: FloatArray) -> Samples:
        """Return the same rows in another pose."""
        frames, flange, axes = self.arm.geometry(q)
        seen = self.arm.p_flange_point if self.seen is None else self.seen
        loaded = self.arm.p_flange_load if self.loaded is None else self.loaded
        point, load = (apply(flange, p) for p in (seen, loaded))
        return replace(self, q=q, frames=frames, axes=axes, point=point, load_point=load)

    def with_points(
        self, measured: FloatArray | None = None, load: FloatArray | None = None
    ) -> Samples:
        """Return the same rows with other points of the arm, in the flange (3,) [m]."""
        arm = self.arm
        arm = arm if measured is None else replace(arm, p_flange_point=measured)
        arm = arm if load is None else replace(arm, p_flange_load=load)
        seen = self.seen if measured is None else None
        loaded = self.loaded if load is None else None
        return replace(self, arm=arm, seen=seen, loaded=loaded).at(self.q)

    def with_set_ups(self, rows: SetUps, points: FloatArray) -> Samples:
        """Return the same rows with their stations and measured points (n, 3) or (3,) [m]."""
        numbers = np.column_stack([rows.station, rows.reflector])
        seen = np.asarray(points) if np.ndim(points) == 2 else None
        return _with_past(replace(self, set_up=numbers, seen=seen).at(self.q))

    def rows(self, index: Rows) -> Samples:
        """Return some of the rows."""
        picked: dict[str, Any] = {
            name: None if getattr(self, name) is None else getattr(self, name)[index]
            for name in (*_BY_ROW, *COLUMN_NAMES)
        }
        extra = {name: np.asarray(values)[index] for name, values in self.extra.items()}
        return replace(self, **picked, extra=extra)

    def load_torque(self) -> FloatArray:
        """Return (n, 6) the torque of the outside wrench on each joint [N*m].

        The reflector that is measured may sit elsewhere than the load.
        """
        wrench = self.column("wrench")
        force = np.einsum("nij,ni->nj", self._motion_of(self.load_point), wrench[:, :3])
        moment = np.einsum("nij,ni->nj", self.axes, wrench[:, 3:])
        return np.asarray(force + moment)

    def _motion_of(self, point: FloatArray) -> FloatArray:
        """Return (n, 3, 6) the motion of points (n, 3) of the tool per joint angle [m/rad]."""
        lever = np.moveaxis(point[:, None, :] - self.frames[:, 1:, :3, 3], -1, 0)
        (ax, ay, az), (x, y, z) = np.moveaxis(self.axes, 1, 0), lever
        return np.stack([ay * z - az * y, az * x - ax * z, ax * y - ay * x], axis=1)

    def weight_torque(self, points: FloatArray, link: int) -> FloatArray:
        """Return (n, 6) the torque per kilogram of masses at ``points`` on the joints [N*m/kg].

        Args:
            points: (n, 3) centres of gravity, robroot [m].
            link: 1..6, the link that carries the mass; joints beyond it feel nothing.
        """
        lever = points[:, None, :] - self.frames[:, 1:, :3, 3]
        # lever x gravity
        moment = lever @ skew(self.arm.reference.gravity)
        torque = np.einsum("nij,nji->nj", self.axes, moment)
        torque[:, link:] = 0.0
        return np.asarray(torque)


def columns_of(name: str) -> tuple[str, ...]:
    """Return the names in a measurement file of a column of ``Samples``."""
    return COLUMN_NAMES.get(name, (name,))


def make_samples(arm: Arm, q: FloatArray, **columns: Any) -> Samples:  # noqa: ANN401
    """Return samples at joint angles (n, 6) [rad] with the columns that were logged."""
    q = np.asarray(q, dtype=np.float64)
    frames, flange, axes = arm.geometry(q)
    point, load = (apply(flange, p) for p in (arm.p_flange_point, arm.p_flange_load))
    time = columns.get("time")
    course = np.arange(len(q), dtype=np.float64) if time is None else np.asarray(time)
    samples = Samples(arm, q, frames, axes, point, load, course, **columns)
    loaded = points_of_rows(arm.tools, samples.extra, arm.p_flange_load)
    if loaded is not None:
        samples = replace(samples, seen=loaded if arm.sees_tool else None, loaded=loaded).at(q)
    return _with_past(samples)


def _with_past(samples: Samples) -> Samples:
    """Return the same rows with what earlier loads have left; each station starts unloaded."""
    time = samples.time
    if time is None or samples.wrench is None:
        return samples
    n = len(samples)
    station = np.zeros(n) if samples.set_up is None else samples.set_up[:, 0]
    order = np.lexsort((np.arange(n), time, station))
    torque, out = samples.load_torque(), np.zeros((n, len(FADES), 6))
    first = np.diff(station[order], prepend=np.nan) != 0.0
    passed = np.where(first, 0.0, np.diff(time[order], prepend=0.0))
    keep = np.exp(-passed[:, None, None] / np.array(FADES)[:, None])
    left = np.zeros((len(FADES), 6))
    for row, share, anew in zip(order, keep, first, strict=True):
        left = np.zeros_like(left) if anew else share * left + (1.0 - share) * torque[row]
        out[row] = left
    return replace(samples, past=out.reshape(n, -1))


def samples_of(arm: Arm, measured: MeasurementSet) -> Samples:
    """Return the samples of a campaign."""
    return make_samples(
        arm,
        measured.q,
        direction=measured.direction,
        qd=measured.qd,
        wrench=measured.wrench,
        time=measured.time,
        temperature=measured.temperature,
        extra=measured.extra,
    )


def column_functions(values: ArrayLike) -> FloatArray:
    """Return smooth functions (n, k) of a logged column, k = 0 where it says nothing.

    Polynomials of numbers, one function for each of few labels.
    """
    array = np.asarray(values)
    nothing = np.zeros((len(array), 0))
    if array.dtype.kind in "fiu":
        numbers = array.astype(np.float64)
        seen = np.isfinite(numbers)
        if seen.sum() < 10 or np.ptp(numbers[seen]) == 0.0:
            return nothing
        numbers = np.where(seen, numbers, np.median(numbers[seen]))
        ranks = np.argsort(np.argsort(numbers)) / max(len(numbers) - 1, 1)
        scaled = (numbers - np.min(numbers)) / np.ptp(numbers)
        x = 2.0 * (0.5 * scaled + 0.5 * ranks) - 1.0
        return np.asarray(np.polynomial.legendre.legvander(x, 3)[:, 1:], dtype=np.float64)
    labels, index = np.unique(array, return_inverse=True)
    if not 2 <= len(labels) <= min(12, len(array) // 8):
        return nothing
    functions = np.eye(len(labels))[index][:, 1:]
    return np.asarray(functions - functions.mean(axis=0))


def weight_torque(samples: Samples) -> FloatArray:
    """Return (n, 6) torque of the links' weight on the joints [N*m]."""
    reference, mass = samples.arm.reference, samples.arm.reference.link_mass
    moment = np.zeros((len(samples), 6, 3))
    for link in range(6):
        com = apply(samples.frames[:, link + 1], reference.link_com[link])
        moment[:, : link + 1] += mass[link] * com[:, None]
    carried = np.cumsum(mass[::-1])[::-1]
    moment -= carried[:, None] * samples.frames[:, 1:, :3, 3]
    torque = np.einsum("nij,nji->nj", samples.axes, moment @ skew(reference.gravity))
    return np.asarray(torque)


def first_moment_torque(samples: Samples, R: FloatArray, link: int) -> FloatArray:
    """Return (n, 6, 3) torque on the joints of a first moment of mass along x, y, z of R [m/s^2].

    Args:
        samples: rows.
        R: (n, 3, 3) axes of the moment, in robroot.
        link: 1..6, the link that carries the mass.
    """
    pull = np.swapaxes(R, 1, 2) @ skew(samples.arm.reference.gravity)
    torque = np.swapaxes(samples.axes, 1, 2) @ np.swapaxes(pull, 1, 2)
    torque[:, link:] = 0.0
    return np.asarray(torque)


def load_moment(samples: Samples, at: FloatArray) -> FloatArray:
    """Return (n, 3) moment of the outside wrench about points (n, 3), robroot [N*m]."""
    wrench = samples.column("wrench")
    return np.asarray(np.cross(samples.load_point - at, wrench[:, :3]) + wrench[:, 3:])


def weight_moment(samples: Samples, at: FloatArray, links: Iterable[int]) -> FloatArray:
    """Return (n, 3) moment about points (n, 3) of the weight of some links [N*m]."""
    reference = samples.arm.reference
    moment = np.zeros((len(samples), 3))
    for link in links:
        com = apply(samples.frames[:, link], reference.link_com[link - 1])
        moment += (com - at) @ skew(reference.link_mass[link - 1] * reference.gravity)
    return moment
