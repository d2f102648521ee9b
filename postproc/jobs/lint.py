"""Lint programs on disk with the modules beside them that they call."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from postproc.controller import load_program
from postproc.errors import Finding
from postproc.krl import Declaration, KrlModule, LintOptions, load_modules
from postproc.krl import lint as lint_modules


def lint(
    programs: Sequence[str | Path],
    options: LintOptions | None = None,
    config: Sequence[str | Path] = (),
) -> tuple[tuple[Finding, ...], tuple[str, ...]]:
    """Return the findings in the files that were asked for, and these files.

    Args:
        programs: .src and .dat files, or folders with all modules in them.
        options: the controller, and what else is there.
        config: data lists whose names are known, such as ``$config.dat``; not linted themselves.

    Raises:
        KrlError: if a file is no KRL.
        ReadError: if a file is missing.
    """
    asked = load_modules(programs)
    options = options or LintOptions()
    if config:
        options = replace(options, names=options.names | _names(load_modules(config)))
    files = {path for module in asked for path in (module.src_path, module.dat_path) if path}
    found = lint_modules(_with_called(asked), options)
    own = tuple(item for item in found if item.source and item.source.path in files)
    return own, tuple(sorted(files))


def _with_called(modules: tuple[KrlModule, ...]) -> list[KrlModule]:
    """Return the modules with those beside them that they call, for what those define."""
    found = {module.src_path or module.dat_path: module for module in modules}
    known = {Path(path).resolve() for path in found}
    for module in modules:
        if module.src_path and module.routines:
            for other in load_program(module.src_path):
                if Path(other.src_path).resolve() not in known:
                    known.add(Path(other.src_path).resolve())
                    found[other.src_path] = other
    return list(found.values())


def _names(modules: tuple[KrlModule, ...]) -> frozenset[str]:
    """Return the names that data lists declare."""
    return frozenset(
        variable.name
        for module in modules
        for statement in (module.data.statements if module.data is not None else ())
        if isinstance(statement, Declaration)
        for variable in statement.variables
    )
