"""Points and form data in the .dat file, named so that the pad can edit them.

A point ``P1`` owns ``XP1`` (its position) and, in a form, ``FP1`` (tool and base); motion data are
``PPDAT1`` and ``LCPDAT1``. The prefix counts in the 24 characters, so a point has at most 23.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field

from postproc import krl
from postproc.records import dataclass

StatusTurn = Callable[[int], tuple[int, int]]
"""Move index to S and T."""
FrameNumbers = Callable[[int], tuple[int, int]]
"""Move index to the numbers of tool and base."""
NO_APPROXIMATION_MM = 100.0
"""APO_DIST of a form without CONT: what the pad itself writes; it is not used then."""


@dataclass(slots=True)
class PointStore:
    """The data list of one file as it grows.

    Args:
        status_turn: S and T of the posture in which a move ends.
        point_name: the CAM system's name of the point a move goes to, empty without one; None
            where the CAM file names no points.
        numbers: of tool and base of a move, for FDAT.
    """

    status_turn: StatusTurn
    point_name: Callable[[int], str] | None
    numbers: FrameNumbers
    declarations: list[krl.Statement] = field(default_factory=list)
    _names: krl.NameAllocator = field(default_factory=krl.NameAllocator)
    _motion_data: dict[tuple[str, krl.Value], str] = field(default_factory=dict)
    _count: int = 0

    def add(self, index: int, target: krl.Pose | krl.Axes) -> krl.Expr:
        """Put a target into the data list and return it by name; a pose gets status and turn."""
        return krl.Expr(f"X{self._point(index, target)}")

    def form_point(self, index: int, target: krl.Pose) -> str:
        """Put the point of a form with its tool and base into the list; return it without X."""
        name = self._point(index, target)
        tool, base = self.numbers(index)
        frames = (
            ("TOOL_NO", tool),
            ("BASE_NO", base),
            ("IPO_FRAME", krl.Enum("BASE")),
            ("POINT2[]", krl.Text(" ")),
        )
        self._declare("FDAT", f"F{name}", krl.Aggregate(frames))
        return name

    def ptp_data(self, percent: float) -> str:
        """Return the name (without P) of motion data for this axis speed [%]."""
        data = (
            ("VEL", percent),
            ("ACC", 100.0),
            ("APO_DIST", NO_APPROXIMATION_MM),
            ("APO_MODE", krl.Enum("CPTP")),
            ("GEAR_JERK", 50.0),
            ("EXAX_IGN", 0),
        )
        return self._data("PDAT", "P", "PDAT", krl.Aggregate(data))

    def cp_data(self, speed_m_s: float, blend_mm: float) -> str:
        """Return the name (without L) of motion data for this speed [m/s] and approximation."""
        data = (
            ("VEL", speed_m_s),
            ("ACC", 100.0),
            ("APO_DIST", blend_mm if blend_mm > 0.0 else NO_APPROXIMATION_MM),
            ("APO_FAC", 50.0),
            ("AXIS_VEL", 100.0),
            ("AXIS_ACC", 100.0),
            ("ORI_TYP", krl.Enum("VAR")),
            ("CIRC_TYP", krl.Enum("BASE")),
            ("JERK_FAC", 50.0),
            ("GEAR_JERK", 50.0),
            ("EXAX_IGN", 0),
        )
        return self._data("LDAT", "L", "CPDAT", krl.Aggregate(data))

    def _point(self, index: int, target: krl.Pose | krl.Axes) -> str:
        self._count += 1
        name = f"P{self._count}"
        if self.point_name is not None:
            wanted = self.point_name(index) or name
            name = self._names.allocate(wanted, prefix="X", fallback="P")
        if isinstance(target, krl.Pose):
            status, turn = self.status_turn(index)
            t = target  # not dataclasses.replace: there may be a hundred thousand of them
            full = krl.Pose(
                t.x_mm, t.y_mm, t.z_mm, t.a_deg, t.b_deg, t.c_deg, status, turn, t.external
            )
            self._declare("E6POS", f"X{name}", full)
        else:
            self._declare("E6AXIS", f"X{name}", target)
        return name

    def _data(self, type_name: str, prefix: str, stem: str, value: krl.Aggregate) -> str:
        key = (type_name, value)
        if key not in self._motion_data:
            number = sum(known == type_name for known, _ in self._motion_data) + 1
            self._motion_data[key] = f"{stem}{number}"
            self._declare(type_name, f"{prefix}{stem}{number}", value)
        return self._motion_data[key]

    def _declare(self, type_name: str, name: str, value: krl.Value) -> None:
        self.declarations.append(krl.Declaration(type_name, (krl.Variable(name, None, value),)))
