"""What no model can explain: noise from repeats or the instrument; and measuring faults."""

from __future__ import annotations

from enum import StrEnum

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.gap.data import Samples
from postproc.gap.fit.revisits import WanderBounds, revisits
from postproc.measurement import robust_sigma
from postproc.records import dataclass
from postproc.units import MM

_FAR, _FARTHER = 20.0 * MM, 10.0
"""Distance, and its ratio to the usual one, from which a reading is of something else."""
LEAST = 2e-6
"""No reading of a point is surer than this [m]."""
_CONFLICT = 3.0
"""Ratio of what repeats say and what the instrument promises that is a finding of its own."""
_ALIKE, _DEVICE = 1.5, 40
"""Ratio up to which both say the same, and the freedom with which the instrument's figure counts
then."""
_NEAREST = 0.1
"""Share of the rows whose nearest neighbours bound the noise from above."""
_USED = 400


class Source(StrEnum):
    """What a noise figure rests on."""

    REPEATS = "repeats"
    INSTRUMENT = "instrument"
    ASSUMED = "assumed"


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviation per axis [m] of what no model can explain, and what it rests on.

    sigma: white noise and wander together; white, wander [m], correlation [s] its parts; drift:
    what the revisited poses do in the course of time beyond that; freedom: degrees of freedom of
    the repeats; repeats: how many; instrument: [m] of cell or file, NaN without; upper: [m] bound
    from neighbouring poses, for a noise that is only assumed; conflict: in words, where repeats
    and instrument disagree; bounds: what a wander has at most by the repeats, where they show none.
    """

    sigma: float
    source: Source
    freedom: int = 0
    repeats: int = 0
    white: float = float("nan")
    wander: float = 0.0
    correlation: float = float("nan")
    drift: str = ""
    instrument: float = float("nan")
    upper: float = float("nan")
    conflict: str = ""
    bounds: WanderBounds = ()

    def lets(self, wander: float, correlation: float) -> bool:
        """Return whether the repeats let a wander [m] of a correlation time [s] be."""
        if not self.bounds:
            return True
        return wander < min(self.bounds, key=lambda b: abs(np.log(b[0] / correlation)))[1]

    @property
    def known(self) -> bool:
        """Whether it was measured or is given."""
        return self.source is not Source.ASSUMED

    @property
    def is_doubted(self) -> bool:
        """Whether repeats scatter far more than the instrument is said to."""
        return bool(self.conflict) and self.sigma > self.instrument


def noise_of(
    samples: Samples,
    y: FloatArray,
    usable: BoolArray,
    unit: IntArray,
    instrument: FloatArray | None,
    rest: float,
) -> Noise:
    """Return the noise of a campaign: from revisited poses, else from the instrument.

    Args:
        samples: rows.
        y: (n, 3) gap [m].
        usable: (n,) rows that are no faults.
        unit: (n,) set-up of the measuring device.
        instrument: (n,) sd per axis that cell or file give [m].
        rest: what every candidate together leaves [m]: where nothing else is known it serves to
            weigh the rows, and proves nothing.
    """
    again = revisits(samples, y, usable, unit)
    device = np.nan if instrument is None else float(np.sqrt(np.mean(instrument**2)))
    if again.sufficient:
        scale = _pooled(again.white, again.freedom, device) / max(again.white, LEAST)
        return Noise(
            max(scale * again.noise, LEAST),
            Source.REPEATS,
            int(again.freedom),
            len(again.rows) - len(np.unique(again.group)),
            max(scale * again.white, LEAST),
            again.wander,
            again.correlation,
            again.drift,
            device,
            conflict=_conflict(again.noise, device),
            bounds=again.bounds,
        )
    if instrument is not None:
        return Noise(device, Source.INSTRUMENT, white=device, instrument=device)
    upper = neighbour_bound(samples, y, usable, unit)
    sigma = max(min(rest, upper), LEAST)
    return Noise(sigma, Source.ASSUMED, white=sigma, upper=upper)


def _pooled(repeats: float, freedom: float, device: float) -> float:
    """Return the white noise [m] by repeats and instrument together, where they are alike."""
    if not device / _ALIKE < repeats < device * _ALIKE:
        return max(repeats, LEAST)
    square = freedom * repeats**2 + _DEVICE * device**2
    return float(np.sqrt(square / (freedom + _DEVICE)))


def _conflict(repeats: float, device: float) -> str:
    if not np.isfinite(device) or max(repeats, device) < _CONFLICT * min(repeats, device):
        return ""
    return (
        f"repeats scatter by {repeats / MM:.4f} mm, the instrument is said to have"
        f" {device / MM:.4f} mm"
    )


def neighbour_bound(samples: Samples, y: FloatArray, usable: BoolArray, unit: IntArray) -> float:
    """Return a bound of the noise [m]: half the variance of differences of neighbouring rows."""
    from scipy.spatial import cKDTree

    rows = np.flatnonzero(usable)
    rows = rows[:: max(1, len(rows) // _USED)]
    part = samples.rows(rows)
    turned = part.q * np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.2])
    features = [turned, 100.0 * unit[rows][:, None]]
    if part.direction is not None:
        features.append(0.1 * part.direction)
    if part.wrench is not None and np.any(part.wrench):
        features.append(part.wrench[:, :3] / np.abs(part.wrench[:, :3]).max())
    feature = np.column_stack(features)
    distance, near = (np.asarray(v) for v in cKDTree(feature).query(feature, k=2))
    order = np.argsort(distance[:, 1], kind="stable")[: max(6, int(_NEAREST * len(rows)))]
    apart = np.linalg.norm(y[rows[order]] - y[rows[near[order, 1]]], axis=1)
    return robust_sigma(apart) / float(np.sqrt(2.0))


def gross_faults(y: FloatArray) -> BoolArray:
    """Return the rows (n,) whose gap (n, 3) [m] is of another order than that of most."""
    away = np.linalg.norm(y, axis=1)
    return np.asarray(away > max(_FAR, _FARTHER * float(np.median(away))))


_KNOTS = 24
"""Most knots of the wander at a station."""
_SCALES = (0.02, 0.06, 0.2)
"""Correlation times tried, over the length of the campaign."""


@dataclass(frozen=True, slots=True)
class Wander:
    """A wander of unit size: its name, columns (n, 3, k) [m], correlation time [s]."""

    key: str
    X: FloatArray
    scale: float


def wanders(samples: Samples, unit: IntArray) -> tuple[Wander, ...]:
    """Return the wanders that readings may have: first-order processes in time as columns.

    Zero mean, exponential correlation, along each axis; between knots straight. How large a wander
    is, and which of a few correlation times it has, the rows say beside every candidate.

    Args:
        samples: all rows of a campaign.
        unit: (n,) set-up of the measuring device; its wander starts anew with each.
    """
    time = samples.course
    if float(np.ptp(time)) <= 0.0:
        return ()
    length = max(float(np.ptp(time[unit == u])) for u in np.unique(unit))
    found = []
    for share in _SCALES:
        scale = share * length
        parts = [_station(time, unit == u, scale) for u in np.unique(unit)]
        f = np.concatenate(parts, axis=1)
        X = np.einsum("ij,nk->nijk", np.eye(3), f).reshape(len(f), 3, -1)
        found.append(Wander(f"wander:{share:g}", np.asarray(X), scale))
    return tuple(found)


def _station(time: FloatArray, here: np.ndarray, scale: float) -> FloatArray:
    """Return (n, k) the wander of one station between knots."""
    start, end = float(time[here].min()), float(time[here].max())
    count = int(np.clip(2.0 * (end - start) / scale, 3, _KNOTS))
    knots = np.linspace(start, max(end, start + 1.0), count)
    step = knots[1] - knots[0]
    hat = np.maximum(1.0 - np.abs(time[:, None] - knots) / step, 0.0) * here[:, None]
    K = np.exp(-np.abs(knots[:, None] - knots) / scale)
    return np.asarray(hat @ np.linalg.cholesky(K + 1e-9 * np.eye(count)))
