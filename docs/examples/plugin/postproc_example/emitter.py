"""An emitter: a plain list of joint angles, one motion a line.

What an emitter owes: the same plan gives the same bytes, nothing is written to disk, and what the
target cannot do is refused by name, never left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from postproc.errors import EmitError, SourceRef
from postproc.units import DEG

if TYPE_CHECKING:
    from postproc.cell.cell import Cell
    from postproc.krl.text.names import NameAllocator
    from postproc.model.plan import Plan


def joint_list(plan: Plan, cell: Cell, names: NameAllocator | None = None) -> Mapping[str, bytes]:
    """Return ``NAME.txt`` with A1..A6 [deg] of every motion.

    Raises:
        EmitError: EXM001 if the plan moves external axes.
    """
    del cell
    if plan.external.shape[1]:
        raise EmitError("EXM001", "no external axes in a joint list", SourceRef(plan.toolpath.path))
    name = plan.name if names is None else names.allocate(plan.name, ())
    lines = [" ".join(f"{angle / DEG:z.5f}" for angle in q) for q in plan.q]
    return {f"{name}.txt": ("\n".join(lines) + "\n").encode("ascii")}
