"""Where a part stands: its frame from datum points, nominal on the part and measured on the robot.

    measured = T_robroot_base · nominal + noise

Weighted least squares over rigid motions. A point that the others refute is named and left out;
where they cannot say which one is wrong, none is, and the fit is not good.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from itertools import combinations, islice
from math import comb
from pathlib import Path

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.errors import DataError, SourceRef
from postproc.geometry import apply
from postproc.measurement.registration import rigid_motion
from postproc.measurement.table import finite, numbers, read_table
from postproc.records import dataclass
from postproc.units import MM, SINGLE

NOMINAL = ("x_mm", "y_mm", "z_mm")
MEASURED = ("mx_mm", "my_mm", "mz_mm")
FEWEST = 3
"""Points that a frame needs; with no more, nothing can say which one is wrong."""
ON_A_LINE = 1e-3
"""Points whose spread across their line is a smaller share of that along it leave a turn open."""
NOT_THE_PART = 1e-2
"""No part differs from its drawing by this share of its size: other points were measured."""
SURE = 0.01
"""Chance at which points are told from noise, all ways to choose them counted."""
_STARTS = 300
"""Triples of points from which the best sets are looked for, at most."""
_UNITS = {SINGLE[name].factor / MM: name for name in ("inch", "m", "cm")}


@dataclass(frozen=True, slots=True)
class DatumPoints:
    """Points of a part (n, 3) [m]: nominal in the base, measured in the robot root.

    ``sigma`` (n,): standard deviation of each coordinate, None where nothing is known; ``ignored``:
    columns that say nothing about a frame.
    """

    source: SourceRef
    ids: tuple[str, ...]
    nominal: FloatArray
    measured: FloatArray
    sigma: FloatArray | None
    ignored: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class BaseFit:
    """The frame of a part and how sure it is.

    Args:
        T_robroot_base: (4, 4).
        residuals: (n, 3) measured minus fitted, robot root [m], outliers too.
        outliers: (k,) points left out.
        centre: (3,) middle of the points that count, robot root [m].
        covariance: (6, 6) of shift and turn about it, robot root [m, rad].
        freedom: of the estimate of the noise, inf where the instrument's is taken.
        sigma: standard deviation of a coordinate of weight 1 [m], or how far the stated ones fit.
        agree: whether what is left looks like noise.
    """

    T_robroot_base: FloatArray
    residuals: FloatArray
    outliers: IndexArray
    centre: FloatArray
    covariance: FloatArray
    freedom: float
    sigma: float
    agree: bool

    @property
    def rms(self) -> float:
        """Root mean square distance [m] of the points that count."""
        kept = np.delete(self.residuals, self.outliers, axis=0)
        return float(np.sqrt((kept**2).sum(axis=1).mean()))

    def u95(self, points: FloatArray) -> FloatArray:
        """Return the radius (m,) [m] of the sphere that holds each point (m, 3) of the base, 95 %.

        Source:
            The sum of squares of unequal variances as one chi-square: Satterthwaite 1946.
        """
        from scipy.special import chdtri, fdtri

        J = _turns(apply(self.T_robroot_base, points) - self.centre)
        values = np.linalg.eigvalsh(J @ self.covariance @ J.swapaxes(1, 2)).clip(min=0.0)
        total, squares = values.sum(axis=1), (values**2).sum(axis=1)
        count = np.divide(total**2, squares, out=np.ones_like(total), where=squares > 0.0)
        if np.isfinite(self.freedom):
            share = count * fdtri(count, self.freedom, 0.95)
        else:
            share = chdtri(count, 0.05)
        return np.asarray(np.sqrt(total / count * share))


def read_datum_points(path: str | Path) -> DatumPoints:
    """Read datum points: ``id``, nominal, measured, and ``sigma_mm`` where it is known.

    Raises:
        DataError: as ``read_table``; MEA004 without a column, MEA007 for an empty cell, MEA008 for
            a sigma that is not above 0, MEA014 for an id twice.
        ReadError: IO001, IO002.
    """
    table, known = read_table(path), {"id", "sigma_mm", *NOMINAL, *MEASURED}
    for name in (*NOMINAL, *MEASURED):
        if name not in table.columns:
            near = difflib.get_close_matches(name, [c for c in table.columns if c not in known], 1)
            hint = f"the column {near[0]!r} has another name or unit" if near else ""
            text = f"no column {name!r}, expected {','.join((*NOMINAL, *MEASURED))}"
            raise table.error("MEA004", text, hint=hint)
    rows = [str(row + 1) for row in range(len(table.line))]
    ids = tuple(cell.strip() for cell in table.columns.get("id", rows))
    for row, name in enumerate(ids):
        if name in ids[:row]:
            raise table.error("MEA014", f"point {name} appears twice, expected once", row)
    sigma = None
    if "sigma_mm" in table.columns and not np.isnan(numbers(table, "sigma_mm")).all():
        sigma = finite(table, "sigma_mm") * MM
        for row in np.flatnonzero(sigma <= 0.0).tolist():
            raise table.error("MEA008", f"sigma_mm is {sigma[row] / MM:g}, expected above 0", row)
    return DatumPoints(
        SourceRef(str(path), table.header_line),
        ids,
        np.stack([finite(table, name) for name in NOMINAL], axis=1) * MM,
        np.stack([finite(table, name) for name in MEASURED], axis=1) * MM,
        sigma,
        tuple(name for name in table.columns if name not in known),
    )


def fit_base(points: DatumPoints) -> BaseFit:
    """Return the frame of the part by weighted least squares, outliers left out.

    Args:
        points: nominal and measured.

    Raises:
        DataError: MEA015 fewer than three points, or all on one line; MEA016 points of another
            unit, of a mirrored part, or of another part.
    """
    a, b = points.nominal, points.measured
    _require_spread(points, a, "nominal")
    _require_spread(points, b, "measured")
    weight = np.ones(len(a)) if points.sigma is None else points.sigma**-2.0
    _require_size(points)
    out, agree = _outliers(a, b, weight, stated=points.sigma is not None)
    kept = np.setdiff1d(np.arange(len(a)), out)
    T = rigid_motion(a[kept], b[kept], weight[kept])
    rest = b - apply(T, a)
    _require_the_part(points, T, kept)
    w, freedom = weight[kept], 3.0 * len(kept) - 6.0
    chi = float((w * (rest[kept] ** 2).sum(axis=1)).sum())
    scale = chi / freedom
    if points.sigma is not None and _explained(chi, freedom):
        scale, freedom = 1.0, np.inf
    seen = apply(T, a[kept])
    centre = (w[:, None] * seen).sum(axis=0) / w.sum()
    J = _turns(seen - centre)
    normal = np.einsum("n,nki,nkj->ij", w, J, J)
    return BaseFit(
        T, rest, out, centre, scale * np.linalg.inv(normal), freedom, float(np.sqrt(scale)), agree
    )


def _turns(arm: FloatArray) -> FloatArray:
    """Return d point (n, 3, 6) by shift and turn of the frame, at arms (n, 3) [m]."""
    J = np.zeros((len(arm), 3, 6))
    J[:, :, :3] = np.eye(3)
    J[:, :, 3:] = np.cross(np.eye(3), arm[:, None, :]).swapaxes(1, 2)
    return J


def _require_spread(points: DatumPoints, at: FloatArray, which: str) -> None:
    distinct = len(np.unique(at, axis=0))
    spread = np.linalg.svd(at - at.mean(axis=0), compute_uv=False)
    if distinct >= FEWEST and spread[1] > ON_A_LINE * spread[0]:
        return
    what = f"{distinct} distinct" if distinct < FEWEST else "all"
    where = " points" if distinct < FEWEST else " points on one line"
    raise DataError(
        "MEA015",
        f"{what} {which}{where}, expected at least {FEWEST} that are not on one line",
        points.source,
        "measure points as far apart as the part allows, in two directions",
    )


def _require_size(points: DatumPoints) -> None:
    """Refuse points of another unit, or whose distances are not those of the part."""
    one, two = np.triu_indices(len(points.ids), 1)
    nominal, measured = (
        np.linalg.norm(at[one] - at[two], axis=1) for at in (points.nominal, points.measured)
    )
    apart = np.minimum(nominal, measured) > 0.0
    factor = float(np.median(measured[apart] / nominal[apart]))
    for size, unit in _UNITS.items():
        for of, value in (("nominal", factor / size), ("measured", factor * size)):
            if abs(value - 1.0) < NOT_THE_PART:
                text = f"the {of} points are in {unit}, expected mm: their distances show it"
                raise DataError("MEA016", text, points.source)
    if abs(factor - 1.0) > NOT_THE_PART:
        raise DataError(
            "MEA016",
            f"measured distances are {factor:.3g} times the nominal ones, expected the same",
            points.source,
            "another unit, other points, or points in another order",
        )


def _require_the_part(points: DatumPoints, T: FloatArray, kept: IndexArray) -> None:
    """Refuse points that no place of the part explains."""
    a, b = points.nominal[kept], points.measured[kept]
    rest = np.sqrt(((b - apply(T, a)) ** 2).sum(axis=1).mean())
    size = np.sqrt(((a - a.mean(axis=0)) ** 2).sum(axis=1).mean())
    if rest <= NOT_THE_PART * size:
        return
    mirror = np.array([-1.0, 1.0, 1.0])
    turned = rigid_motion(a * mirror, b)
    mirrored = np.sqrt(((b - apply(turned, a * mirror)) ** 2).sum(axis=1).mean())
    what = f"the points lie {rest / MM:.1f} mm (rms) from any place of the part"
    if mirrored <= NOT_THE_PART * size:
        what = "the measured points are those of the mirrored part"
        hint = "an axis has the wrong sign, or two columns are swapped"
    else:
        hint = "other points, another order, or swapped columns"
    raise DataError("MEA016", f"{what}, expected the same points", points.source, hint)


def _explained(chi: float, freedom: float) -> bool:
    """Return whether a sum of squares in units of the stated noise looks like it."""
    from scipy.special import chdtrc

    return bool(chdtrc(freedom, chi) > SURE)


def _outliers(
    a: FloatArray, b: FloatArray, weight: FloatArray, *, stated: bool
) -> tuple[IndexArray, bool]:
    """Return the points that the others refute, and whether those agree.

    For every number of outliers the best set is looked for. The set counts that noise makes least
    likely, if it is unlikely enough, if each of its points is, and if no other set of as many does
    nearly as well: then which point is wrong is not known.
    """
    n = len(a)
    everything = _squares(a, b, weight, np.ones((1, n), dtype=np.bool_))[0]
    if stated and _explained(everything, 3.0 * n - 6.0):
        return np.zeros(0, dtype=np.int64), True
    best: tuple[float, IndexArray] = (SURE, np.zeros(0, dtype=np.int64))
    doubt, most = False, 0 if n <= FEWEST else max(1, (n - FEWEST) // 2)
    for m in range(1, most + 1):
        sets = _candidates(a, b, weight, m)
        chi = _squares(a, b, weight, sets)
        order = np.argsort(chi, kind="stable")
        first = sets[order[0]]
        likely = _chance(everything, chi[order[0]], 3.0 * m, n - m, stated) * comb(n, m) * most
        if likely >= best[0]:
            continue
        doubt = True
        if not _alone(chi[order], n - m, stated):
            continue
        out = np.flatnonzero(~first)
        back = np.repeat(first[None], m, axis=0)
        back[np.arange(m), out] = True
        each = [
            _chance(with_it, chi[order[0]], 3.0, n - m, stated) * n
            for with_it in _squares(a, b, weight, back)
        ]
        if max(each) < SURE:
            best = (likely, out)
    kept = np.setdiff1d(np.arange(n), best[1])
    left = _squares(a[kept], b[kept], weight[kept], np.ones((1, len(kept)), dtype=np.bool_))[0]
    if stated:
        return best[1], _explained(left, 3.0 * len(kept) - 6.0)
    return best[1], len(best[1]) > 0 or not doubt


def _chance(more: float, less: float, gained: float, kept: int, stated: bool) -> float:
    """Return the chance that noise makes so much of the sum of squares vanish."""
    from scipy.special import chdtrc, fdtrc

    freedom = 3.0 * kept - 6.0
    if stated and _explained(less, freedom):
        return float(chdtrc(gained, more - less))
    noise = max(less / freedom, np.finfo(np.float64).tiny)
    return float(fdtrc(gained, freedom, (more - less) / gained / noise))


def _alone(chi: FloatArray, kept: int, stated: bool) -> bool:
    """Return whether the best of sets, by rising sums of squares, is clearly better than others."""
    from scipy.special import fdtri

    freedom = 3.0 * kept - 6.0
    if len(chi) < 2:
        return True
    if stated and _explained(float(chi[0]), freedom):
        return not _explained(float(chi[1]), freedom)
    return bool(chi[1] > chi[0] * fdtri(freedom, freedom, 0.95))


def _candidates(a: FloatArray, b: FloatArray, weight: FloatArray, m: int) -> BoolArray:
    """Return sets (k, n) of points that count, without m of them, each once."""
    n = len(a)
    sets = np.ones((min(comb(n, FEWEST), _STARTS), n), dtype=np.bool_)
    sets[:] = False
    for row, triple in enumerate(_triples(n, len(sets))):
        sets[row, triple] = True
    for _ in range(3):  # a triple is drawn to the best set near by
        rest = weight * (_rests(a, b, weight, sets) ** 2).sum(axis=2)
        order = np.argsort(rest, axis=1, kind="stable")
        sets = np.zeros_like(sets)
        np.put_along_axis(sets, order[:, : n - m], values=True, axis=1)
        sets = np.unique(sets, axis=0)
    return sets


def _triples(n: int, most: int) -> Iterator[tuple[int, ...]]:
    """Yield so many triples of n points, evenly taken of all."""
    step = max(1, comb(n, FEWEST) // most)
    yield from islice(combinations(range(n), FEWEST), 0, step * most, step)


def _squares(a: FloatArray, b: FloatArray, weight: FloatArray, sets: BoolArray) -> FloatArray:
    """Return the weighted sum of squares (k,) of each set (k, n) by itself."""
    rest = (_rests(a, b, weight, sets) ** 2).sum(axis=2)
    return np.asarray((sets * weight * rest).sum(axis=1))


def _rests(a: FloatArray, b: FloatArray, weight: FloatArray, sets: BoolArray) -> FloatArray:
    """Return what (k, n, 3) the best motion of each set leaves of all points."""
    w = sets * weight
    w = w / w.sum(axis=1, keepdims=True)
    A, B = a - (w @ a)[:, None], b - (w @ b)[:, None]
    u, _, vt = np.linalg.svd(np.einsum("kn,kni,knj->kij", w, B, A))
    u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
    return np.asarray(B - A @ (u @ vt).swapaxes(1, 2))
