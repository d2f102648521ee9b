"""``postproc diff``: semantic difference of two programs or two folders."""

from __future__ import annotations

from typing import Any

import click

from postproc.cli.common import (
    NOT_NEGATIVE,
    Session,
    answer,
    standard_options,
)

EPILOG = """\b
Examples:
  postproc diff released/panel.src out/panel.src
  postproc diff released out --tol-mm 0.01 --json
  postproc diff released/panel.src out/panel.src --html changes.html
  postproc diff released out --update      (look, then accept: out comes over released)
"""


@click.command(epilog=EPILOG)
@click.argument("old", metavar="OLD", type=click.Path())
@click.argument("new", metavar="NEW", type=click.Path())
@click.option(
    "--tol-mm", default=0.001, show_default=True, type=NOT_NEGATIVE, help="Shift that is the same."
)
@click.option(
    "--tol-deg", default=0.001, show_default=True, type=NOT_NEGATIVE, help="Turn that is the same."
)
@click.option("--html", "page", metavar="FILE.html", help="Write a page that shows what moved.")
@click.option("--update", is_flag=True, help="Accept: copy NEW over OLD; then 0, not 1.")
@standard_options
def command(session: Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Tell what the robot would do differently with NEW than with OLD.

    OLD and NEW are two programs (with the sub-programs beside them) or two folders, which are
    compared module by module. Names, folds, comments, number formats and where things are declared
    do not count. Exit code 0: same, 1: different, 2: one cannot be read.

    With --update the differences are shown and accepted: the files of NEW are copied over those of
    OLD, with sub-programs; of folders, modules that NEW has no more are removed from OLD.
    """
    from postproc.comparison import DiffTolerance, diff

    tolerance = DiffTolerance(options["tol_mm"], options["tol_deg"])
    report = diff(options["old"], options["new"], tolerance)
    if options["page"]:
        from pathlib import Path

        from postproc.files import write_files
        from postproc.report.pages.diff import diff_page

        write_files({Path(options["page"]): diff_page(report)})
    document = report.to_dict()
    if options["update"]:
        from postproc.comparison import accept

        document["updated"] = accept(options["old"], options["new"])
    session.document(document)
    session.show(report.summary())
    if options["update"]:
        session.show(f"accepted: {len(document['updated'])} files of {options['old']} changed")
    return answer(report.same or options["update"])
