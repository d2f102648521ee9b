"""A campaign with its hidden truth, and what is wished of one."""

from __future__ import annotations

from dataclasses import dataclass

from tools.blind.campaign import Plan, Rows
from tools.blind.chain import Array
from tools.blind.robots import RobotClass
from tools.blind.world import Hidden


@dataclass(frozen=True)
class Entry:
    """One hidden effect and why it is there.

    Args:
        role: "planned"; "background" (geometry and registration errors that any campaign has);
            "carrier" (the arm gives under the loads); "known" (the given model has it);
            "setup" (place of the reflector).
    """

    effect: Hidden
    role: str


@dataclass(frozen=True)
class Wish:
    """What a campaign is asked to be; None: as drawn.

    Args:
        kind: of the case; names: hidden effects; sizes: of each, times its usual size.
        rows: (fewest, most); repeats: measured again; marks: further logged columns.
        form: of the readings, a name of ``forms.FORMS``; registered; design: of the poses.
    """

    kind: str
    names: tuple[str, ...] = ()
    sizes: tuple[float, ...] | None = None
    rows: tuple[int, int] | None = None
    repeats: int | None = None
    marks: tuple[str, ...] = ()
    form: str = "xyz"
    registered: bool | None = None
    design: str | None = None


@dataclass(frozen=True)
class Case:
    """A campaign with its hidden truth; see ``draw``."""

    number: int
    kind: str
    robot: RobotClass
    plan: Plan
    rows: Rows
    entries: tuple[Entry, ...]
    sigma: float
    outliers: float
    registered: bool
    dropped: tuple[str, ...]
    stiffness: Array | None
    known: Array | None
    form: str = "xyz"

    @property
    def hidden(self) -> list[Hidden]:
        """Return all effects, whatever their role."""
        return [entry.effect for entry in self.entries]
