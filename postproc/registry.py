"""One registry for everything that can be plugged in: readers, emitters, effects, objectives.

Built-in parts register by a decorator and are found by importing every module of their
folder; foreign parts come by the entry-point groups ``postproc.readers``, ``postproc.emitters``,
``postproc.effects`` and ``postproc.objectives``. A plug-in that fails to import, or is not what its
group promises, is reported with its name and cause and left out; it never stops the product and is
never silent.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.metadata import Distribution, EntryPoint, EntryPoints, distributions
from pathlib import Path
from typing import Any, Generic, TypeVar

from postproc.errors import PluginError, PostprocError
from postproc.records import dataclass

T = TypeVar("T")
BUILT_IN = "built-in"
GROUPS = ("readers", "emitters", "effects", "objectives", "traces", "path_effects")
_NAMED = "[postproc."


@dataclass(frozen=True, slots=True)
class PluginInfo:
    """Where a registered part comes from."""

    group: str
    name: str
    origin: str
    version: str
    problem: str = ""

    def __str__(self) -> str:
        """Return the part in words."""
        return f"{self.group[:-1]} {self.name!r} of {self.origin} {self.version}"


class Registry(Generic[T]):
    """Parts of one kind by name; a second part of the same name is an error.

    Args:
        group: ``readers``, ``emitters``, ``effects`` or ``objectives``; the entry-point group is
            ``postproc.<group>``.
        package: dotted name of the package whose modules hold the built-in parts.
        kind: the class that every part is an instance of.
    """

    def __init__(self, group: str, package: str, kind: type[Any] = object) -> None:
        self.group = group
        self._package = package
        self._kind = kind
        self._parts: dict[str, T] = {}
        self._lent: dict[str, T] = {}
        self._infos: list[PluginInfo] = []
        self._loaded = False

    def register(self, name: str) -> Callable[[T], T]:
        """Return a decorator that registers a built-in part under ``name``.

        Raises:
            PluginError: PLG002 if the name is taken, PLG005 if the part is none of this kind.
        """

        def add(part: T) -> T:
            self._add(name, part)
            self._infos.append(PluginInfo(self.group, name, BUILT_IN, _own_version()))
            return part

        return add

    def lend(self, part: T, name: str) -> str:
        """Keep a part of the caller's own for this process, and return the name it got.

        The same part has the same name again; where another one has the name, a number follows. It
        can be used by that name, and is not listed among the parts that everybody has.
        """
        self._load()
        own, number = name, 1
        while own in self._parts or self._lent.get(own, part) != part:
            number += 1
            own = f"{name}_{number}"
        self._lent[own] = self._checked(part)
        return own

    def get(self, name: str) -> T:
        """Return the part of this name.

        Raises:
            PluginError: PLG001 with the words of ``unknown``.
        """
        self._load()
        if name not in self:
            raise PluginError("PLG001", self.unknown(name))
        return self._lent[name] if name in self._lent else self._parts[name]

    def __contains__(self, name: str) -> bool:
        """Return whether a part of this name can be used."""
        self._load()
        return name in self._parts or name in self._lent

    def unknown(self, name: str, *more: str) -> str:
        """Return why ``name`` cannot be used, with the names that can; ``more``: further ones."""
        self._load()
        for info in self._infos:
            if info.name == name and info.problem:
                return f"{info} cannot be used: {info.problem}"
        known = ", ".join(sorted((*self._parts, *more)))
        text = f"no {self.group[:-1]} is named {name!r}, expected {known}"
        return f"{text}; others are plug-ins: install one, or write it by the plug-in tutorial"

    def __iter__(self) -> Iterator[tuple[str, T]]:
        """Yield name and part, ordered by name."""
        self._load()
        return iter(sorted(self._parts.items(), key=lambda item: item[0]))

    @contextmanager
    def blame(self, name: str) -> Iterator[None]:
        """Within it, what a foreign part of this name fails with counts as its own fault.

        Raises:
            PluginError: PLG006 for anything but an expected error.
        """
        try:
            yield
        except PostprocError:
            raise
        except Exception as problem:
            own = [PluginInfo(self.group, name, "this program", _own_version())]
            infos = own if name in self._lent else self.infos()
            info = next((i for i in infos if i.name == name and not i.problem), None)
            if info is None or info.origin == BUILT_IN:
                raise
            what = f"{type(problem).__name__}: {problem}"
            raise PluginError("PLG006", f"{info} failed: {what}") from problem

    def infos(self) -> tuple[PluginInfo, ...]:
        """Return where each part comes from, broken plug-ins with their problem included."""
        self._load()
        return tuple(sorted(self._infos, key=lambda info: (info.name, info.origin)))

    def _checked(self, part: T) -> T:
        if isinstance(part, type) or not isinstance(part, self._kind):
            raise PluginError(
                "PLG005", f"{_kind_of(part)} is no {self._kind.__name__}, see postproc.testing"
            )
        return part

    def _add(self, name: str, part: T) -> None:
        own = getattr(self._checked(part), "name", name)
        if own != name:
            raise PluginError("PLG005", f"it calls itself {own!r}, but is registered as {name!r}")
        if name in self._parts:
            raise PluginError("PLG002", f"{self.group[:-1]} {name!r} is registered twice")
        self._parts[name] = part

    def _load(self) -> None:
        if self._loaded:
            return
        self._loaded = True
        package = importlib.import_module(self._package)
        for module in pkgutil.iter_modules(package.__path__):
            importlib.import_module(f"{self._package}.{module.name}")
        for entry in plug_ins(self.group):
            problem = ""
            try:
                self._add(entry.name, entry.load())
            except PluginError as error:
                problem = error.message
            except Exception as error:  # noqa: BLE001 - a foreign plug-in may fail in any way
                problem = f"{type(error).__name__}: {error}"
            self._infos.append(PluginInfo(self.group, entry.name, *_origin(entry), problem))


@cache
def _installed() -> EntryPoints:
    """Return the entry points of packages that name a group of ours."""
    every = [(package, _entries(package)) for package in distributions()]
    if not any(_NAMED in text for _, text in every):
        return EntryPoints(())
    first: dict[str, Distribution] = {}
    for package, _ in every:
        first.setdefault(package.name, package)
    named = [p for p, text in every if _NAMED in text and first[p.name] is p]
    return EntryPoints(entry for package in named for entry in package.entry_points)


def _entries(package: Distribution) -> str:
    """Return the text in which a package names its entry points, none if it is no text."""
    try:
        return package.read_text("entry_points.txt") or ""
    except UnicodeDecodeError:
        return ""


def plug_ins(group: str) -> EntryPoints:
    """Return the entry points of foreign parts of a group."""
    found: EntryPoints = _installed().select(group=f"postproc.{group}")
    return found


def foreign() -> tuple[str, ...]:
    """Return group, name, package and version of every installed plug-in, without loading any."""
    return tuple(
        sorted(
            " ".join((group, entry.name, *_origin(entry)))
            for group in GROUPS
            for entry in plug_ins(group)
        )
    )


def _origin(entry: EntryPoint) -> tuple[str, str]:
    """Return the package that an entry point is of, and its version."""
    return (entry.dist.name, entry.dist.version) if entry.dist else (entry.value, "?")


def _kind_of(part: object) -> str:
    return f"the class {part.__name__}" if isinstance(part, type) else f"a {type(part).__name__}"


def part_names(group: str, package: str) -> tuple[str, ...]:
    """Return the names of the parts of a group without importing any: those of its modules."""
    top, *inner = package.split(".")
    folders = [str(Path(place, *inner)) for place in importlib.import_module(top).__path__]
    own = {module.name for module in pkgutil.iter_modules(folders)}
    return tuple(sorted(own | {e.name for e in plug_ins(group)}))


def _own_version() -> str:
    from postproc.version import __version__

    return __version__
