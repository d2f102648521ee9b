"""``postproc verify``: run a program's text on the robot model, against the CAM path."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from postproc.cli import common as cli
from postproc.errors import headlines

if TYPE_CHECKING:
    from postproc.cell import Cell
    from postproc.verification import VerifyReport


@cli.command("""
  postproc verify out/panel.src --cell cell.toml
  postproc verify out/panel.src --cell cell.toml --against panel.csv --json
  postproc verify out/panel.src --cell cell.toml --against panel.csv --report out/verify.html
  postproc verify out/panel.src --cell cell.toml --against panel.csv --model model.toml
  postproc verify out/panel.src --cell cell.toml --against panel.csv --path out/path.csv
""")
@click.argument("program", metavar="PROGRAM.src", type=click.Path())
@cli.CELL
@cli.option("--against INPUT", "The CAM file that the program was made from.")
@cli.reading_options
@cli.option("--tol-mm", "How far a point may be off the CAM file.", cli.POSITIVE, default=0.01)
@cli.option(
    "--tol-deg", "How far the tool axis may be off the CAM file.", cli.POSITIVE, default=0.005
)
@cli.option(
    "--model MODEL.toml",
    "Model of the arm: judge where the real, loaded tool lands (needs --against).",
)
@cli.option("--no-collisions", "Do not search for collisions.")
@cli.option("--report FILE.html", "Write a page that shows the run.")
@cli.option("--path FILE.csv|.json", "Write the simulated path, one row for each step.")
def command(session: cli.Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Verify a KRL program from its text, with the sub-programs beside it.

    The program is run on the robot model of the cell: tool and base, branches and turns, limits,
    singularities, axis speeds, blending, collisions between the points. With --against, every
    point, axis, arc, feed, hole, dwell and event of the CAM file must be found in it. With --model
    the real tool, as the model expects it under tool weight and process force, must be there: so
    a program of convert --model is judged, whose commanded points are shifted on purpose. Exit
    code 1 if anything is violated.
    """
    from postproc.cell import load_cell
    from postproc.files import write_files
    from postproc.jobs.simulated_path import check_path_name, path_file
    from postproc.jobs.verify import uncounted, verify
    from postproc.model import load_model

    if options["model"] and not options["against"]:
        raise click.UsageError("--model needs --against: the real tool is compared with CAM points")
    check_path_name(options["path"])
    cell = load_cell(options["cell"])
    model = load_model(options["model"]) if options["model"] else None
    if model is not None:
        for name, missing in uncounted(cell, model).items():
            session.say(f"{name} is left out: a program does not give {', '.join(missing)}")
    toolpath = None
    if options["against"]:
        toolpath = cli.read_cam(options["against"], options, cell)
    with session.progress() as progress:
        report = verify(
            options["program"],
            cell,
            toolpath,
            model=model,
            tol_mm=options["tol_mm"],
            tol_deg=options["tol_deg"],
            collisions=not options["no_collisions"],
            progress=progress,
        )
    files = {}
    if options["report"]:
        from postproc.jobs.pages import page_of_verification

        files[Path(options["report"])] = page_of_verification(report, cell, toolpath)
    if options["path"]:
        files[Path(options["path"])] = path_file(options["path"], report, cell, toolpath)
    write_files(files)
    session.document(report.to_dict())
    _show(session, report, _measured(report, cell))
    return cli.answer(report.ok)


_UNKNOWN = 20
"""So many motions that are not known are listed one by one."""


def _measured(report: VerifyReport, cell: Cell) -> list[tuple[str, ...]]:
    """Return a row for each measure: its worst value, what is allowed, and where it is."""
    from postproc.jobs.explain import measure_named

    rows: list[tuple[str, ...]] = []
    for name, worst in sorted(report.worst.items()):
        known = measure_named(name)
        allowed = known.allowed(cell, report.run.tolerances) if known and report.run else "-"
        where = f"{worst.file}:{worst.line}" + (f" ({worst.detail})" if worst.detail else "")
        rows.append((name, f"{worst.value:.4f}", allowed, worst.unit, where))
    return rows


def _show(session: cli.Session, report: VerifyReport, measured: Sequence[Sequence[str]]) -> None:
    from postproc.units import MM

    for finding in (*report.violations, *report.warnings):
        session.show(str(finding))
    session.table(("measure", "worst", "allowed", "unit", "where"), measured)
    if report.expectation is not None:
        both = report.expectation
        session.show(
            f"real tool  expected within {both.expected_max / MM:.4f} mm of the CAM points, "
            f"rms {both.expected_rms / MM:.4f} mm"
        )
        session.show(
            f"commanded  up to {both.nominal_max / MM:.4f} mm from them, "
            f"rms {both.nominal_rms / MM:.4f} mm"
        )
    if report.tags is not None:
        session.show(f"CAM points {report.tags}, {report.matched} of them passed in order")
    _show_coverage(session, report)
    session.show(f"motions    {report.points}, about {report.cycle_time:.1f} s")
    checked = "" if report.collisions_checked else " (collisions not searched)"
    but = "".join(f", but {text}" for text in headlines(report.warnings))
    session.show(("good" if report.ok else f"{len(report.violations)} violations") + checked + but)


def _show_coverage(session: cli.Session, report: VerifyReport) -> None:
    """Say which motions of the text are not known, where there are some."""
    found = report.coverage
    if found is None or not found.unknown:
        return
    for one in found.unknown[:_UNKNOWN]:
        session.show(f"not known  {one.file}:{one.line}: {one.why}")
    if len(found.unknown) > _UNKNOWN:
        session.show(f"not known  {len(found.unknown) - _UNKNOWN} more motions: --json lists them")
    session.show(
        f"judged     {found.judged} of {found.in_text} motions of the text, {found.refused} with a "
        f"violation; {len(found.unknown)} not known, {found.never_run} never run"
    )
