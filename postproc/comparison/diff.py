"""Semantic difference of two KRL programs: what the robot would do differently, line by line.

Names of points and routines, folds, comments, the format of numbers, the place of declarations
and where a program is cut into sub-programs do not count; neither does how a value is set. The
whole state of the controller is compared at every motion, and a line that is not understood counts.
Kinds: ``inserted`` and ``removed`` motions, ``moved`` targets, other ``motion`` instruction,
``speed``, ``status`` (S and T), ``approximation``, ``tool``, ``base``, ``external`` axes, other
``settings``; ``call``, ``io``, ``wait``, ``control``, ``data`` and ``other`` lines that were added,
removed or changed; whole modules with ``module``.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence, Set
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from postproc.comparison.difference import SHOWN, Difference, DiffTolerance, Group, group_lines
from postproc.comparison.groups import groups_of
from postproc.comparison.lines import Compared, Program, differences, program_of
from postproc.controller import called_names, load_program
from postproc.errors import Finding, KrlError, Severity, SourceRef
from postproc.krl import KrlModule, load_modules, parse_files, require_sound
from postproc.records import dataclass
from postproc.units import MM


@dataclass(frozen=True, slots=True)
class DiffReport:
    """All differences of two programs or folders, in the order of the old program."""

    old: str
    new: str
    differences: tuple[Difference, ...]
    old_motions: int = 0
    new_motions: int = 0
    modules: tuple[str, ...] = field(default=())
    """Names of the modules that were compared, for folders."""
    compared: tuple[Compared, ...] = field(default=(), repr=False, compare=False)
    """The programs, motion by motion."""
    tolerance: DiffTolerance = field(default=DiffTolerance(), repr=False, compare=False)

    @property
    def same(self) -> bool:
        """Whether a controller would do the same with both."""
        return not self.differences

    def counts(self) -> dict[str, int]:
        """Return how many differences there are of each kind."""
        return dict(sorted(Counter(item.kind for item in self.differences).items()))

    def groups(self) -> tuple[Group, ...]:
        """Return the differences as a reviewer reads them: by object and cause, worst first."""
        return groups_of(self.differences, self.compared, self.tolerance)

    def by_module(self) -> dict[str, DiffReport]:
        """Return the report of every module of two folders by name; of programs itself, by ""."""
        if not self.modules:
            return {"": self}
        parts: dict[str, list[Difference]] = {name.rpartition("/")[2]: [] for name in self.modules}
        pairs = {_stem(pair.old.trace.files[0]): pair for pair in self.compared}
        owner = {
            _stem(file): name
            for name, pair in pairs.items()
            for file in (*pair.old.trace.files, *pair.new.trace.files)
        }
        for item in self.differences:
            stem = _stem(item.old_file or item.new_file)
            parts.setdefault(owner.get(stem, stem), []).append(item)
        return {
            name: replace(
                self,
                differences=tuple(found),
                compared=(pairs[name],) if name in pairs else (),
                modules=(),
            )
            for name, found in sorted(parts.items())
        }

    def summary(self) -> str:
        """Return the answer in words: what was done, then counts and the first differences."""
        lines = [*group_lines(self.groups(), SHOWN - 2), self.headline()]
        left = SHOWN - len(lines)
        shown = left if len(self.differences) <= left else left - 1
        lines += [f"  {item}" for item in self.differences[:shown]]
        if len(self.differences) > shown:
            lines.append(f"  ... and {len(self.differences) - shown} more, see --json")
        return "\n".join(lines)

    def headline(self) -> str:
        """Return the verdict in one line: counts and the largest shift."""
        if self.same:
            return f"same: {self.old_motions} motions"
        parts = [f"{count} {kind}" for kind, count in self.counts().items()]
        moved = [d.distance_mm for d in self.differences if d.distance_mm is not None]
        turned = [d.angle_deg for d in self.differences if d.angle_deg is not None]
        if moved:
            parts.append(f"moved at most {max(moved):.4f} mm")
        if turned:
            parts.append(f"turned at most {max(turned):.4f} deg")
        return "different: " + ", ".join(parts)

    def to_dict(self) -> dict[str, Any]:
        """Return the ``postproc.diff/1`` document."""
        return {
            "schema": "postproc.diff/1",
            "same": self.same,
            "old": self.old,
            "new": self.new,
            "old_motions": self.old_motions,
            "new_motions": self.new_motions,
            "counts": self.counts(),
            "groups": [group.to_dict() for group in self.groups()],
            "differences": [item.to_dict() for item in self.differences],
        }


def _stem(path: str) -> str:
    return Path(path).stem.upper()


def diff(old: str | Path, new: str | Path, tolerance: DiffTolerance | None = None) -> DiffReport:
    """Compare two programs (.src files, with the sub-programs beside them) or two folders.

    A file of a folder that is no KRL is a difference, unless both folders have the same one.

    Raises:
        KrlError: if a program is no KRL, or DIF001 if a file is compared with a folder.
        ReadError: if one is missing.
    """
    is_folder = Path(old).is_dir(), Path(new).is_dir()
    if is_folder[0] != is_folder[1]:
        text = "a folder and a file: expected two programs or two folders"
        raise KrlError("DIF001", text, SourceRef(str(new)))
    limits = tolerance or DiffTolerance()
    if is_folder[0]:
        return _folders(str(old), str(new), limits)
    left, right = _program(old), _program(new)
    return _report(str(old), str(new), [(left, right)], limits)


def diff_files(
    old: Mapping[str, bytes],
    new: Mapping[str, bytes],
    name: str,
    tolerance: DiffTolerance | None = None,
) -> DiffReport:
    """Compare two versions of a program and its sub-programs, files by name; ``name`` names it."""
    modules = [parse_files(files) for files in (old, new)]
    left, right = ({m.name.upper(): _Loaded.of(m) for m in one} for one in modules)
    return _compared(name, name, left, right, tolerance or DiffTolerance())


@dataclass(frozen=True, slots=True)
class _Loaded:
    """A module that a controller could load, with its lines to compare."""

    module: KrlModule
    program: Program

    @classmethod
    def of(cls, module: KrlModule) -> _Loaded:
        """Return a module ready to compare, if a controller could load it."""
        require_sound([module])
        return cls(module, program_of([module], module.name, inline=False))


def _program(path: str | Path) -> Program:
    modules = load_program(path)
    require_sound(modules)
    return program_of(modules, modules[0].name, inline=True)


def _report(
    old: str, new: str, pairs: Sequence[tuple[Program, Program]], tolerance: DiffTolerance
) -> DiffReport:
    limits = tolerance.position_mm * MM, tolerance.angle_deg, tolerance.speed
    found = [differences(left, right, *limits) for left, right in pairs]
    return DiffReport(
        old,
        new,
        tuple(entry for entries, _ in found for entry in entries),
        sum(len(left.trace) for left, _ in pairs),
        sum(len(right.trace) for _, right in pairs),
        compared=tuple(compared for _, compared in found),
        tolerance=tolerance,
    )


def _folders(old: str, new: str, tolerance: DiffTolerance) -> DiffReport:
    (left, left_bad), (right, right_bad) = _modules(old), _modules(new)
    bad = left_bad.keys() | right_bad.keys()
    report = _compared(old, new, _without(left, bad), _without(right, bad), tolerance)
    unread = [_unread(name, left_bad, right_bad) for name in sorted(bad)]
    return replace(report, differences=(*report.differences, *(d for d in unread if d)))


def _without(modules: Mapping[str, _Loaded], names: Set[str]) -> dict[str, _Loaded]:
    return {name: module for name, module in modules.items() if name not in names}


def _unread(
    name: str, left: Mapping[str, Finding], right: Mapping[str, Finding]
) -> Difference | None:
    """Return the difference that a file is which cannot be compared, None if both are the same."""
    finding = left.get(name) or right[name]
    path = finding.place[0]
    if name in left and name in right:
        other = right[name].place[0]
        if Path(path).read_bytes() == Path(other).read_bytes():
            return None
    where = "both" if name in left and name in right else "the old" if name in left else "the new"
    text = f"module {name} cannot be compared: {where} is no KRL, {finding.message}"
    return Difference.of("module", text, *finding.place, is_old=name in left)


def _compared(
    old: str,
    new: str,
    left: Mapping[str, _Loaded],
    right: Mapping[str, _Loaded],
    tolerance: DiffTolerance,
) -> DiffReport:
    """Compare modules by name."""
    whole = _split_programs(left, right)
    parts = {part for _, names in whole.values() for part in names}
    found: list[Difference] = []
    pairs: list[tuple[Program, Program]] = []
    names = []
    for name in sorted((left.keys() | right.keys()) - parts):
        if name not in right:
            found.append(_lost(left[name].module, "is gone", is_old=True))
        elif name not in left:
            found.append(_lost(right[name].module, "is new", is_old=False))
        else:
            names.append(name)
            own = left[name].program, right[name].program
            pairs.append(whole[name][0] if name in whole else own)
    report = _report(old, new, pairs, tolerance)
    return replace(report, differences=(*found, *report.differences), modules=tuple(names))


def _split_programs(
    left: Mapping[str, _Loaded], right: Mapping[str, _Loaded]
) -> dict[str, tuple[tuple[Program, Program], list[str]]]:
    """Return the programs that both sides have with their parts in place, and the parts' names."""
    found: dict[str, tuple[tuple[Program, Program], list[str]]] = {}
    owner = _owners(left, right)
    for main in sorted(set(owner.values())):
        parts = sorted(name for name, of in owner.items() if of == main != name)
        if not parts:
            continue
        sides = ([side[n].module for n in (main, *parts) if n in side] for side in (left, right))
        try:
            old, new = (program_of(side, side[0].name, inline=True) for side in sides)
        except KrlError:  # a part that calls itself: module by module these can be compared
            continue
        found[main] = (old, new), parts
    return found


