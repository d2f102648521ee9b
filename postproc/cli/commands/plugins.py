"""``postproc plugins``: readers, emitters, effects and objectives."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

import click

from postproc.cli.common import Session, answer, standard_options

if TYPE_CHECKING:
    from postproc.registry import PluginInfo, Registry

EPILOG = """\b
Examples:
  postproc plugins
  postproc plugins --json
"""
_REGISTRIES = (
    ("postproc.readers", "READERS"),
    ("postproc.emitters", "EMITTERS"),
    ("postproc.gap", "EFFECTS"),
    ("postproc.planning", "OBJECTIVES"),
)


@click.command(epilog=EPILOG)
@standard_options
def command(session: Session, /) -> int:
    """List readers, emitters, effects and objectives: name, origin, version.

    Installed packages add their own by the entry-point groups postproc.readers,
    postproc.emitters, postproc.effects and postproc.objectives. One that cannot be loaded is
    listed with the cause and left out of all work.
    """
    infos = [info for place in _REGISTRIES for info in _registry(*place).infos()]
    plugins = [_entry(info) for info in infos]
    session.document({"schema": "postproc.plugins/1", "plugins": plugins})
    rows = [(i.group, i.name, i.origin, i.version, _state(i)) for i in infos]
    session.table(("kind", "name", "origin", "version", "state"), rows)
    for info in infos:
        if info.problem:
            name = f"{info.group} part {info.name!r} of {info.origin} {info.version}"
            session.say(f"postproc: warning PLG003: {name} cannot be loaded: {info.problem}")
    return answer(good=True)


def _registry(module: str, name: str) -> Registry[Any]:
    registry: Registry[Any] = getattr(importlib.import_module(module), name)
    return registry


def _state(info: PluginInfo) -> str:
    return "cannot be loaded" if info.problem else "good"


def _entry(info: PluginInfo) -> dict[str, Any]:
    return {
        "group": info.group,
        "name": info.name,
        "origin": info.origin,
        "version": info.version,
        "problem": info.problem or None,
    }
