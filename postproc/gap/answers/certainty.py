"""How sure a diagnosis is of the tool point at other poses, calibrated on rows left out."""

from __future__ import annotations

import numpy as np

from postproc.gap.answers.diagnose import Diagnosis
from postproc.gap.robot_model import spread_of
from postproc.model import Reach

_SHARE = 0.95
_LEAST_LEFT = 0.25
"""Share of the squared misses of rows left out that is never put down to the numbers alone."""


def reach_of(diagnosis: Diagnosis) -> Reach:
    """Return what a diagnosis says of its own doubt.

    The radius is that which holds 95 % of the rows, each missed by fits without its place and its
    time (Vovk 2005, conformal prediction): whatever the form of what is left.
    """
    problem, kept = diagnosis.problem, diagnosis.kept
    samples = problem.samples.rows(np.flatnonzero(kept))
    missed = diagnosis.held[:, 1]
    spread = spread_of(diagnosis.spread, samples, diagnosis.fit.states, problem.settings)
    square = float(np.mean(missed**2))
    left = float(np.sqrt(max(square - float(np.mean(spread**2)), _LEAST_LEFT * square)))
    ratio = np.sort(missed / np.hypot(left, spread))
    rank = min(int(np.ceil(_SHARE * (len(ratio) + 1))), len(ratio))
    wrench = samples.wrench
    force = 0.0 if wrench is None else float(np.linalg.norm(wrench[:, :3], axis=1).max())
    factor, moved = float(ratio[rank - 1]), diagnosis.total[0]
    return Reach.around(samples.q, force, left, factor, diagnosis.spread, moved)
