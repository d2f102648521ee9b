"""``postproc diagnose``: the sim-to-real gap of a measured robot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from postproc.cli.common import Session, answer, read_cam, reading_options, standard_options

if TYPE_CHECKING:
    from postproc.cell import Cell
    from postproc.gap import Along, Diagnosis

EPILOG = """\b
Examples:
  postproc diagnose measured.csv --cell cell.toml -o out
  postproc diagnose tracker.csv --cell cell.toml --register --json
  postproc diagnose measured.csv --cell cell.toml --program part.cls -o out
  postproc diagnose measured.csv out/next_measurements.csv --cell cell.toml -o out2
"""


@click.command(epilog=EPILOG)
@click.argument("measurements", metavar="MEAS.csv...", nargs=-1, required=True)
@click.option("--cell", required=True, metavar="CELL.toml", help="The robot cell.")
@click.option("--model", metavar="MODEL.toml", help="What the simulation knows already.")
@click.option(
    "--register",
    "registered",
    is_flag=True,
    help="The measured frame and the reflector's place on the tool are unknown: fit them first.",
)
@click.option("--program", metavar="INPUT", help="CAM file: tell where along it the gap lies.")
@reading_options
@click.option("--tol-mm", type=float, help="Exit 1 if the gap (rms) is larger than this.")
@click.option(
    "-o",
    "--output",
    metavar="DIR",
    help="Folder of the report, the model and what to measure next.",
)
@standard_options
def command(session: Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Tell where a robot misses its model, which effect causes it, and how far that shrinks it.

    Names an effect only when the rows show it on poses that were not fitted; names all of a set
    that cannot be told apart; says "unexplained" rather than blame the nearest effect it knows.

    Writes report.html and model.toml, and, where further readings would tell more,
    next_measurements.csv to fill in with next_measurements.src and .dat that drive to the poses.
    Several measurement files count as one campaign.
    """
    from postproc.cell import load_cell
    from postproc.files import write_files
    from postproc.gap import diagnose, document, model_file, pose_problem, summary
    from postproc.jobs.measure_next import files as next_files
    from postproc.jobs.measure_next import keep_readings, measure_next
    from postproc.kinematics import build
    from postproc.measurement import read_campaign
    from postproc.model import load_model, save_model

    if options["output"]:
        keep_readings(Path(options["output"]))
    cell = load_cell(options["cell"])
    model = load_model(options["model"]) if options["model"] else None
    rows = read_campaign(options["measurements"])
    problem = pose_problem(rows, build(cell.robot), cell, model, options["registered"])
    with session.progress() as progress:
        diagnosis = diagnose(problem, progress)
    following = measure_next(diagnosis, cell)
    path = _path(options, diagnosis, cell)
    content = document(diagnosis, following.poses, path)
    if options["output"]:
        from postproc.report.pages.diagnosis import diagnosis_page

        folder = Path(options["output"])
        files = {
            folder / "report.html": diagnosis_page(diagnosis, content, cell, path),
            folder / "model.toml": save_model(model_file(diagnosis, model)),
        }
        more = next_files(following, diagnosis, cell)
        write_files(files | {folder / name: content for name, content in more.items()})
    session.document(content)
    for line in summary(content):
        session.show(line)
    tolerance = options["tol_mm"]
    return answer(tolerance is None or content["gap"]["rms_mm"] <= tolerance)


def _path(options: dict[str, Any], diagnosis: Diagnosis, cell: Cell) -> Along | None:
    if not options["program"]:
        return None
    from postproc.gap import along

    return along(diagnosis, read_cam(options["program"], options, cell), cell)
