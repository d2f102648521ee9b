"""Load responses from a measuring campaign: what moved the tool point, and by which load.

Readings of one posture under different loads are compared with each other, so that everything
that does not depend on the load (geometry, frames, gravity of the arm) cancels exactly. From m
readings of a posture come m-1 contrasts, independent of each other and of equal noise; for the
common pair loaded and unloaded that is the difference over the square root of two. Only where no
posture was read under two loads are absolute readings taken against the nominal model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.errors import SourceRef, StiffnessError
from postproc.geometry import apply
from postproc.kinematics import Kinematics
from postproc.measurement import MeasurementSet, in_robroot
from postproc.model import Registration
from postproc.records import dataclass
from postproc.stiffness.cartesian import joint_torque
from postproc.units import DEG, MM

SAME_POSTURE = 0.005 * DEG
"""Commanded angles within this [rad] are one posture."""
SAME_PLACE = 1e-3
"""Tool points within this [m] are one tag."""
FARTHEST = 0.02
"""Readings farther than this [m] from the nominal tool point are in another frame."""


@dataclass(frozen=True, slots=True)
class NoiseFloor:
    """Scatter of readings that should be equal: sd per axis [m] and its degrees of freedom."""

    sigma: float
    dof: int


@dataclass(frozen=True, slots=True)
class LoadCases:
    """n independent load responses d = A c + noise, equal noise on all components.

    q (n, 6) [rad]; A (n, 3, 6) [N*m*m/rad ...: m per (rad/(N*m))]; d (n, 3) [m]; point (n, 3)
    nominal tool point, robroot [m]; scale (n,): the measured difference itself is ``scale * d``;
    place (n,): number of the tag; group (n,): number of the group that is held out together;
    posture (n,): number of the posture; ids: rows behind each case; paired: contrasts or absolute
    readings; floor: scatter of repeated readings, None without any; dropped: rows without a use.
    """

    q: FloatArray
    A: FloatArray
    d: FloatArray
    point: FloatArray
    scale: FloatArray
    place: IntArray
    group: IntArray
    posture: IntArray
    ids: tuple[str, ...]
    paired: bool
    floor: NoiseFloor | None = None
    dropped: int = 0
    readings: Mapping[str, int] = field(default_factory=dict)

    def __len__(self) -> int:
        """Return the number of cases."""
        return len(self.q)

    def rows(self, which: BoolArray | IntArray) -> LoadCases:
        """Return some of the cases."""
        index = np.flatnonzero(which) if np.asarray(which).dtype == bool else np.asarray(which)
        names = ("q", "A", "d", "point", "scale", "place", "group", "posture")
        picked = {name: getattr(self, name)[index] for name in names}
        return replace(self, **picked, ids=tuple(self.ids[i] for i in index))

    def spread(self, count: int) -> IntArray:
        """Return one case per posture, at most ``count``, each farthest from those before it."""
        _, first = np.unique(self.posture, return_index=True)
        first = np.sort(first)
        if len(first) <= count:
            return np.asarray(first)
        points = self.q[first] / np.maximum(self.q[first].std(axis=0), 1e-3)
        distance = np.sum((points - points.mean(axis=0)) ** 2, axis=1)
        chosen = []
        for _ in range(count):
            chosen.append(int(np.argmax(distance)))
            distance = np.minimum(distance, np.sum((points - points[chosen[-1]]) ** 2, axis=1))
            distance[chosen[-1]] = -1.0
        return np.asarray(first[np.sort(chosen)])

    def error(self, c_joint: FloatArray) -> FloatArray:
        """Return measured minus predicted displacement (n, 3) [m] of the whole load, unscaled.

        Args:
            c_joint: (6,) or (n, 6) [rad/(N*m)].
        """
        c = np.broadcast_to(c_joint, (len(self), 6))
        left: FloatArray = self.d - np.einsum("nij,nj->ni", self.A, c)
        return left * self.scale[:, None]


def load_cases(
    measured: MeasurementSet,
    kinematics: Kinematics,
    p_flange_tcp: FloatArray,
    registration: Registration | None = None,
) -> LoadCases:
    """Return the load responses of a campaign.

    Args:
        measured: the readings; their wrench acts at the tool point.
        kinematics: the nominal arm.
        p_flange_tcp: (3,) [m] tool point in the flange.
        registration: where the tracker stands and what it saw; None: readings are of the tool
            point, in robroot.

    Raises:
        StiffnessError: STF010 no load in the file, STF011 the readings are in another frame.
    """
    if measured.wrench is None or not np.any(measured.wrench):
        raise StiffnessError(
            "STF010",
            "no row has a load (fx_N .. mz_Nm), so stiffness cannot be measured",
            SourceRef(measured.path),
            hint="read each posture with and without load and give the load's force in fx_N..fz_N",
        )
    rows = _Rows.of(measured, kinematics, p_flange_tcp, registration)
    _check_frame(measured, rows)
    posture = clusters(measured.q, SAME_POSTURE)
    place = clusters(rows.nominal, SAME_PLACE)
    group = _group_numbers(measured.group, place)
    loaded = _varying(posture, measured.wrench)
    floor = _floor(posture, measured.wrench, rows.position)
    paired = bool(np.any(loaded))
    if paired:
        keep = np.flatnonzero(loaded)
        first, A, d, scale, last = _contrasts(posture[keep], rows.A[keep], rows.position[keep])
        at = keep[last]
        pairs = zip(keep[first], at, strict=True)
        ids = tuple(f"{measured.ids[a]}/{measured.ids[b]}" for a, b in pairs)
    else:
        at, ids, scale = np.arange(len(measured)), tuple(measured.ids), np.ones(len(measured))
        A, d = rows.A, rows.position - rows.nominal
    return LoadCases(
        q=measured.q[at],
        A=A,
        d=d,
        point=rows.nominal[at],
        scale=scale,
        place=place[at],
        group=group[at],
        posture=posture[at],
        ids=ids,
        paired=paired,
        floor=floor,
        dropped=int(np.sum(~loaded)) if paired else 0,
        readings=_counts(measured, posture, place),
    )


@dataclass(frozen=True, slots=True)
class _Rows:
    """Each reading on its own: regressor, measured and nominal point in robroot."""

    A: FloatArray
    position: FloatArray
    nominal: FloatArray

    @classmethod
    def of(
        cls,
        measured: MeasurementSet,
        kinematics: Kinematics,
        p_flange_tcp: FloatArray,
        registration: Registration | None,
    ) -> _Rows:
        """Return the rows; the load acts at the tool point, the reflector may be elsewhere."""
        wrench = np.asarray(measured.wrench)
        J_load = kinematics.jacobian(measured.q, p_flange_tcp)
        if registration is None:
            p_seen, J_seen, position = p_flange_tcp, J_load, np.asarray(measured.position)
        else:
            p_seen = registration.p_flange_point
            J_seen = kinematics.jacobian(measured.q, p_seen)
            position = in_robroot(registration, measured.position)
        A = J_seen[:, :3, :] * joint_torque(J_load, wrench)[:, None, :]
        return cls(A, position, apply(kinematics.fk(measured.q), p_seen))


def _check_frame(measured: MeasurementSet, rows: _Rows) -> None:
    distance = np.linalg.norm(rows.position - rows.nominal, axis=1)
    typical = float(np.median(distance))
    if typical > FARTHEST:
        raise StiffnessError(
            "STF011",
            f"the readings lie {typical / MM:.0f} mm off the nominal tool points, expected the "
            "tool point in the robot root frame",
            SourceRef(measured.path, int(measured.line[0])),
            hint="give --register if the tracker has its own frame or sees another point, or "
            "check robot and tool of the cell",
        )


def clusters(values: FloatArray, tolerance: float) -> IntArray:
    """Return a number per row of (n, k): rows linked by steps within ``tolerance`` share it.

    Numbers count up in the order of first appearance.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    # rows that are equal to the last digit are merged first: thousands of twins would make
    # millions of pairs
    distinct, back = np.unique(values, axis=0, return_inverse=True)
    pairs = cKDTree(distinct).query_pairs(tolerance, output_type="ndarray")
    n = len(distinct)
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    label = connected_components(links, directed=False)[1][back.reshape(-1)]
    _, first, number = np.unique(label, return_index=True, return_inverse=True)
    order = np.argsort(np.argsort(first))
    return np.asarray(order[number], dtype=np.int32)


