"""What an emitter is: a plan and its cell in, the program of one controller out, and back again.

An emitter is found by its name. A foreign package offers one by the entry-point group
``postproc.emitters``. Contract: the same plan and cell give the same bytes; the plan is not
changed; what the controller cannot do is refused by name with ``EmitError``, never left out;
nothing is written to disk. No program lands that was not read back: an emitter says what the
motions of its own text are, and these are compared with the plan.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import TYPE_CHECKING

from postproc.arrays import FloatArray, IntArray, frozen_floats, frozen_ints
from postproc.errors import Finding
from postproc.records import dataclass
from postproc.registry import Registry

if TYPE_CHECKING:
    from postproc.cell import Cell
    from postproc.kinematics import Kinematics
    from postproc.model import Plan, ToolPath
    from postproc.paths import Displacement, Paths
    from postproc.verification import Expectation


@dataclass(frozen=True, slots=True)
class Program:
    """What an emitter wrote.

    Args:
        name: of the program to start, as the controller sees it.
        files: content by file name, the file to start first.
        renamed: names asked for and what became of them, where that is another one.
    """

    name: str
    files: Mapping[str, bytes]
    renamed: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Against:
    """What a text has to do beyond the plan's motions.

    Args:
        toolpath: CAM points that must be served; None where only some are.
        displacement: of the real tool against the commanded one, where the plan is compensated:
            the real tool is what must serve the points.
    """

    toolpath: ToolPath | None = None
    displacement: Displacement | None = None


@dataclass(frozen=True, slots=True)
class ReadBack:
    """The m motions that a program's text says, in the order in which they are run.

    Args:
        kind: (m,) ``MoveKind``.
        q: (m, 6) joint angles at the end of each motion [rad].
        aux: (m, 3) point on the way of an arc [m], workpiece frame, NaN for other motions; None
            if there is no arc.
        external: (m, k) external axes [m or rad]; None if there is none.
        speed: (m,) path speed [m/s], NaN where the text says none; None if it never does.
        point: (m, 3) TCP at the end [m], workpiece frame, for a page that shows the text.
        file: (m,) row of ``files``; line: (m,) 1-based line; None if a motion has no place.
        files: names of the files in which motions stand.
        findings: what else is wrong with the text; an error forbids the program.
        expectation: where the real tool is against the CAM points, if that was asked for.
    """

    kind: IntArray
    q: FloatArray
    aux: FloatArray | None = None
    external: FloatArray | None = None
    speed: FloatArray | None = None
    point: FloatArray | None = None
    file: IntArray | None = None
    line: IntArray | None = None
    files: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = field(default=())
    expectation: Expectation | None = None

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_ints(self, "kind", (None,))
        m = len(self.kind)
        frozen_floats(self, "q", (m, 6))
        frozen_floats(self, "aux", (m, 3))
        frozen_floats(self, "external", (m, None))
        frozen_floats(self, "speed", (m,))
        frozen_floats(self, "point", (m, 3))
        for name in ("file", "line"):
            if getattr(self, name) is not None:
                frozen_ints(self, name, (m,))

    def __len__(self) -> int:
        """Return the number of motions."""
        return len(self.kind)


class Emitter(ABC):
    """Writes the programs of one kind of controller and reads them back."""

    @abstractmethod
    def emit(self, plan: Plan, cell: Cell) -> Program:
        """Return the program of a plan.

        Args:
            plan: moves without an error among its findings, unless only a part was asked for.
            cell: the cell the plan was made for.

        Raises:
            EmitError: if the plan cannot be expressed.
        """

    def read_back(self, program: Program, cell: Cell, against: Against) -> ReadBack | None:
        """Return what the text of a program says, found from nothing but the text.

        An emitter that gives None here writes nothing: its programs cannot be checked.
        """
        del program, cell, against
        return None

    def paths(self, plan: Plan, cell: Cell, kinematics: Kinematics) -> Paths | None:
        """Return how the joints move when the program of a plan is run, None if that is unknown.

        Without it effects that follow the motion cannot be compensated.
        """
        del plan, cell, kinematics
        return None

    def caller(self, name: str, programs: Sequence[str]) -> Program | None:
        """Return a program that runs others in order; None if the controller has no such thing."""
        del name, programs
        return None


EMITTERS: Registry[Emitter] = Registry("emitters", "postproc.emitters", Emitter)
"""All emitters by name."""
