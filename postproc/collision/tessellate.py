"""STEP to triangles [m], in a process of its own: ``tessellate.py FILE TARGET``."""

from __future__ import annotations

import sys

_CHORD_MM = 0.05
"""How far triangles may leave a curved face, an order below usual clearances."""
_TURN = 0.3
"""Largest angle [rad] between neighbouring triangles of a curved face."""

if __name__ == "__main__":
    import cascadio

    cascadio.step_to_glb(
        sys.argv[1], sys.argv[2], tol_linear=_CHORD_MM, tol_angular=_TURN, use_parallel=False
    )