def _group_numbers(labels: tuple[str, ...] | None, place: IntArray) -> IntArray:
    if labels is None:
        return place
    _, numbers = np.unique(np.asarray(labels), return_inverse=True)
    return np.asarray(numbers, dtype=np.int32)


def _varying(posture: IntArray, wrench: FloatArray) -> BoolArray:
    """Return the rows whose posture was read under at least two loads."""
    count = int(posture.max()) + 1
    low = np.full((count, 6), np.inf)
    high = np.full((count, 6), -np.inf)
    np.minimum.at(low, posture, wrench)
    np.maximum.at(high, posture, wrench)
    differs = np.any(high - low > 1e-6 * np.abs(wrench).max(), axis=1)
    return np.asarray(differs[posture])


def _floor(posture: IntArray, wrench: FloatArray, position: FloatArray) -> NoiseFloor | None:
    """Pool the scatter of readings of one posture under one load."""
    keys = np.column_stack([posture, np.round(wrench, 6)])
    _, label = np.unique(keys, axis=0, return_inverse=True)
    label = label.reshape(-1)
    count = np.bincount(label)
    dof = 3 * int(np.sum(count - 1))
    if dof < 6:
        return None
    mean = np.stack([np.bincount(label, position[:, k]) / count for k in range(3)], axis=-1)
    square = float(np.sum((position - mean[label]) ** 2))
    return NoiseFloor(float(np.sqrt(square / dof)), dof)


def _contrasts(
    posture: IntArray, A: FloatArray, position: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray, IntArray]:
    """Return Helmert contrasts within each posture."""
    order = np.argsort(posture, kind="stable")
    start = np.flatnonzero(np.diff(posture[order], prepend=-1))
    size = np.diff(np.append(start, len(order)))
    parts = []
    for j in range(1, int(size.max())):
        begin = start[size > j]
        before = order[begin[:, None] + np.arange(j)]
        row = order[begin + j]
        root = np.sqrt(j / (j + 1.0))
        parts.append(
            (
                before[:, 0],
                root * (A[row] - A[before].mean(axis=1)),
                root * (position[row] - position[before].mean(axis=1)),
                np.full(len(row), 1.0 / root),
                row,
            )
        )
    joined = [np.concatenate(column) for column in zip(*parts, strict=True)]
    back = np.argsort(joined[4], kind="stable")
    first, contrast, moved, scale, last = (column[back] for column in joined)
    return first, contrast, moved, scale, last


def _counts(measured: MeasurementSet, posture: IntArray, place: IntArray) -> dict[str, int]:
    return {
        "rows": len(measured),
        "postures": int(posture.max()) + 1,
        "places": int(place.max()) + 1,
    }
