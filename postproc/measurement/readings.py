"""Readings: what each row of a campaign tells of its tool point, one number at a time.

A reading depends on the point p of its row, in the frame of the measurement:

    component   way · p - value             a coordinate, a dial gauge, an axis of a covariance
    distance    |p - origin| - value        ball bar, draw-wire; the origin is given or fitted
    contact     (normal · p + d) / |normal| the point touched a plane, which is fitted

These are the misfits [m] of points that a model expects. Each reading has a sigma of its own and is
independent of the others, so that a likelihood has

    residual = misfit(p, x) / sigma
    d residual / d theta = einsum("mi,mik->mk", slopes(p, x), dp_dtheta[row]) / sigma
    d residual / d x     = unknown_slopes(p, x) / sigma

and -2 ln L = residual · residual + 2 sum(ln sigma) + const. ``x`` holds the numbers of the unknown
origins (3) and planes (normal and d, 4: their common factor is free, a weak prior holds it);
``start(p)`` is where to begin. Three coordinates of equal sigma are components along x, y, z, a
covariance gives components along its principal axes.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.cell import Instrument
from postproc.errors import DataError, SourceRef
from postproc.measurement.rows import MeasurementSet, Remark
from postproc.records import dataclass

_ORIGIN, _PLANE = 3, 4
"""Numbers of an unknown origin and of a plane."""
_EACH = 2
"""Readings that each number of an unknown origin or plane needs."""
_STEPS = 40
_SETTLED = 1e-11
"""Step [m] that ends the fit of unknowns."""
FEW_PARTIAL = 0.25
"""Share of rows without three coordinates that may be left out where points are needed."""


@dataclass(frozen=True, slots=True)
class Readings:
    """Readings of the points of rows, flat (m,).

    row: of each; value: [m]; sigma: [m], NaN where nothing says it. way: (m, 3) unit direction of a
    component, else NaN; origin: (m, 3) known origin of a distance [m], else NaN; at: where the
    numbers of its unknown origin or plane begin in ``x``, -1 without; planar: whether it is a
    contact; names: of the unknowns, by where they begin; size: how many numbers ``x`` has.
    """

    row: IntArray
    value: FloatArray
    sigma: FloatArray
    way: FloatArray
    origin: FloatArray
    at: IntArray
    planar: BoolArray
    names: tuple[tuple[int, str], ...]
    size: int

    def __len__(self) -> int:
        """Return the number of readings."""
        return len(self.row)

    @property
    def firm(self) -> Readings:
        """The readings but those of an unknown origin or plane that too few rows are of."""
        count = np.bincount(self.at + 1, minlength=self.size + 1)[self.at + 1]
        needed = _EACH * np.where(self.planar, _PLANE, _ORIGIN)
        k = np.flatnonzero((self.at < 0) | (count >= needed))
        row, value, sigma = self.row[k], self.value[k], self.sigma[k]
        way, origin, at, planar = self.way[k], self.origin[k], self.at[k], self.planar[k]
        names = tuple(name for name in self.names if np.any(at == name[0]))
        return Readings(row, value, sigma, way, origin, at, planar, names, self.size)

    def misfit(self, p: FloatArray, x: FloatArray | None = None) -> FloatArray:
        """Return (m,) what points (n, 3) would read minus what was read [m]."""
        return self._at(p, x)[0]

    def slopes(self, p: FloatArray, x: FloatArray | None = None) -> FloatArray:
        """Return (m, 3) the change of each misfit per change of its point."""
        return self._at(p, x)[1]

    def unknown_slopes(self, p: FloatArray, x: FloatArray) -> FloatArray:
        """Return (m, k) the change of each misfit per change of an unknown number."""
        own, out = self._at(p, x)[2], np.zeros((len(self), self.size))
        for k in range(_PLANE):
            some = np.flatnonzero((self.at >= 0) & (self.planar | (k < _ORIGIN)))
            out[some, self.at[some] + k] = own[some, k]
        return out

    def start(self, p: FloatArray) -> FloatArray:
        """Return the unknowns (k,) that suit points (n, 3) best.

        A plane is that of least squares; an origin follows from the squares of the distances,
        whose differences are linear in it. Both are then fitted to the readings as they are.
        """
        x = np.zeros(self.size)
        for begin, _ in self.names:
            mine = np.flatnonzero(self.at == begin)
            point = p[self.row[mine]]
            arm = point - point.mean(axis=0)
            if self.planar[mine[0]]:
                normal = np.linalg.svd(arm)[2][2]
                x[begin : begin + _PLANE] = [*normal, -normal @ point.mean(axis=0)]
                continue
            square = np.sum(point**2, axis=1) - self.value[mine] ** 2
            away = np.linalg.lstsq(2.0 * arm, square - square.mean(), rcond=1e-9)[0]
            x[begin : begin + _ORIGIN] = away
        mine = np.asarray(self.at >= 0)
        weight = 1.0 / np.where(np.isfinite(self.sigma), self.sigma, 1.0)[mine]
        for _ in range(_STEPS if self.size else 0):
            X, y = self.unknown_slopes(p, x)[mine], self.misfit(p, x)[mine]
            step = np.linalg.lstsq(X * weight[:, None], -y * weight, rcond=1e-10)[0]
            x = x + step
            if float(np.abs(step).max()) < _SETTLED:
                break
        return x

    def by_row(self, p: FloatArray, x: FloatArray | None = None) -> FloatArray:
        """Return (n,) the root of the sum of squared misfits of each row [m]."""
        return np.sqrt(np.bincount(self.row, self.misfit(p, x) ** 2, len(p)))

    def _at(self, p: FloatArray, x: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return misfit (m,), its slopes by the point (m, 3) and by its own unknown (m, 4)."""
        point, own = p[self.row], np.zeros((len(self), _PLANE))
        misfit = np.einsum("mi,mi->m", self.way, point) - self.value
        slope = np.array(self.way)
        held = np.zeros(self.size) if x is None else x
        far = np.flatnonzero(np.isnan(self.way[:, 0]) & ~self.planar)
        begin = self.at[far]
        fitted = held[np.maximum(begin, 0)[:, None] + np.arange(_ORIGIN)] if self.size else 0.0
        origin = np.where(begin[:, None] >= 0, fitted, self.origin[far])
        length = np.linalg.norm(point[far] - origin, axis=1)
        misfit[far] = length - self.value[far]
        slope[far] = (point[far] - origin) / length[:, None]
        own[far, :_ORIGIN] = -slope[far]
        flat = np.flatnonzero(self.planar)
        if len(flat):
            plane = held[self.at[flat][:, None] + np.arange(_PLANE)]
            normal, size = plane[:, :3], np.linalg.norm(plane[:, :3], axis=1)[:, None]
            height = (np.einsum("mi,mi->m", normal, point[flat]) + plane[:, 3]) / size[:, 0]
            misfit[flat], slope[flat] = height - self.value[flat], normal / size
            own[flat, :3] = point[flat] / size - height[:, None] * normal / size**2
            own[flat, 3] = 1.0 / size[:, 0]
        return misfit, slope, own


