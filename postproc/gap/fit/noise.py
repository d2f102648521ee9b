"""What no model can explain: noise from pure repeats, or estimated; and measuring faults."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.gap.data import Samples
from postproc.gap.fit.linear import Block, design_matrix
from postproc.measurement import robust_sigma
from postproc.units import DEG

_SAME_POSE = 1e-3 * DEG
_OUTLIER = 5.5
"""Residual norm over sigma: chi-squared of 3 passes 30 once in 700,000 rows of noise."""
_MOST_OUTLIERS = 0.06


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviation per axis [m] and what it rests on.

    ``freedom``: degrees of freedom of the repeats, 0 if there are none (then it is estimated).
    """

    sigma: float
    freedom: int
    repeats: int

    @property
    def measured(self) -> bool:
        """Whether it comes from repeats."""
        return self.freedom >= 9


def repeats(
    samples: Samples,
    y: FloatArray,
    usable: BoolArray | None = None,
    hat_root: FloatArray | None = None,
) -> Noise:
    """Return the noise of rows that were measured again under the same conditions.

    A repeat from another side, at another load, speed or temperature (by more than 0.3 K) is not
    pure and does not count. A group whose spread is far beyond the usual one holds a fault and is
    judged by its median spread.

    Args:
        samples: rows.
        y: (n, 3) gap [m].
        usable: (n,) rows that are no faults.
        hat_root: (n, 3, p) of the fit whose residuals ``y`` are. Then other temperatures count
            too, which the fit of temperature and time has taken out, and what that fit took of
            the differences between repeats is no freedom of theirs.
    """
    keys = _conditions(samples, hat_root is not None)
    groups: dict[bytes, list[int]] = {}
    for row, key in enumerate(keys):
        if usable is None or usable[row]:
            groups.setdefault(key.tobytes(), []).append(row)
    sums, freedom, spread = [], [], []
    for rows in groups.values():
        if len(rows) > 1:
            values = y[rows]
            square = float(np.sum((values - values.mean(axis=0)) ** 2))
            sums.append(square)
            freedom.append(3.0 * (len(rows) - 1) - _taken(hat_root, rows))
            spread.append(square / freedom[-1])
    if not sums:
        return Noise(float("nan"), 0, 0)
    limit = 9.0 * float(np.median(spread))
    kept = [k for k, value in enumerate(spread) if value <= limit]
    total = sum(freedom[k] for k in kept)
    sigma = float(np.sqrt(sum(sums[k] for k in kept) / total))
    return Noise(sigma, int(total), int(total) // 3)


def _taken(hat_root: FloatArray | None, rows: Sequence[int]) -> float:
    """Return the degrees of freedom that a fit took of the differences between some rows."""
    if hat_root is None:
        return 0.0
    part = hat_root[rows]
    return float(np.sum((part - part.mean(axis=0)) ** 2))


def _conditions(samples: Samples, warm: bool) -> FloatArray:
    """Return one rounded row of conditions per measurement."""
    parts = [np.round(samples.q / _SAME_POSE)]
    if samples.direction is not None:
        parts.append(samples.direction)
    if samples.wrench is not None:
        parts.append(np.round(samples.wrench / 5.0))
    if samples.qd is not None:
        parts.append(np.round(samples.qd / (0.1 * DEG)))
    if samples.temperature is not None and not warm:
        parts.append(np.round(samples.temperature[:, None] / 0.3))
    return np.ascontiguousarray(np.concatenate(parts, axis=1) + 0.0)


@dataclass(frozen=True, slots=True)
class Saturated:
    """What is left when every candidate is fitted at once.

    residual: (n, 3) [m] of a leave-one-out prediction, in the scale of the noise; raw: (n, 3) [m]
    as the fit leaves it; hat_root: (n, 3, p) whose products are the hat matrix; sigma [m] per
    axis; freedom: degrees of freedom left; outlier: (n,) rows that are faults.
    """

    residual: FloatArray
    raw: FloatArray
    hat_root: FloatArray
    sigma: float
    freedom: float
    outlier: BoolArray


def saturated(blocks: Sequence[Block], y: FloatArray, sigma: float, rounds: int = 6) -> Saturated:
    """Fit all blocks together with their priors, again and again, setting faults aside.

    Rows are judged only here, with every candidate in the model, by the error of predicting each
    row from the others: a row is never thrown away because the right effect was missing.

    Args:
        blocks: all candidates, library and alternatives.
        y: (n, 3) gap [m].
        sigma: first guess of the noise [m] per axis.
        rounds: most fits.
    """
    n = len(y)
    X = design_matrix(blocks, n)
    use = np.ones(n, dtype=bool)
    result = Saturated(y, y, X[:, :, :0], sigma, 3.0 * n, ~use)
    for _ in range(rounds):
        A = X[use].reshape(-1, X.shape[2])
        inverse = np.linalg.inv(A.T @ A + sigma**2 * np.eye(X.shape[2]))
        theta = inverse @ (A.T @ y[use].ravel())
        raw = y - X @ theta
        root = X @ np.linalg.cholesky(inverse)
        hat = np.einsum("nip,njp->nij", root, root)
        freedom = 3.0 * use.sum() - float(np.einsum("nii->", hat[use]))
        free = np.eye(3) - hat * use[:, None, None]
        free[~use] = np.eye(3) + hat[~use]
        out = _whitened(raw, free)
        norm = np.linalg.norm(out, axis=1)
        robust = robust_sigma(norm[use])
        new_sigma = float(np.sqrt(np.sum(raw[use] ** 2) / max(freedom, 1.0)))
        limit = _OUTLIER * max(min(robust, new_sigma), 1e-9)
        bad = norm > limit
        if bad.sum() > _MOST_OUTLIERS * n:
            bad = norm > np.sort(norm)[-int(_MOST_OUTLIERS * n) - 1]
        result = Saturated(out, raw, root, new_sigma, freedom, bad)
        settled = bool(np.array_equal(bad, ~use)) and abs(new_sigma / sigma - 1.0) < 0.02
        use, sigma = ~bad, new_sigma
        if settled:
            break
    return result


def _whitened(raw: FloatArray, free: FloatArray) -> FloatArray:
    """Return residuals (n, 3) divided by the root of the share (n, 3, 3) the fit left free."""
    values, vectors = np.linalg.eigh(0.5 * (free + np.swapaxes(free, 1, 2)))
    values = np.maximum(values, 0.02)
    local = np.einsum("nji,nj->ni", vectors, raw) / np.sqrt(values)
    return np.asarray(np.einsum("nij,nj->ni", vectors, local))