def _owners(left: Mapping[str, _Loaded], right: Mapping[str, _Loaded]) -> dict[str, str]:
    """Return by name the module that each is compared as a part of: where it is cut is no matter.

    That is what alone calls it; a module that several call, or none, stands for itself.
    """
    callers: dict[str, set[str]] = {name: set() for name in (*left, *right)}
    for side in (left, right):
        for name in left.keys() & right.keys():
            folder = name[: name.rfind("/") + 1]
            for called in called_names(side[name].module):
                if folder + called in callers:
                    callers[folder + called].add(name)
    found = {}
    for name in callers:
        way = [name]
        while len(callers[way[-1]]) == 1 and len(set(way)) == len(way):
            way += callers[way[-1]]
        found[name] = way[-1] if len(set(way)) == len(way) else name
    return found


def _modules(folder: str) -> tuple[dict[str, _Loaded], dict[str, Finding]]:
    """Return the modules of a folder by name, and what is wrong with those that cannot be read."""
    problems: list[Finding] = []
    found: dict[str, _Loaded] = {}
    bad: dict[str, Finding] = {}
    for module in load_modules([folder], problems):
        path = module.src_path or module.dat_path
        name = _name_in(folder, path)
        try:
            found[name] = _Loaded.of(module)
        except KrlError as problem:
            source = problem.source or SourceRef(path)
            bad[name] = Finding(Severity.ERROR, problem.code, problem.message, source=source)
    bad |= {_name_in(folder, finding.place[0]): finding for finding in problems}
    return found, bad


def _name_in(folder: str, path: str) -> str:
    return str(Path(path).relative_to(folder).with_suffix("")).upper()


def _lost(module: KrlModule, what: str, *, is_old: bool) -> Difference:
    path = module.src_path or module.dat_path
    return Difference.of("module", f"module {module.name} {what}", path, 1, is_old=is_old)
