"""What a batch has to do: inputs by file, folder, glob or list, each with its own options."""

from __future__ import annotations

import fnmatch
import glob
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from postproc.errors import DataError, SourceRef
from postproc.files import read_bytes
from postproc.pipeline.convert import ConvertRequest

if TYPE_CHECKING:
    from postproc.model.toolpath import ToolPath

SUFFIXES = (".apt", ".aptsource", ".cl", ".cls", ".clsf", ".clt", ".csv", ".ncl", ".xml")
"""File name endings taken from a folder; Creo's version numbers (``.ncl.8``) count too."""

SCHEMA = "postproc.batch/1"
_OPTIONS = {"cell", "name", "format", "dialect", "units", "columns", "strategy", "objective"}
_OPTIONS |= {"model", "recover", "partial"}


@dataclass(frozen=True, slots=True)
class Job:
    """One program to make: ``key`` names it in the manifest.

    ``toolpath`` is a section of a large input that was read and cut before; None: read the input.
    """

    key: str
    request: ConvertRequest
    toolpath: ToolPath | None = None


def find_inputs(patterns: Sequence[str]) -> list[str]:
    """Return input paths in a fixed order, each once.

    A pattern is a file, a folder (searched below for known endings), a glob, or ``@LIST``, a text
    file with one pattern a line.

    Raises:
        DataError: BAT001 if a pattern matches nothing.
    """
    found: dict[str, None] = {}
    for pattern in patterns:
        matches = sorted(_matches(pattern))
        if not matches:
            raise DataError("BAT001", "no input here", SourceRef(pattern))
        found.update(dict.fromkeys(matches))
    return list(found)


def _matches(pattern: str) -> Iterable[str]:
    if pattern.startswith("@"):
        lines = read_bytes(pattern[1:]).decode("utf-8", "replace").splitlines()
        wanted = [line.strip() for line in lines if line.strip() and not line.startswith("#")]
        return find_inputs(wanted)
    path = Path(pattern)
    if path.is_dir():
        return [str(p) for p in path.rglob("*") if p.is_file() and is_input(p)]
    if path.exists():
        return [pattern]
    return [p for p in glob.glob(pattern, recursive=True) if Path(p).is_file()]  # noqa: PTH207 - absolute patterns


def is_input(path: Path) -> bool:
    """Return whether a file of a folder looks like a CAM file by its name."""
    names = [suffix.lower() for suffix in path.suffixes[-2:]]
    if names and names[-1][1:].isdigit():
        names = names[:-1]
    return bool(names) and names[-1] in SUFFIXES


@dataclass(frozen=True, slots=True)
class Overrides:
    """``batch.toml``: options for all inputs and for those that match a pattern, in order."""

    defaults: Mapping[str, Any]
    rules: tuple[tuple[str, Mapping[str, Any]], ...] = ()

    def request(self, source: str, base: ConvertRequest) -> ConvertRequest:
        """Return the request for one input: the call's options, then the file's, later wins."""
        options = dict(self.defaults)
        for pattern, values in self.rules:
            if fnmatch.fnmatch(source, pattern) or fnmatch.fnmatch(Path(source).name, pattern):
                options.update(values)
        return replace(base, source=source, **options)


def load_overrides(path: str) -> Overrides:
    """Read ``batch.toml``; cells and models are relative to the file.

    Raises:
        DataError: BAT002 for TOML errors, BAT003 for unknown keys.
    """
    text = read_bytes(path)
    try:
        table = tomllib.loads(text.decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as problem:
        raise DataError("BAT002", f"not valid TOML: {problem}", SourceRef(path)) from None
    unknown = set(table) - {"schema", "defaults", "input"}
    if unknown or table.get("schema", SCHEMA) != SCHEMA:
        what = f"unknown key {min(unknown)!r}" if unknown else f"schema is not {SCHEMA!r}"
        raise DataError(
            "BAT003", f"{what}, expected schema, [defaults], [[input]]", SourceRef(path)
        )
    folder = Path(path).parent
    rules = []
    for rule in table.get("input", []):
        options = dict(rule)
        pattern = options.pop("match", None)
        if not isinstance(pattern, str):
            raise DataError("BAT003", 'an [[input]] needs match = "pattern"', SourceRef(path))
        rules.append((pattern, _checked(options, path, folder)))
    return Overrides(_checked(dict(table.get("defaults", {})), path, folder), tuple(rules))


def _checked(options: dict[str, Any], path: str, folder: Path) -> dict[str, Any]:
    kinds = {f.name: f.type for f in fields(ConvertRequest)}
    for key, value in options.items():
        if key not in _OPTIONS:
            known = ", ".join(sorted(_OPTIONS))
            raise DataError("BAT003", f"unknown key {key!r}, known are {known}", SourceRef(path))
        wants_flag = "bool" in str(kinds[key])
        if isinstance(value, bool) != wants_flag or not isinstance(value, (str, bool)):
            want = "true or false" if wants_flag else "text"
            raise DataError("BAT003", f"{key} = {value!r}, expected {want}", SourceRef(path))
        if key in {"cell", "model"}:
            options[key] = str(folder / str(value))
    return options


def make_jobs(sources: Sequence[str], base: ConvertRequest, overrides: Overrides) -> list[Job]:
    """Return one job per input, with program names that are unique over the whole batch.

    A name is the input's own; where two inputs would get the same one, each but the first gets a
    short mark made from its path, so that a further input changes no other's name.
    """
    import hashlib

    from postproc.krl.names import legal_name

    taken: set[str] = set()
    jobs = []
    for source in sources:
        request = overrides.request(source, base)
        name = legal_name(request.name or Path(source).name.split(".")[0])
        if name.upper() in taken:
            mark = hashlib.sha256(source.encode()).hexdigest()[:6].upper()
            name = legal_name(f"{name[:13]}_{mark}")
        taken.add(name.upper())
        jobs.append(Job(key=source, request=replace(request, name=name)))
    return jobs
