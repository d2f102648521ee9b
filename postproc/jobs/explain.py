"""What a finding code, a kind of violation, an effect or a word that commands print means."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

from postproc.codes import Entry, find, nearest
from postproc.errors import UsageError
from postproc.records import dataclass
from postproc.resources import glossary_file
from postproc.units import DEG, MM

if TYPE_CHECKING:
    from postproc.cell import Cell
    from postproc.verification import Tolerances

_ROW = re.compile(r"\| \*\*(?P<words>.+?)\*\* \| (?P<meaning>.+) \|")
_LINK = re.compile(r"\[([^]]+)\]\([^)]+\)")


def explain(code: str) -> Entry:
    """Return what a finding code, a kind of violation, an effect of a diagnosis or a word means.

    Args:
        code: such as ``PLN101``, ``joint_limit``, the name of an effect.

    Returns:
        ``title``, ``cause``, ``remedy``, ``severity``.

    Raises:
        UsageError: CLI014 if nothing has this name.
    """
    code = code.strip()
    word = " ".join(code.lower().replace("_", " ").split())
    entry = find(code.upper()) or find(code.lower()) or entry_of(code) or _effect(code.lower())
    entry = entry or glossary().get(word) or glossary().get(word.removesuffix("s"))
    if entry is None:
        near = ", ".join(nearest(code.upper()))
        raise UsageError(
            "CLI014",
            f"no finding or word is called {code!r}"
            + (f", the nearest are {near}" if near else ""),
            hint="postproc explain lists all codes",
        )
    return entry


@cache
def glossary() -> dict[str, Entry]:
    """Return the words of the glossary: its row is the title, there is nothing to remedy."""
    found = {}
    for line in glossary_file().read_text(encoding="utf-8").splitlines():
        if row := _ROW.fullmatch(line):
            meaning = _LINK.sub(r"\1", row["meaning"]).replace("`", "")
            for word in row["words"].split(", "):
                found[word.lower().replace("_", " ")] = Entry(word, meaning, "", "")
    return found


def _effect(name: str) -> Entry | None:
    """Return what an effect of a diagnosis is, as an entry; None if none has this name."""
    from postproc.gap import EFFECTS

    if name not in EFFECTS:
        return None
    effect = EFFECTS.get(name)
    text = f"an effect that diagnose tries: {effect.source}"
    return Entry(name, effect.title, text, effect.action)


def explain_document(entry: Entry) -> dict[str, Any]:
    """Return the ``postproc.explain/1`` document of one entry."""
    return {
        "schema": "postproc.explain/1",
        "code": entry.code,
        "severity": entry.severity,
        "title": entry.title,
        "cause": entry.cause,
        "remedy": entry.remedy,
    }


Allowed = Callable[["Cell", "Tolerances"], str]


@dataclass(frozen=True, slots=True)
class Measure:
    """One measure: what it is, what lowers it, and what is allowed, in the unit of the measure.

    ``kind``: the violation that is reported where more than that is measured, empty without one.
    """

    title: str
    remedy: str
    allowed: Allowed
    kind: str = ""


MEASURES = {
    "position": Measure(
        "distance of a CAM point from where the tool point passes it",
        "Correct the motion at the line; --tol-mm sets what is allowed.",
        lambda _, tolerances: f"<= {tolerances.position / MM:g}",
        "position",
    ),
    "axis": Measure(
        "angle of the tool axis at a CAM point beyond the tilt that the cell allows",
        "Correct the orientation at the line; --tol-deg sets what is allowed.",
        lambda _, tolerances: f"<= {tolerances.axis / DEG:g}",
        "axis",
    ),
    "path": Measure(
        "distance of the tool point from lines and arcs of the CAM file between its points",
        "Bring the points of the program closer together; [motion] chord_mm sets what is allowed.",
        lambda cell, tolerances: f"<= {(tolerances.path or cell.motion.chord) / MM:g}",
        "path",
    ),
    "tilt": Measure(
        "angle by which the tool is tilted against the CAM file on purpose",
        "Allow less with lead_deg and side_tilt_deg in [optimize].",
        lambda *_: "lead_deg, side_tilt_deg",
    ),
    "feed": Measure(
        "deviation of the programmed path speed from the feed of the CAM file",
        "Write the feed of the CAM file at the line.",
        lambda *_: "<= 0.1",
        "feed",
    ),
    "corner_rounding": Measure(
        "distance by which blending passes a corner of a cut",
        "Lower [motion] approximation_mm, or allow more with corner_tolerance_mm.",
        lambda cell, _: f"<= {cell.motion.corner_tolerance / MM:g} in cuts",
        "corner",
    ),
    "torque": Measure(
        "share of what a joint can give that weight, motion and process need",
        "Lower accelerations and speeds there, or take a lighter tool.",
        lambda *_: "<= 100",
        "torque",
    ),
    "torque_time": Measure(
        "time that the program takes longer because joints give no more torque",
        "None is needed: it is part of the estimated time.",
        lambda *_: "-",
    ),
    "joint_margin": Measure(
        "smallest distance of a joint from its soft limit",
        "Take another pose of the arm; [limits] joint_margin_deg sets what is asked.",
        lambda cell, _: f">= {cell.limits.joint_margin / DEG:g}",
        "joint_limit",
    ),
    "wrist_singularity": Measure(
        "smallest |A5| on a path: at 0 the wrist is straight and A4, A6 may turn at any speed",
        "Take another spin or pose; [limits] singularity_deg sets what is asked.",
        lambda cell, _: f">= {cell.limits.singularity / DEG:g}",
        "singularity",
    ),
    "stretched_arm": Measure(
        "smallest angle between upper arm and forearm and the stretched arm",
        "Move the part nearer; below what is asked there is a warning.",
        lambda *_: ">= 3 (warning)",
        "stretched",
    ),
    "wrist_over_A1": Measure(
        "smallest distance of the wrist centre from axis 1, above which A1 may turn at any speed",
        "Move the part away from axis 1; below what is asked there is a warning.",
        lambda *_: ">= 50 (warning)",
        "overhead",
    ),
    "axis_speed": Measure(
        "largest share of its speed that an axis needs at the programmed path speed",
        "Lower the speed there, or take another pose; above it the controller slows down.",
        lambda *_: "<= 100 in cuts",
        "axis_speed",
    ),
}
"""Every measure by its name in ``verify``; a numeric limit that no key sets is the check's own."""
_OF_AXIS = "speed_"


def measure_named(name: str) -> Measure | None:
    """Return a measure; each axis has one of its own where external axes move: ``speed_E1``."""
    return MEASURES.get("axis_speed" if name.startswith(_OF_AXIS) else name)


def entry_of(name: str) -> Entry | None:
    """Return what a measure is, for ``explain``."""
    found = measure_named(name)
    if found is None:
        return None
    more = f" Beyond what is allowed it is the violation {found.kind}." if found.kind else ""
    cause = f"A measure of verify, given with its worst value and the line where it is.{more}"
    return Entry(name, f"{found.title[:1].upper()}{found.title[1:]}", cause, found.remedy)
