"""One registry for everything that can be plugged in: readers, emitters, effects, objectives.

Built-in parts register by a decorator and are found by importing every module of their
folder; foreign parts come by the entry-point groups ``postproc.readers``, ``postproc.emitters``,
``postproc.effects`` and ``postproc.objectives``. A plug-in that fails to import is reported with
its name and cause and left out; it never stops the product and is never silent.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Generic, TypeVar

from postproc.errors import PluginError

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class PluginInfo:
    """Where a registered part comes from."""

    group: str
    name: str
    origin: str
    version: str
    problem: str = ""


class Registry(Generic[T]):
    """Parts of one kind by name; a second part of the same name is an error.

    Args:
        group: ``readers``, ``emitters``, ``effects`` or ``objectives``; the entry-point group is
            ``postproc.<group>``.
        package: dotted name of the package whose modules hold the built-in parts.
    """

    def __init__(self, group: str, package: str) -> None:
        self.group = group
        self._package = package
        self._parts: dict[str, T] = {}
        self._infos: dict[str, PluginInfo] = {}
        self._loaded = False

    def register(self, name: str) -> Callable[[T], T]:
        """Return a decorator that registers a part under ``name``.

        Raises:
            PluginError: if the name is taken.
        """

        def add(part: T) -> T:
            self._add(name, part, origin="built-in", version=_own_version())
            return part

        return add

    def get(self, name: str) -> T:
        """Return the part of this name.

        Raises:
            PluginError: if there is none; the message lists those known.
        """
        self._load()
        try:
            return self._parts[name]
        except KeyError:
            known = ", ".join(sorted(self._parts))
            raise PluginError(
                "PLG001", f"no {self.group} part is named {name!r}, known are {known}"
            ) from None

    def __iter__(self) -> Iterator[tuple[str, T]]:
        """Yield name and part, ordered by name."""
        self._load()
        return iter(sorted(self._parts.items(), key=lambda item: item[0]))

    def infos(self) -> tuple[PluginInfo, ...]:
        """Return where each part comes from, broken plug-ins with their problem included."""
        self._load()
        return tuple(self._infos[name] for name in sorted(self._infos))

    def _add(self, name: str, part: T, origin: str, version: str) -> None:
        if name in self._parts:
            raise PluginError("PLG002", f"{self.group} part {name!r} is registered twice")
        self._parts[name] = part
        self._infos[name] = PluginInfo(self.group, name, origin, version)

    def _load(self) -> None:
        if self._loaded:
            return
        self._loaded = True
        package = importlib.import_module(self._package)
        for module in pkgutil.iter_modules(package.__path__):
            importlib.import_module(f"{self._package}.{module.name}")
        for entry in entry_points(group=f"postproc.{self.group}"):
            version = entry.dist.version if entry.dist else "?"
            origin = entry.dist.name if entry.dist else entry.value
            try:
                self._add(entry.name, entry.load(), origin, version)
            except Exception as problem:  # noqa: BLE001 - a foreign plug-in may fail in any way
                self._infos[entry.name] = PluginInfo(
                    self.group, entry.name, origin, version, f"{type(problem).__name__}: {problem}"
                )


def _own_version() -> str:
    from postproc.version import __version__

    return __version__
