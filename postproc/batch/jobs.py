"""What a batch has to do: inputs by file, folder, glob or list, each with its own options."""

from __future__ import annotations

import fnmatch
import glob
import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

from postproc.cell import CALL_KEYS, call_keys, key_said
from postproc.emitters import EMITTERS
from postproc.errors import DataError, SourceRef
from postproc.files import read_bytes
from postproc.jobs.convert import ConvertRequest
from postproc.readers import READERS
from postproc.records import dataclass
from postproc.toml import Location, TomlText, load_toml

if TYPE_CHECKING:
    from postproc.model import ToolPath

SCHEMA = "postproc.batch/1"
_FLAGS = {"recover", "partial"}
_FILES = {"cell", "model"}
_OPTIONS = {"name", *_FLAGS, *_FILES, *CALL_KEYS}
"""What a table of a batch can ask for."""


@dataclass(frozen=True, slots=True)
class Job:
    """One program to make: ``key`` names it in the manifest.

    ``toolpath`` is a section of a large input that was read and cut before; None: read the input.
    ``paged``: a page that shows it is wanted too.
    """

    key: str
    request: ConvertRequest
    toolpath: ToolPath | None = None
    paged: bool = False


def find_inputs(patterns: Sequence[str]) -> list[str]:
    """Return input paths in a fixed order, each file once.

    A pattern is a file, a folder (searched below for known endings), a glob, or ``@LIST``, a text
    file with one pattern a line; a file that is named there but missing is an input that fails.
    """
    found: dict[str, str] = {}
    for path in _all_matches(patterns, ()):
        found.setdefault(os.path.abspath(path), os.path.normpath(path))  # noqa: PTH100 - links stay
    return list(found.values())


def _all_matches(patterns: Iterable[str], lists: tuple[str, ...]) -> Iterator[str]:
    for pattern in patterns:
        if pattern.startswith("@"):
            yield from _listed(pattern[1:], lists)
            continue
        matches = sorted(_matches(pattern))
        if not matches and lists and not glob.has_magic(pattern):
            matches = [pattern]
        if not matches:
            source = SourceRef(lists[-1]) if lists else SourceRef(pattern)
            what = f"no input matches {pattern!r}" if lists else "no input here"
            raise DataError("BAT001", what, source)
        yield from matches


def _listed(path: str, lists: tuple[str, ...]) -> Iterator[str]:
    if path in lists:
        raise DataError("BAT006", "this list names itself", SourceRef(path))
    lines = os.fsdecode(read_bytes(path).removeprefix(b"\xef\xbb\xbf")).splitlines()
    wanted = (line.strip() for line in lines)
    yield from _all_matches((w for w in wanted if w and not w.startswith("#")), (*lists, path))


def _matches(pattern: str) -> Iterable[str]:
    path = Path(pattern)
    if path.is_dir():
        return [str(p) for p in path.rglob("*") if p.is_file() and is_input(p)]
    if path.exists():
        if not path.is_file():
            raise DataError("BAT001", "neither a file nor a folder", SourceRef(pattern))
        return [pattern]
    return [p for p in glob.glob(pattern, recursive=True) if Path(p).is_file()]  # noqa: PTH207 - absolute patterns


def is_input(path: Path) -> bool:
    """Return whether a file of a folder looks like a CAM file by its name.

    Creo's version numbers (``.ncl.8``) count too.
    """
    names = [suffix.lower() for suffix in path.suffixes[-2:]]
    if names and names[-1][1:].isdigit():
        names = names[:-1]
    return bool(names) and names[-1] in _suffixes()


@cache
def _suffixes() -> frozenset[str]:
    """Return the file name endings that some reader names."""
    return frozenset(ending for _, reader in READERS for ending in getattr(reader, "suffixes", ()))


@dataclass(frozen=True, slots=True)
class Overrides:
    """``batch.toml``: options for all inputs and for those that match a pattern, in order.

    A pattern is compared with the path as given, its last parts, and the file name.
    """

    defaults: Mapping[str, Any]
    rules: tuple[tuple[str, Mapping[str, Any]], ...] = ()

    def request(self, source: str, base: ConvertRequest) -> ConvertRequest:
        """Return the request for one input: the call's options, then the file's, later wins."""
        options = dict(self.defaults)
        for pattern, values in self.rules:
            if _is_meant(pattern, source):
                options.update(values)
        keys = {**base.keys, **call_keys(options)}
        own = {name: options[name] for name in options if name not in keys}
        return replace(base, source=source, keys=keys, **own)

    def unused(self, sources: Sequence[str]) -> list[str]:
        """Return the patterns that match none of the inputs."""
        return [p for p, _ in self.rules if not any(_is_meant(p, s) for s in sources)]


def _is_meant(pattern: str, source: str) -> bool:
    path = PurePath(source)
    return fnmatch.fnmatchcase(source, pattern) or (bool(pattern) and path.match(pattern))