def readings_of(
    measured: MeasurementSet, instrument: Instrument | None = None, sigma: float | None = None
) -> Readings:
    """Return the readings of a campaign.

    Args:
        measured: the rows.
        instrument: the device's own model, for rows whose columns do not say their sigma.
        sigma: sd per axis where neither says it [m].
    """
    n = len(measured)
    usual = np.full(n, np.nan if sigma is None else sigma)
    if measured.sigma is not None:
        usual = np.asarray(measured.sigma)
    parts = [_coordinates(measured, usual, instrument)]
    empty, none = np.full((n, 3), np.nan), ("",) * n
    if measured.along is not None and measured.way is not None:
        way = measured.way / np.linalg.norm(measured.way, axis=1, keepdims=True)
        parts.append(_part(measured.along, usual, way, empty, none))
    if measured.length is not None:
        origin = empty if measured.origin is None else np.asarray(measured.origin)
        unknown = np.isnan(origin[:, 0])
        label = tuple(
            name if new else "" for name, new in zip(measured.from_id or none, unknown, strict=True)
        )
        parts.append(_part(measured.length, usual, empty, origin, label))
    if measured.plane is not None:
        touched = np.where([bool(name) for name in measured.plane], 0.0, np.nan)
        parts.append(_part(touched, usual, empty, empty, measured.plane, planar=True))
    return _numbered(parts)


_Part = tuple[IntArray, FloatArray, FloatArray, FloatArray, FloatArray, list[str], bool]


