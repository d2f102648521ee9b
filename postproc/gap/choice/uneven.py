"""Names whose strength differs from reading to reading by nothing that was logged.

An effect that follows what was logged (a load, the side of the last motion) brings to a row what
its formula says, and what is left is as large along that as across it. Friction that fades while
the arm stands, or a load that was not the one noted, brings it in full at one row and in part at
the next: no column shows that, but what is left then lies along the effect, and the more the larger
the effect is.
"""

from __future__ import annotations

import numpy as np

from postproc.gap.choice.classes import Part
from postproc.gap.choice.standing import Choice
from postproc.gap.fit import Regression, design_matrix

_LEAST = 0.15
"""Standard deviation of the strength from which it is told, relative: true causes of blind
campaigns had 0.04 at most, winding up that faded unlogged 0.25 and 0.41."""
_CLEAR = 3.0
"""So many standard deviations it is above none."""
_NOTHING = 1e-12
_SHAPE = "differs from reading to reading"


def uneven(regression: Regression, choice: Choice) -> tuple[Part, ...]:
    """Return what unevenly strong names leave, as parts of their class.

    Args:
        regression: rows and blocks.
        choice: what stands.
    """
    keys = (*regression.always, *choice.model)
    use = np.flatnonzero(regression.weight > 0)
    theta = regression.equations_at(np.arange(len(regression.y))).numbers(keys)
    blocks = [regression.block(key).rows(use) for key in keys]
    rest = regression.y[use] - design_matrix(blocks, len(use)) @ theta
    found = []
    starts = np.cumsum([0, *(block.X.shape[2] for block in blocks)])
    for key, block, start in zip(keys, blocks, starts, strict=False):
        effect = block.effect
        if key not in choice.adopted or not effect.needs or not effect.classes:
            continue
        moved = block.X @ theta[start : start + block.X.shape[2]]
        size = np.linalg.norm(moved, axis=1)
        along = np.einsum("ni,ni->n", rest, moved / np.maximum(size, _NOTHING)[:, None])
        across = 0.5 * (np.sum(rest**2, axis=1) - along**2)
        more = size**2 * (along**2 - across)
        clear = float(np.sum(more)) > _CLEAR * float(np.linalg.norm(more))
        varies = np.sqrt(max(float(np.sum(more)), 0.0) / max(float(np.sum(size**4)), _NOTHING**4))
        if clear and varies > _LEAST:
            rms = float(varies * np.sqrt(np.mean(size**2)))
            found.append(Part(min(effect.classes), effect.name, _SHAPE, rms, float("nan")))
    return tuple(found)
