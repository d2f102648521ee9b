"""How sure the fitted numbers are: noise, scatter over the workspace, and what stays unnamed.

The covariance of a fit knows noise only. A formula that is not exact gives other numbers in another
corner of the workspace, and effects too small to be named pull at those that are.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.fit.fit import Fit
from postproc.gap.fit.linear import Subset
from postproc.gap.fit.regression import Regression


def deviations(
    regression: Regression, fit: Fit, keys: Subset, unnamed: Subset
) -> dict[str, FloatArray]:
    """Return the standard deviation (p,) of each effect's numbers, SI.

    The larger of the fit's own and the delete-a-group jackknife over the folds (Efron 1982), and
    beside it how far the numbers move once the effects that were not named are let in.

    Args:
        regression: rows in folds of neighbouring poses, and blocks.
        fit: of ``keys``.
        keys: named blocks.
        unnamed: blocks that the rows call for, too small to be named.
    """
    equations = regression.equations_at(np.arange(len(regression.y)))
    folds = regression.fold_equations()
    inside = (*regression.always, *keys)
    whole = equations.solve(inside)[0]
    among = equations.solve((*inside, *unnamed))[0][: len(whole)]
    parts = np.array([equations.minus(fold).solve(inside)[0] for fold in folds])
    scatter = _jackknife(parts) if len(parts) > 2 else np.zeros(len(whole))
    found = {}
    start = 0
    for key in inside:
        size = regression.block(key).X.shape[2]
        part = slice(start, start + size)
        start = part.stop
        name, typical = regression.name(key), regression.block(key).typical
        own = fit.deviation(name)
        if len(own) == size:
            wide = np.maximum(own, scatter[part] * typical)
            found[name] = np.hypot(wide, (among - whole)[part] * typical)
    return found


def _jackknife(parts: FloatArray) -> FloatArray:
    """Return the deviations (p,) from estimates (k, p) that each leave one group out."""
    k = len(parts)
    square = np.sum((parts - parts.mean(axis=0)) ** 2, axis=0)
    return np.asarray(np.sqrt((k - 1) / k * square))
