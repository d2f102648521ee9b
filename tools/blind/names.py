"""Which names are right for a hidden effect: a table of equals, companions and own names.

An effect beyond the contract's list may stand in the product under a name of its own; then that
name is right. Some effects contain another: varying stiffness is a give under load that varies, so
naming the plain give beside it is no fault; an error of the arm's geometry holds joint offsets and,
where the frame is not registered, moves base and tool. The mean of a creeping or stretched frame is
a frame that is off, and the mean of a growth whose temperature nobody logged is a longer arm.
"""

from __future__ import annotations

from typing import Any

from tools.blind.beyond import BEYOND
from tools.blind.effects import LIBRARY

COMPANIONS: dict[str, tuple[str, ...]] = {
    "variable_stiffness": ("joint_compliance",),
    "hardening": ("joint_compliance",),
    "link_geometry": ("joint_offset", "base_frame", "tool_frame"),
    "joint_offset": ("base_frame", "tool_frame"),
    "tracker_creep": ("base_frame",),
    "sensor_scale": ("base_frame",),
    "tool_frames": ("tool_frame",),
    "pressure_shift": ("tool_frame",),
    "reflector_creep": ("tool_frame",),
    "fixture_frames": ("base_frame",),
    "rail_straightness": ("base_frame",),
    "rail_angle": ("base_frame",),
    "rail_scale": ("base_frame",),
}
"""Names that are no fault beside a hidden effect, and no hit either."""
INSTRUMENT = frozenset({"tracker_creep", "station_bump", "tracker_wander", "reflector_creep"})
"""Effects of one set-up of the instrument: new rows are measured without, and predicted so."""
STATION = INSTRUMENT | {"encoder_slip", "load_creep", "crash"}
"""Effects of one course of time: new rows have others."""
CONTAINED: dict[str, tuple[str, ...]] = {
    "joint_compliance": ("variable_stiffness", "hardening"),
    "joint_offset": ("link_geometry",),
    "link_geometry": ("joint_offset",),
}
"""A hidden effect counts as named by the name of one of these, if that is hidden too."""


def own_names(hidden: str) -> tuple[str, ...]:
    """Return the names under which a hidden effect may be named."""
    return BEYOND[hidden].own_names if hidden in BEYOND else (hidden,)


def rightful(answer: dict[str, Any], weight: str = "true") -> list[dict[str, Any]]:
    """Return the hidden effects of a weight that a library can see, largest first."""
    return [t for t in answer["truth"] if t["weight"] == weight and not t["outside"]]


def classes(answer: dict[str, Any]) -> set[str]:
    """Return what the gap of the hidden outside effects is a function of."""
    return set().union(*(BEYOND[t["name"]].classes for t in outside(answer) if t["name"] in BEYOND))


def hit_by(answer: dict[str, Any], hidden: str) -> set[str]:
    """Return the names that name a hidden effect of the case."""
    names = set(own_names(hidden))
    for other in answer["truth"]:
        if other["name"] in CONTAINED.get(hidden, ()) and other["weight"] != "hidden":
            names |= set(own_names(other["name"]))
    return names


def hits(answer: dict[str, Any]) -> set[str]:
    """Return every name that is right in a case: true effects, and own names of outside ones."""
    names: set[str] = set()
    for t in answer["truth"]:
        if t["outside"]:
            names |= set(BEYOND[t["name"]].own_names) if t["name"] in BEYOND else set()
        elif t["weight"] == "true":
            names |= set(own_names(t["name"]))
    return names


def tolerated(answer: dict[str, Any]) -> set[str]:
    """Return the names that are neither right nor wrong in a case."""
    names: set[str] = set()
    for t in answer["truth"]:
        if t["weight"] == "nuisance" and not t["outside"]:
            names |= set(own_names(t["name"]))
        if t["weight"] in ("true", "nuisance"):
            names |= set(COMPANIONS.get(t["name"], ()))
        if t["outside"] and t["name"] == "thermal_drift":
            names |= {"link_geometry", *COMPANIONS["link_geometry"]}
    if answer["registered"]:
        names -= {"base_frame", "tool_frame"}
    return names - hits(answer)


def beside(hidden: str) -> set[str]:
    """Return the names that a hidden effect moves along, so that their order says nothing."""
    return set(COMPANIONS.get(hidden, ()))


def outside(answer: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the hidden effects that no library can name, or only by an own name."""
    return [t for t in answer["truth"] if t["outside"]]


ALL = tuple(LIBRARY)
