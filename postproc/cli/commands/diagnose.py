"""``postproc diagnose``: the sim-to-real gap of a measured robot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from postproc.cli import common as cli

if TYPE_CHECKING:
    from postproc.jobs.diagnose import DiagnosisJob
    from postproc.jobs.diagnose_trace import PathJob

POSES_ONLY = ("register", "before", "self_check", "accept")
"""Options that need a campaign of poses."""


@cli.command("""
  postproc diagnose measured.csv --cell cell.toml -o out
  postproc diagnose tracker.csv --cell cell.toml --register --json
  postproc diagnose measured.csv --cell cell.toml --program part.cls -o out
  postproc diagnose after.csv --before measured.csv --cell cell.toml --model out/model.toml
  postproc diagnose measured.csv --cell cell.toml --self-check
  postproc diagnose measured.csv out/next_measurements.csv --cell cell.toml -o out2
  postproc diagnose --trace log.csv --cell cell.toml -o out
""")
@click.argument("measurements", metavar="MEAS.csv...", nargs=-1)
@cli.option(
    "--trace LOG.csv",
    "Recording of a path instead of poses: commanded and actual joints, tool point.",
)
@cli.CELL
@cli.TOOL
@cli.option("--model MODEL.toml", "Model of the arm that is already known.")
@cli.option(
    "--register",
    "The measured frame and the reflector's place on the tool are unknown: fit them first.",
)
@cli.option(
    "--before BEFORE.csv",
    "Campaign before compensation: predicted against measured, by the ids of the rows.",
    multiple=True,
)
@cli.option(
    "--self-check",
    "Put each effect at 0.3, 1 and 3 times its usual size into these rows, and report how"
    " often it is named, missed, or blamed on another.",
)
@cli.option(
    "--trials",
    "Arms of each effect and size. [1]",
    click.IntRange(1, 100),
    default=1,
    show_default=False,
)
@cli.option(
    "--accept EFFECT",
    "Write this effect into the model although the instrument may have caused the same.",
    multiple=True,
)
@cli.option(
    "--program INPUT",
    "CAM file: report where along it the gap lies; with --trace the KRL program that was run.",
)
@cli.option("--against INPUT", "With --trace: the CAM file that was run.")
@cli.reading_options
@cli.option("--tol-mm", "Exit 1 if the gap (rms) is larger than this.", cli.POSITIVE)
@cli.option("-o, --output DIR", "Folder of the report, the model and what to measure next.")
def command(session: cli.Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
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
    toolpath = cli.read_cam(options["program"], options, cell) if options["program"] else None
    if toolpath is not None:
        session.findings(word_findings(words_settled(toolpath, cell)))
    with session.progress() as progress:
        job = diagnose(
            options["measurements"],
            cell,
            model=model,
            register=options["register"],
            tool=options["tool"],
            program=toolpath,
            before=options["before"],
            self_check_trials=options["trials"] if options["self_check"] else 0,
            progress=progress,
        )
    job.accept(options["accept"])
    return _answered(session, options, job)


def _trace(session: cli.Session, options: dict[str, Any]) -> int:
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
    toolpath = cli.read_cam(options["against"], options, cell) if options["against"] else None
    with session.progress() as progress:
        job = diagnose_trace(options["trace"], cell, model, progress, options["program"], toolpath)
    return _answered(session, options, job)


def _answered(session: cli.Session, options: dict[str, Any], job: DiagnosisJob | PathJob) -> int:
    """Write the files that are asked for, tell the answer, and return the exit code."""
    if options["output"]:
        job.write(options["output"])
    session.document(job.document)
    for line in job.summary:
        session.show(line)
    tolerance = options["tol_mm"]
    return cli.answer(tolerance is None or job.document["gap"]["rms_mm"] <= tolerance)
