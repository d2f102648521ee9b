"""Joint compliance per cell of space: the paper's space gridding, made safe.

Each cell takes the load responses whose tag lies in its closed box, shared corners included
(Jiao et al. 2022, Section 2.2). A cell alone is often too poor for all joints, so every cell
leans on the constant fit by a wide prior and stays within bounds around it; a cell without any
response keeps the constant. A joint that the whole campaign does not show stays out everywhere.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.records import dataclass
from postproc.stiffness.field import Grid, GridField
from postproc.stiffness.identify.cases import LoadCases
from postproc.stiffness.identify.constant import ConstantFit
from postproc.stiffness.identify.observability import FINEST

PRIOR_SD = 1.0
"""One sigma of a cell's compliance around the constant one, as a share of it."""
BOUNDS = (0.1, 10.0)
"""A cell's compliance stays between these multiples of the constant one."""
_SWEEPS = 200
_TOLERANCE = 1e-5
"""Tags within this [m] of a face belong to both cells."""


@dataclass(frozen=True, slots=True)
class GridFit:
    """A fitted grid: the field, one sigma per cell and joint, and the cases in each cell.

    sd (cells, 6) [rad/(N*m)], the prior included, NaN where unseen; count (cells,) of cases;
    sigma [m]: scatter that the cells leave.
    """

    field: GridField
    sd: FloatArray
    count: IntArray
    sigma: float


def grid_over(points: FloatArray, edge: float, origin: FloatArray | None = None) -> Grid:
    """Return the cubes of ``edge`` [m] that cover points (n, 3); the box starts at their corner."""
    low = points.min(axis=0) if origin is None else np.asarray(origin, dtype=np.float64)
    span = points.max(axis=0) - low
    counts = np.maximum(np.ceil(span / edge - 1e-3).astype(int), 1)
    return Grid(low, np.full(3, edge), (int(counts[0]), int(counts[1]), int(counts[2])))


def fit_grid(cases: LoadCases, grid: Grid, constant: ConstantFit, blend: bool = True) -> GridFit:
    """Fit every cell.

    Args:
        cases: load responses.
        grid: cells.
        constant: fit over all cells, the prior of each, with the weights of the cases.
        blend: run continuously between cell centres instead of jumping at faces.
    """
    first = _fit_cells(cases, grid, constant, blend, constant.observability.seen)
    use = constant.seen_with(cases, first.sigma)
    if bool(np.all(use == constant.observability.seen)):
        return first
    return _fit_cells(cases, grid, constant, blend, use)


def _fit_cells(
    cases: LoadCases, grid: Grid, constant: ConstantFit, blend: bool, use: BoolArray
) -> GridFit:
    c_ref = np.where(use, constant.centre, 1.0)
    number, row = members(grid, cases.point)
    X = (cases.A * c_ref)[:, :, use] * np.sqrt(constant.weight)[:, None, None]
    y = cases.d * np.sqrt(constant.weight)[:, None]
    size = int(use.sum())
    N = np.zeros((len(grid), size, size))
    b = np.zeros((len(grid), size))
    np.add.at(N, number, np.einsum("nki,nkj->nij", X, X)[row])
    np.add.at(b, number, np.einsum("nki,nk->ni", X, y)[row])
    variance = max(constant.sigma, FINEST) ** 2
    for _ in range(3):
        # the constant fit's scatter holds what the cells explain: take that of the cells instead
        prior = np.eye(size) * variance / PRIOR_SD**2
        ratio = _bounded_quadratic(N + prior, b + np.diag(prior))
        left = (y[row] - np.einsum("nki,ni->nk", X[row], ratio[number])).ravel()
        dof = max(len(left) - len(grid) * size, len(left) // 3, 1)
        variance = min(variance, max(float(left @ left) / dof, FINEST**2))
    c = np.full((len(grid), 6), np.nan)
    c[:, use] = ratio * c_ref[use]
    sd = np.full((len(grid), 6), np.nan)
    spread = np.sqrt(variance * np.diagonal(np.linalg.inv(N + prior), axis1=1, axis2=2))
    sd[:, use] = spread * c_ref[use]
    return GridFit(
        GridField(grid, c, blend),
        sd,
        np.bincount(number, minlength=len(grid)).astype(np.int32),
        float(np.sqrt(variance)),
    )


def members(grid: Grid, points: FloatArray) -> tuple[IntArray, IntArray]:
    """Return (cell, point) pairs: each point with every cell whose closed box holds it.

    Points outside the grid belong to the nearest cell.
    """
    cells, counts = grid.touching(points, _TOLERANCE)
    row, slot = np.nonzero(counts)
    return cells[row, slot], np.asarray(row, dtype=np.int32)


def _bounded_quadratic(N: FloatArray, b: FloatArray) -> FloatArray:
    """Minimise xᵀN x/2 - bᵀx within ``BOUNDS`` for many small N at once, by coordinate descent."""
    x = np.clip(np.linalg.solve(N, b[..., None])[..., 0], *BOUNDS)
    diagonal = np.diagonal(N, axis1=1, axis2=2)
    for _ in range(_SWEEPS):
        before = x.copy()
        for i in range(x.shape[1]):
            gradient = np.einsum("nj,nj->n", N[:, i, :], x) - b[:, i]
            x[:, i] = np.clip(x[:, i] - gradient / diagonal[:, i], *BOUNDS)
        if np.max(np.abs(x - before), initial=0.0) < 1e-9:
            break
    return np.asarray(x)
