"""``postproc lint``: what a controller would refuse or silently change in a KRL program."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from postproc.cli.common import Session, answer, standard_options

if TYPE_CHECKING:
    from postproc.errors import Finding
    from postproc.krl import KrlModule

EPILOG = """\b
Examples:
  postproc lint out/panel.src
  postproc lint R1/Program --config R1/System/$config.dat --json
"""


@click.command(epilog=EPILOG)
@click.argument("programs", metavar="PROGRAM...", nargs=-1, required=True, type=click.Path())
@click.option(
    "--config",
    multiple=True,
    metavar="FILE",
    type=click.Path(),
    help="Data list whose names are known, such as $config.dat; not linted itself.",
)
@click.option(
    "--routine",
    multiple=True,
    metavar="NAME",
    help="Routine that is on the controller; may be given more than once.",
)
@click.option("--max-tool", default=16, show_default=True, help="MAX_TOOL of the controller.")
@click.option("--max-base", default=32, show_default=True, help="MAX_BASE of the controller.")
@click.option("--external-axes", type=click.IntRange(0, 6), help="Number of external axes.")
@click.option("--allow-zero", is_flag=True, help="Tool 0 and base 0 are meant.")
@standard_options
def command(session: Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Check KRL programs: .src and .dat files, or folders with all modules in them.

    Names must be unique over everything that is given. Of a single file its .dat and the modules
    beside it that it calls are read as well. Exit code 1 if there is any error.
    """
    from postproc.errors import Severity
    from postproc.krl import LintOptions, lint, load_modules

    asked = load_modules(options["programs"])
    config = load_modules(options["config"]) if options["config"] else ()
    modules = _with_called(asked)
    rules = LintOptions(
        max_tool=options["max_tool"],
        max_base=options["max_base"],
        externals=options["external_axes"],
        allow_zero=options["allow_zero"],
        names=_names(config),
        routines=frozenset(options["routine"]),
    )
    files = {path for module in asked for path in (module.src_path, module.dat_path) if path}
    findings = tuple(i for i in lint(modules, rules) if i.source and i.source.path in files)
    if session.json:
        session.document(_document(findings, files))
    else:
        for finding in findings:
            session.show(str(finding))
        session.show(_summary(findings, files))
    return answer(not any(finding.severity is Severity.ERROR for finding in findings))


def _with_called(modules: tuple[KrlModule, ...]) -> list[KrlModule]:
    """Return the modules with those beside them that they call, for what those define."""
    from postproc.controller import load_program

    found = {module.src_path or module.dat_path: module for module in modules}
    for module in modules:
        if module.src_path and module.routines:
            for other in load_program(module.src_path):
                known = {Path(path).resolve() for path in found}
                if Path(other.src_path).resolve() not in known:
                    found[other.src_path] = other
    return list(found.values())


def _names(modules: tuple[KrlModule, ...]) -> frozenset[str]:
    from postproc.krl import Declaration

    return frozenset(
        variable.name
        for module in modules
        for statement in (module.data.statements if module.data is not None else ())
        if isinstance(statement, Declaration)
        for variable in statement.variables
    )


def _count(findings: tuple[Finding, ...], severity: str) -> int:
    return sum(finding.count for finding in findings if finding.severity == severity)


def _document(findings: tuple[Finding, ...], files: set[str]) -> dict[str, Any]:
    return {
        "schema": "postproc.lint/1",
        "ok": _count(findings, "error") == 0,
        "files": sorted(files),
        "errors": _count(findings, "error"),
        "warnings": _count(findings, "warning"),
        "notes": _count(findings, "note"),
        "issues": [
            {
                "severity": str(finding.severity),
                "code": finding.code,
                "file": finding.source.path if finding.source else None,
                "line": finding.source.line if finding.source else None,
                "message": finding.message,
                "hint": finding.hint,
            }
            for finding in findings
        ],
    }


def _summary(findings: tuple[Finding, ...], files: set[str]) -> str:
    counts = ", ".join(f"{_count(findings, kind)} {kind}s" for kind in ("error", "warning", "note"))
    return f"{len(files)} files: {counts}"
