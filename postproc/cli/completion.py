"""Shell completion of names: robots, parts that can be plugged in, finding codes and effects."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable

import click

Complete = Callable[[click.Context, click.Parameter, str], list[str]]


def robots(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Return the built-in robots whose name begins so."""
    from postproc.cell import robot_names

    return _beginning(robot_names(), incomplete)


def explained(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Return the finding codes and effects that begin so, codes in any case."""
    from postproc.codes import groups

    codes = [entry.code for group in groups() for entry in group.entries]
    found = _beginning(codes, incomplete.upper()) + _beginning(codes, incomplete)
    return list(dict.fromkeys([*found, *_beginning(_names("postproc.gap", "EFFECTS"), incomplete)]))


def parts(room: str, registry: str, *more: str) -> Complete:
    """Return the completion of an option that names a part of a registry.

    Args:
        room: package that holds the registry.
        registry: its name there.
        more: further names that the option takes.
    """

    def complete(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
        return _beginning([*more, *_names(room, registry)], incomplete)

    return complete


def _names(room: str, registry: str) -> list[str]:
    return [name for name, _ in getattr(importlib.import_module(room), registry)]


def _beginning(names: Iterable[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]
