"""``postproc plugins``: readers, emitters, effects and objectives."""

from __future__ import annotations

import importlib
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from postproc.cli import common as cli

if TYPE_CHECKING:
    from postproc.registry import PluginInfo, Registry

_REGISTRIES = (
    ("postproc.readers", "READERS"),
    ("postproc.emitters", "EMITTERS"),
    ("postproc.gap", "EFFECTS"),
    ("postproc.planning", "OBJECTIVES"),
    ("postproc.trace", "TRACES"),
    ("postproc.trace", "PATH_EFFECTS"),
)


@cli.command("""
  postproc plugins
  postproc plugins --json
""")
def command(session: cli.Session, /) -> int:
    """List readers, emitters, effects and objectives: name, origin, version.

    Installed packages add their own by the entry-point groups postproc.readers,
    postproc.emitters, postproc.effects and postproc.objectives. One that cannot be used is
    listed with the cause and left out of all work.
    """
    infos = [_judged(info) for place in _REGISTRIES for info in _registry(*place).infos()]
    plugins = [_entry(info) for info in infos]
    session.document({"schema": "postproc.plugins/1", "plugins": plugins})
    rows = [(i.name, i.group, i.origin, i.version, i.problem or "none") for i in infos]
    session.table(("name", "kind", "origin", "version", "problem"), rows)
    for info in infos:
        if info.problem:
            session.say(f"postproc: warning PLG003: {info} cannot be used: {info.problem}")
    return cli.answer(good=True)


def _registry(module: str, name: str) -> Registry[Any]:
    registry: Registry[Any] = getattr(importlib.import_module(module), name)
    return registry


def _judged(info: PluginInfo) -> PluginInfo:
    """Return a part with what forbids its use, although it could be loaded."""
    if info.problem or info.group != "emitters":
        return info
    from postproc.emitters import EMITTERS, is_checkable

    good = is_checkable(EMITTERS.get(info.name))
    return info if good else replace(info, problem="it cannot read back its programs")


def _entry(info: PluginInfo) -> dict[str, Any]:
    return {
        "group": info.group,
        "name": info.name,
        "origin": info.origin,
        "version": info.version,
        "problem": info.problem or None,
    }
