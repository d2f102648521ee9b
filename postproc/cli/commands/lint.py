"""``postproc lint``: what a controller would refuse or silently change in a KRL program."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from postproc.cli import common as cli

if TYPE_CHECKING:
    from postproc.errors import Finding


@cli.command("""
  postproc lint out/panel.src
  postproc lint R1/Program --config R1/System/$config.dat --json
""")
@click.argument("programs", metavar="PROGRAM...", nargs=-1, required=True, type=click.Path())
@cli.option(
    "--config FILE",
    "Data list whose names are known, such as $config.dat; not linted itself.",
    click.Path(),
    multiple=True,
)
@cli.option(
    "--routine NAME",
    "Routine that is on the controller; may be given more than once.",
    multiple=True,
)
@cli.option("--max-tool", "MAX_TOOL of the controller.", default=16)
@cli.option("--max-base", "MAX_BASE of the controller.", default=32)
@cli.option("--external-axes", "Number of external axes.", click.IntRange(0, 6))
@cli.option("--junit FILE.xml", "Write the outcome as JUnit XML, a case a file.")
@cli.option("--allow-zero", "Tool 0 and base 0 are intended.")
def command(session: cli.Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Check KRL programs: .src and .dat files, or folders with all modules in them.

    Names must be unique over everything that is given. Of a single file its .dat and the modules
    beside it that it calls are read as well. Exit code 1 if there is any error.
    """
    from postproc.jobs.lint import lint
    from postproc.krl import LintOptions

    rules = LintOptions(
        max_tool=options["max_tool"],
        max_base=options["max_base"],
        externals=options["external_axes"],
        allow_zero=options["allow_zero"],
        routines=frozenset(options["routine"]),
    )
    findings, files = lint(options["programs"], rules, options["config"])
    if options["junit"]:
        from pathlib import Path

        from postproc.batch import junit_xml
        from postproc.files import write_files

        cases = _cases(findings, files)
        write_files({Path(options["junit"]): junit_xml(cases, "postproc lint")})
    if session.json:
        session.document(_document(findings, files))
    else:
        for finding in findings:
            session.show(str(finding))
        session.show(_summary(findings, files))
    return cli.answer(not any(finding.is_error for finding in findings))


def _cases(findings: tuple[Finding, ...], files: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """Return the outcome by file; a finding without a file is one of the first."""
    cases: dict[str, dict[str, Any]] = {f: {"status": "ok", "errors": []} for f in files}
    for finding in findings:
        if finding.severity == "error":
            path = finding.source.path if finding.source else files[0]
            case = cases.setdefault(path, {"errors": []})
            case["status"] = "failed"
            case["errors"].append(str(finding))
    return cases


def _count(findings: tuple[Finding, ...], severity: str) -> int:
    return sum(finding.count for finding in findings if finding.severity == severity)


def _document(findings: tuple[Finding, ...], files: tuple[str, ...]) -> dict[str, Any]:
    return {
        "schema": "postproc.lint/1",
        "ok": _count(findings, "error") == 0,
        "files": list(files),
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


def _summary(findings: tuple[Finding, ...], files: tuple[str, ...]) -> str:
    counts = ", ".join(f"{_count(findings, kind)} {kind}s" for kind in ("error", "warning", "note"))
    return f"{len(files)} files: {counts}"