def load_overrides(path: str) -> Overrides:
    """Read ``batch.toml``; cells and models are relative to the file."""
    toml = load_toml(path, DataError, "BAT002")
    expected = "expected schema, [defaults], [[input]]"
    for key in toml.data:
        if key not in {"schema", "defaults", "input"}:
            raise DataError("BAT003", f"unknown key {key!r}, {expected}", toml.source((key,)))
    if toml.data.get("schema", SCHEMA) != SCHEMA:
        raise DataError("BAT003", f"schema is not {SCHEMA!r}", toml.source(("schema",)))
    rules = []
    entries = toml.data.get("input", [])
    if not isinstance(entries, list):
        text = f"input is no list of tables, {expected}"
        raise DataError("BAT003", text, toml.source(("input",)))
    for number, rule in enumerate(entries):
        place: Location = ("input", number)
        options = _checked(rule, toml, place, {"match"})
        pattern = options.pop("match", None)
        if not isinstance(pattern, str) or not pattern:
            raise DataError("BAT003", 'an [[input]] needs match = "pattern"', toml.source(place))
        rules.append((pattern, options))
    defaults = _checked(toml.data.get("defaults", {}), toml, ("defaults",), set())
    return Overrides(defaults, tuple(rules))


def _checked(table: Any, toml: TomlText, place: Location, more: set[str]) -> dict[str, Any]:  # noqa: ANN401 - whatever the file holds
    """Return the options of a table of the file."""
    if not isinstance(table, dict):
        raise DataError("BAT003", f"{place[0]} is no table", toml.source(place))
    options = dict(table)
    for key, value in options.items():
        where = toml.source((*place, key))
        if key in more:
            continue
        if key not in _OPTIONS:
            known = ", ".join(sorted(_OPTIONS | more))
            raise DataError("BAT003", f"unknown key {key!r}, known are {known}", where)
        wants_flag = key in _FLAGS
        if isinstance(value, bool) != wants_flag or not isinstance(value, (str, bool)):
            want = "true or false" if wants_flag else "text"
            raise DataError("BAT003", f"{key} = {value!r}, expected {want}", where)
        choices = _known(key)
        if choices and value not in choices:
            want = ", ".join(choices)
            raise DataError("BAT003", f"{key} = {value!r}, expected one of {want}", where)
        if key in _FILES:
            options[key] = str(Path(toml.path).parent / str(value))
    return options


def _known(key: str) -> tuple[str, ...]:
    """Return what an option of ``batch.toml`` takes, nothing where any text will do."""
    if key == "format":
        return ("auto", *(name for name, _ in READERS))
    if key == "emitter":
        return tuple(name for name, _ in EMITTERS)
    return key_said(CALL_KEYS[key][1], key)[1] if key in CALL_KEYS else ()


def unique_name(name: str, key: str, taken: set[str]) -> str:
    """Return a program name that is not ``taken`` (upper case) yet, and take it.

    A name that is taken gets a short mark made from the key, so that it does not depend on how
    many others have the same.
    """
    given, salt = name, ""
    while given.upper() in taken:
        given, salt = _marked(name, key + salt), f"{salt}+"
    taken.add(given.upper())
    return given


def _marked(name: str, key: str) -> str:
    from postproc.krl import legal_name

    mark = hashlib.sha256(key.encode("utf-8", "surrogateescape")).hexdigest()[:6].upper()
    return legal_name(f"{name[:13]}_{mark}")


def make_jobs(sources: Sequence[str], base: ConvertRequest, overrides: Overrides) -> list[Job]:
    """Return one job per input; its program is named after the input unless a name is given."""
    from postproc.krl import legal_name

    jobs = []
    for source in sources:
        request = overrides.request(source, base)
        wanted = legal_name(request.name or Path(source).name.split(".")[0])
        jobs.append(Job(source, replace(request, name=wanted)))
    return jobs


def uniquely_named(jobs: Sequence[Job], recorded: Mapping[str, str]) -> list[Job]:
    """Return jobs with program names that are unique over the whole batch.

    Where two would get the same one, the first has it and the others get a mark made from their
    path. So does one that had it already, by the programs ``recorded`` by job key, as long as an
    input of another call has the plain name.
    """
    keys, taken, named = {job.key for job in jobs}, set[str](), []
    others = {name.upper() for key, name in recorded.items() if key not in keys}
    for job in jobs:
        wanted, known = str(job.request.name), recorded.get(job.key)
        if wanted.upper() in others and known == _marked(wanted, job.key):
            wanted = known
        name = unique_name(wanted, job.key, taken)
        named.append(replace(job, request=replace(job.request, name=name)))
    return named


def source_of(key: str) -> str:
    """Return the input of a manifest's key, which may be that of a section of it."""
    whole, mark, _ = key.rpartition("#")
    return whole if mark and not os.path.lexists(key) else key
