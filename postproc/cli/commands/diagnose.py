"""``postproc diagnose``: the sim-to-real gap of a measured robot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from postproc.cli.common import (
    CELL,
    POSITIVE,
    TOOL,
    Session,
    answer,
    option,
    read_cam,
    reading_options,
    standard_options,
)

if TYPE_CHECKING:
    from postproc.jobs.diagnose import DiagnosisJob
    from postproc.jobs.diagnose_trace import PathJob

POSES_ONLY = ("registered", "before", "self_check", "accept")
"""Options that need a campaign of poses."""
EPILOG = """\b
Examples:
  postproc diagnose measured.csv --cell cell.toml -o out
  postproc diagnose tracker.csv --cell cell.toml --register --json
  postproc diagnose measured.csv --cell cell.toml --program part.cls -o out
  postproc diagnose after.csv --before measured.csv --cell cell.toml --model out/model.toml
  postproc diagnose measured.csv --cell cell.toml --self-check
  postproc diagnose measured.csv out/next_measurements.csv --cell cell.toml -o out2
  postproc diagnose --trace log.csv --cell cell.toml -o out
"""


@click.command(epilog=EPILOG)
@click.argument("measurements", metavar="MEAS.csv...", nargs=-1)
@option(
    "--trace",
    metavar="LOG.csv",
    help="Recording of a path instead of poses: commanded and actual joints, tool point.",
)
@CELL
@TOOL
@option("--model", metavar="MODEL.toml", help="Model of the arm that is already known.")
@option(
    "--register",
    "registered",
    is_flag=True,
    help="The measured frame and the reflector's place on the tool are unknown: fit them first.",
)
@option(
    "--before",
    multiple=True,
    metavar="BEFORE.csv",
    help="Campaign before compensation: predicted against measured, by the ids of the rows.",
)
@option(
    "--self-check",
    "self_check",
    is_flag=True,
    help="Put each effect at 0.3, 1 and 3 times its usual size into these rows, and report how"
    " often it is named, missed, or blamed on another.",
)
@option(
    "--trials",
    kind=click.IntRange(1, 100),
    default=1,
    help="Arms of each effect and size. [1]",
    show_default=False,
)
@option(
    "--accept",
    multiple=True,
    metavar="EFFECT",
    help="Write this effect into the model although the instrument may have caused the same.",
)
@option(
    "--program",
    metavar="INPUT",
    help="CAM file: report where along it the gap lies; with --trace the KRL program that was run.",
)
@option("--against", metavar="INPUT", help="With --trace: the CAM file that was run.")
@reading_options
@option("--tol-mm", kind=POSITIVE, help="Exit 1 if the gap (rms) is larger than this.")
@option(
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

    With --trace a recording of a path is diagnosed: delay, lag, reversals, vibration.
    """
    from postproc.cell import load_cell
    from postproc.jobs.diagnose import diagnose
    from postproc.jobs.measure_next import keep_readings
    from postproc.model import load_model
    from postproc.process import word_findings, words_settled

    if bool(options["measurements"]) == bool(options["trace"]):
        text = "expected MEAS.csv, or --trace LOG.csv"
        raise click.UsageError(text)
    if options["against"] and not options["trace"]:
        raise click.UsageError("--against goes with --trace")
    if options["trace"]:
        return _trace(session, options)
    if options["output"]:
        keep_readings(Path(options["output"]))
    cell = load_cell(options["cell"]).for_tool(options["tool"])
    model = load_model(options["model"]) if options["model"] else None
    toolpath = read_cam(options["program"], options, cell) if options["program"] else None
    if toolpath is not None:
        session.findings(word_findings(words_settled(toolpath, cell)))
    with session.progress() as progress:
        job = diagnose(
            options["measurements"],
            cell,
            model=model,
            register=options["registered"],
            tool=options["tool"],
            program=toolpath,
            before=options["before"],
            self_check_trials=options["trials"] if options["self_check"] else 0,
            progress=progress,
        )
    job.accept(options["accept"])
    return _answered(session, options, job)


def _trace(session: Session, options: dict[str, Any]) -> int:
    """Diagnose a recorded path."""
    from postproc.cell import load_cell
    from postproc.jobs.diagnose_trace import diagnose_trace
    from postproc.model import load_model

    for name in POSES_ONLY:
        if options[name]:
            raise click.UsageError(f"--{name.replace('_', '-')} does not go with --trace")
    cell = load_cell(options["cell"]).for_tool(options["tool"])
    model = load_model(options["model"]) if options["model"] else None
    if options["program"] and options["against"]:
        raise click.UsageError("--program or --against, not both")
    toolpath = read_cam(options["against"], options, cell) if options["against"] else None
    with session.progress() as progress:
        job = diagnose_trace(options["trace"], cell, model, progress, options["program"], toolpath)
    return _answered(session, options, job)


def _answered(session: Session, options: dict[str, Any], job: DiagnosisJob | PathJob) -> int:
    """Write the files that are asked for, tell the answer, and return the exit code."""
    if options["output"]:
        job.write(options["output"])
    session.document(job.document)
    for line in job.summary:
        session.show(line)
    tolerance = options["tol_mm"]
    return answer(tolerance is None or job.document["gap"]["rms_mm"] <= tolerance)
