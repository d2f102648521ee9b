"""Lint programs on disk: alone with the modules that they call, or as part of a controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from postproc.controller import load_program
from postproc.errors import Finding, KrlError
from postproc.krl import KrlModule, LintOptions, declared_names, load_modules
from postproc.krl import lint as lint_modules


def lint(
    programs: Sequence[str | Path],
    options: LintOptions | None = None,
    config: Sequence[str | Path] = (),
) -> tuple[tuple[Finding, ...], tuple[str, ...]]:
    """Return the findings in the files that were asked for, and these files.

    What lies in the folder R1 of a controller is linted with all of R1 in view: globals,
    ``$config.dat``, tools and bases that exist. Then what the controller takes is no error.

    Args:
        programs: .src and .dat files, or folders with all modules in them.
        options: the controller, and what else is there.
        config: data lists whose names are known, such as ``$config.dat``; not linted themselves.

    Raises:
        KrlError: if a file that was named is no KRL; of a folder it is a finding.
        ReadError: if a file is missing.
    """
    options = options or LintOptions()
    if config:
        names = frozenset[str]().union(*map(declared_names, load_modules(config)))
        options = replace(options, names=options.names | names)
    root = _project_of(programs)
    asked = [root if root and root in _below(p) else p for p in programs]
    bad: list[Finding] = []
    for path in asked:
        if not Path(path).is_dir():
            load_modules([path])  # a file that was named must be KRL
    modules = load_modules(asked, bad)
    files = {path for module in modules for path in (module.src_path, module.dat_path) if path}
    if root is None:
        seen: Sequence[KrlModule] = _with_called(modules)
    else:
        seen = load_modules([root], [])
        options = _of_controller(options, seen)
        known = {_key(module) for module in seen}
        seen = [*seen, *(module for module in modules if _key(module) not in known)]
    found = lint_modules(seen, options)
    resolved = {str(Path(path).resolve()): path for path in files}
    own = tuple(
        replace(item, source=replace(item.source, path=resolved[place]))
        for item in found
        if item.source and (place := str(Path(item.source.path).resolve())) in resolved
    )
    return (*bad, *own), tuple(sorted(files | {f.source.path for f in bad if f.source}))


def _project_of(programs: Sequence[str | Path]) -> Path | None:
    """Return the one R1 above or below all programs that has the controller's $config.dat."""
    roots = {root for path in programs for root in _above(path) or _below(path)}
    return roots.pop() if len(roots) == 1 else None


def _above(path: str | Path) -> list[Path]:
    """Return the R1 that a file or folder is or lies in."""
    place = Path(path).resolve()
    return [folder for folder in (place, *place.parents) if _is_r1(folder)][:1]


def _below(path: str | Path) -> list[Path]:
    """Return every R1 in a folder; the rest of a backup is no program."""
    place = Path(path).resolve()
    return [
        config.parents[1]
        for config in (sorted(place.rglob("*")) if place.is_dir() and not _above(place) else ())
        if config.name.lower() == "$config.dat" and _is_r1(config.parents[1])
    ]


def _is_r1(folder: Path) -> bool:
    """Return whether a folder is R1 with its System folder."""
    if folder.name.lower() != "r1" or not folder.is_dir():
        return False
    return any(
        config.name.lower() == "$config.dat"
        for system in folder.iterdir()
        if system.name.lower() == "system" and system.is_dir()
        for config in system.iterdir()
    )


def _key(module: KrlModule) -> str:
    return str(Path(module.src_path or module.dat_path).resolve())


def _of_controller(options: LintOptions, modules: Sequence[KrlModule]) -> LintOptions:
    """Return the options of a controller as its own data say."""
    values: dict[str, object] = {}
    for module in modules:
        if module.name.lower() not in ("$config", "$machine") or module.data is None:
            continue
        values |= {target.upper(): value for target, value, _ in module.data.values()}

    def count(name: str, default: int | None) -> int | None:
        value = values.get(name)
        return value if isinstance(value, int) else default

    return replace(
        options,
        is_project=True,
        max_tool=count("MAX_TOOL", options.max_tool) or options.max_tool,
        max_base=count("MAX_BASE", options.max_base) or options.max_base,
        externals=count("$EX_AX_NUM", options.externals),
    )


def _with_called(modules: tuple[KrlModule, ...]) -> list[KrlModule]:
    """Return the modules with those beside them that they call, for what those define."""
    found = {module.src_path or module.dat_path: module for module in modules}
    known = {Path(path).resolve() for path in found}
    for module in modules:
        if module.src_path.lower().endswith(".src") and module.routines:
            for other in _program(module.src_path):
                if Path(other.src_path).resolve() not in known:
                    known.add(Path(other.src_path).resolve())
                    found[other.src_path] = other
    return list(found.values())


def _program(path: str) -> tuple[KrlModule, ...]:
    try:
        return load_program(path)
    except KrlError:
        return ()  # a module that it calls is no KRL: what it defines is not known
