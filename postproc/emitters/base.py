"""What an emitter is: a plan and its cell in, the files of one controller out.

An emitter is found by its name. A foreign package offers one by the entry-point group
``postproc.emitters``. Contract: the same plan, cell and names give the same bytes; the plan is not
changed; what the controller cannot do is refused by name with ``EmitError``, never left out;
nothing is written to disk.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Protocol

from postproc.registry import Registry

if TYPE_CHECKING:
    from postproc.cell import Cell
    from postproc.krl import NameAllocator
    from postproc.model import Plan


class Emitter(Protocol):
    """Writes the programs of one kind of controller."""

    def __call__(
        self, plan: Plan, cell: Cell, names: NameAllocator | None = None
    ) -> Mapping[str, bytes]:
        """Return file name -> content; the first file is the one to start.

        Args:
            plan: moves without an error among its findings, unless only a part was asked for.
            cell: the cell the plan was made for.
            names: gives program names that are unique in a batch; None for a single program.

        Raises:
            EmitError: if the plan cannot be expressed.
        """
        ...


EMITTERS: Registry[Emitter] = Registry("emitters", "postproc.emitters")
"""All emitters by name."""
