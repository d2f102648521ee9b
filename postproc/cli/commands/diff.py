"""``postproc diff``: semantic difference of two programs or two folders."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from postproc.cli import common as cli

if TYPE_CHECKING:
    from postproc.comparison import DiffReport


@cli.command("""
  postproc diff released/panel.src out/panel.src
  postproc diff released out --tol-mm 0.01 --json
  postproc diff released/panel.src out/panel.src --html changes.html
  postproc diff released out --markdown comment.md --junit diff.xml
  postproc diff released out --update      (look, then accept: out comes over released)
""")
@click.argument("old", metavar="OLD", type=click.Path())
@click.argument("new", metavar="NEW", type=click.Path())
@cli.option("--tol-mm", "Shift that counts as the same.", cli.NOT_NEGATIVE, default=0.001)
@cli.option("--tol-deg", "Turn that counts as the same.", cli.NOT_NEGATIVE, default=0.001)
@cli.option("--html FILE.html", "Write a page that shows what moved.")
@cli.option("--markdown FILE.md", "Write the answer in at most 60 lines.")
@cli.option("--junit FILE.xml", "Write the outcome as JUnit XML.")
@cli.option("--update", "Accept: copy NEW over OLD; then 0, not 1.")
def command(session: cli.Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Tell what the robot would do differently with NEW than with OLD.

    OLD and NEW are two programs (with the sub-programs beside them) or two folders, which are
    compared module by module. Names, folds, comments, number formats and where things are declared
    do not count. The answer begins with what was done, by hole and by cause, worst first. Exit code
    0: same, 1: different, 2: one cannot be read.

    With --update the differences are shown and accepted: the files of NEW are copied over those of
    OLD, with sub-programs; of folders, modules that NEW has no more are removed from OLD.
    """
    from postproc.comparison import DiffTolerance, diff

    tolerance = DiffTolerance(options["tol_mm"], options["tol_deg"])
    report = diff(options["old"], options["new"], tolerance)
    files = _files(report, options)
    if files:
        from postproc.files import write_files

        write_files(files)
    document = report.to_dict()
    if options["update"]:
        from postproc.comparison import accept

        document["updated"] = accept(options["old"], options["new"])
    session.document(document)
    session.show(report.summary())
    if options["update"]:
        session.show(f"accepted: {len(document['updated'])} files of {options['old']} changed")
    return cli.answer(report.same or options["update"])


def _files(report: DiffReport, options: dict[str, Any]) -> dict[Path, bytes]:
    """Return the files that were asked for."""
    files: dict[Path, bytes] = {}
    if options["html"]:
        from postproc.report.pages.diff import diff_page

        files[Path(options["html"])] = diff_page(report)
    if options["markdown"]:
        from postproc.report.pages.diff import diff_markdown

        files[Path(options["markdown"])] = diff_markdown(report)
    if options["junit"]:
        from postproc.batch import junit_xml

        cases = {
            name or options["new"]: {"status": "ok" if part.same else "different",
                                     "errors": part.summary().splitlines()}
            for name, part in report.by_module().items()
        }  # fmt: skip
        files[Path(options["junit"])] = junit_xml(cases, "postproc diff")
    return files