def _part(
    value: FloatArray,
    sigma: FloatArray,
    way: FloatArray,
    origin: FloatArray,
    label: tuple[str, ...],
    *,
    planar: bool = False,
) -> _Part:
    """Return the readings of one column, those of rows that have it."""
    rows = np.flatnonzero(np.isfinite(value)).astype(np.int32)
    names = [label[row] for row in rows]
    return rows, value[rows], sigma[rows], way[rows], origin[rows], names, planar


def _coordinates(
    measured: MeasurementSet, usual: FloatArray, instrument: Instrument | None
) -> _Part:
    """Return the coordinates as components along axes in which their errors are independent."""
    n = len(measured)
    position = np.asarray(measured.position)
    ways, sigma = np.tile(np.eye(3), (n, 1, 1)), np.tile(usual[:, None], (1, 3))
    if instrument is not None and instrument.is_known and measured.sigma is None:
        ways, sigma = instrument.principal_axes(position)
    if measured.sigmas is not None:
        own = np.asarray(np.isfinite(measured.sigmas))
        given = np.any(own, axis=1, keepdims=True)
        ways = np.where(given[:, :, None], np.eye(3), ways)
        sigma = np.where(own, measured.sigmas, sigma)
    whole = has_points(measured)[:, None]
    value = np.where(whole, np.einsum("nij,nj->ni", ways, position), position)
    rows, axis = np.nonzero(np.isfinite(value))
    blank = np.full((len(rows), 3), np.nan)
    names = [""] * len(rows)
    way = ways[rows, axis]
    return rows.astype(np.int32), value[rows, axis], sigma[rows, axis], way, blank, names, False


def _numbered(parts: list[_Part]) -> Readings:
    """Return the parts as one, their unknown origins and planes numbered."""
    at: list[int] = []
    names: dict[tuple[bool, str], int] = {}
    size = 0
    for *_, labels, planar in parts:
        for label in labels:
            key = (planar, label)
            if label and key not in names:
                names[key] = size
                size += _PLANE if planar else _ORIGIN
            at.append(names[key] if label else -1)
    row, value, sigma, way, origin = (np.concatenate([part[k] for part in parts]) for k in range(5))
    planar_rows = np.concatenate([np.full(len(part[0]), part[6]) for part in parts])
    begins = tuple((begin, label) for (_, label), begin in names.items())
    return Readings(
        row, value, sigma, way, origin, np.array(at, dtype=np.int32), planar_rows, begins, size
    )


def has_points(measured: MeasurementSet) -> BoolArray:
    """Return (n,) the rows that have all three coordinates."""
    return np.asarray(np.isfinite(measured.position).all(axis=1))


def reads_points(measured: MeasurementSet, instrument: Instrument) -> bool:
    """Return whether rows read three coordinates of one sd each, and nothing beside."""
    tracker = instrument.is_known and measured.sigma is None
    beside = (measured.along, measured.length, measured.plane, measured.sigmas)
    more = any(column is not None for column in beside)
    return bool(has_points(measured).all()) and not more and not tracker


def only_told(measured: MeasurementSet) -> MeasurementSet:
    """Return the rows with a reading that tells of their point, the others left out."""
    told = np.isin(np.arange(len(measured)), readings_of(measured).firm.row)
    if told.all():
        return measured
    ids = tuple(measured.ids[k] for k in np.flatnonzero(~told))
    text = "read against a point or plane that few rows are of; the rows are left out"
    return measured.rows(told).with_remark(Remark("blank", ids, text))


def only_points(measured: MeasurementSet) -> MeasurementSet:
    """Return the rows with three coordinates, the few others left out with a remark.

    Raises:
        DataError: MEA013 if more than ``FEW_PARTIAL`` of the rows have less.
    """
    whole = has_points(measured)
    if whole.all():
        return measured
    gone = np.flatnonzero(~whole)
    if len(gone) > FEW_PARTIAL * len(measured):
        raise DataError(
            "MEA013",
            f"{len(gone)} of {len(measured)} rows lack x_mm, y_mm or z_mm, expected points",
            SourceRef(measured.path, int(measured.line[gone[0]])),
        )
    ids = tuple(measured.ids[k] for k in gone)
    text = "not all three coordinates were read; the rows are left out"
    kept = measured.rows(whole)
    return kept.with_remark(Remark("blank", ids, text))
