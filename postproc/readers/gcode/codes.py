"""Every G and M code that the reader knows: what becomes of it.

Sources: Fanuc series 30i operator's manual (B-63944EN), LinuxCNC G-code reference, NIST RS274/NGC
version 3 (Kramer, Proctor, Messina 2000), public posts of Autodesk, Mastercam and FreeCAD.
"""

from __future__ import annotations

from postproc.model import WordClass
from postproc.records import dataclass

GROUPS = {
    "motion": "0 1 2 3 73 74 81 82 83 84 85 86 89",
    "plane": "17 18 19",
    "units": "20 21 70 71",
    "distance": "90 91",
    "centre": "90.1 91.1",
    "feed": "94 95",
    "retract": "98 99",
    "base": "54 55 56 57 58 59 54.1 59.1 59.2 59.3",
    "path": "61 64",
}
"""Codes that hold until another of their group comes."""
GROUP_OF = {f"G{code}": group for group, codes in GROUPS.items() for code in codes.split()}
ONCE = frozenset(["G4", "G9", "G28", "G30", "G53", "G43", "G43.4", "G49", "G80"])
"""Codes that act in their block, end a cycle, or take the tool's length, which the cell knows."""
CYCLES = frozenset(f"G{code}" for code in (73, 74, 81, 82, 83, 84, 85, 86, 89))
EXECUTED_M = frozenset(
    ["M0", "M1", "M2", "M3", "M4", "M5", "M6", "M7", "M8", "M9", "M30", "M98", "M99"]
)
HARMLESS = frozenset(
    # cancels of what is refused while it holds; exact path control; feed and speed overrides
    ["G15", "G40", "G50.1", "G69", "G97", "G5.1", "M29", "M48", "M49", "G187"]
)
"""Codes that change nothing here: cancels of what is refused, and look-ahead of the control."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a code stops the job, and what it can change."""

    word_class: WordClass
    reason: str


_REFUSED = {
    (WordClass.GEOMETRY, "cutter compensation: the points are the contour, not the tool path"): (
        "G41 G42 G41.1 G42.1 G41.2 G42.2 G41.3"
    ),
    (WordClass.GEOMETRY, "polar coordinates"): "G16 G12.1 G13.1 G112 G113",
    (WordClass.GEOMETRY, "scaling or mirroring"): "G50 G51 G51.1",
    (WordClass.GEOMETRY, "a circular pocket of the control"): "G12 G13",
    (WordClass.GEOMETRY, "a spline or curve of the control"): "G5 G5.2 G5.3 G6.2",
    (WordClass.GEOMETRY, "a hole cycle that moves off the wall or works on its way out"): (
        "G76 G87 G88"
    ),
    (WordClass.GEOMETRY, "probing: where it stops is not in the file"): (
        "G31 G36 G37 G38.2 G38.3 G38.4 G38.5"
    ),
    (WordClass.GEOMETRY, "threading or turning"): "G32 G33 G33.1 G34 G7",
    (WordClass.COORDINATES, "turns the coordinates"): "G68 G68.1 G68.2 G68.3 G68.4 G53.1",
    (WordClass.COORDINATES, "shifts the coordinates by values that only the control knows"): (
        "G10 G52 G92 G92.1 G92.2 G92.3 G43.1 G43.2 G44 G43.5 G45 G46 G47 G48"
    ),
    (WordClass.PROCESS, "feed by inverse time"): "G93",
    (WordClass.PROCESS, "constant surface speed"): "G96",
    (WordClass.PROCESS, "stops the spindle at an angle, for which only a bore has a hook"): "M19",
    (WordClass.PROCESS, "changes a pallet"): "M60",
    (WordClass.PROCESS, "clamps or unclamps, for which there is no hook"): "M10 M11",
    (WordClass.TOOL, "gives the tool in the spindle another number"): "M61",
    (WordClass.GEOMETRY, "calls another program or block of the control"): "M96 M97 G65 G66 G67",
}
REFUSED = {code: Refusal(*why) for why, codes in _REFUSED.items() for code in codes.split()}
UNKNOWN = Refusal(WordClass.UNKNOWN, "is in no table of codes")


def refusal(code: str) -> Refusal:
    """Return why a code that is neither executed nor harmless stops the job."""
    return REFUSED.get(code, UNKNOWN)


def is_executed(code: str) -> bool:
    """Return whether the reader carries a code out."""
    return code in GROUP_OF or code in ONCE or code in EXECUTED_M
