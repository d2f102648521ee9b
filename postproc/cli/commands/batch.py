"""``postproc batch``: many inputs, resumable, checkable."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from postproc.cli.common import Session, answer, standard_options

if TYPE_CHECKING:
    from postproc.batch.jobs import Job
    from postproc.batch.run import BatchOptions, BatchOutcome

EPILOG = """\b
Examples:
  postproc batch parts/ --cell cell.toml -o out --jobs 4
  postproc batch holes.csv --cell cell.toml -o out --split region:500
  postproc batch parts/ --cell cell.toml -o out --check     (CI: is what is committed current?)
"""


@click.command(epilog=EPILOG)
@click.argument("inputs", nargs=-1, required=True, metavar="INPUT...")
@click.option("--cell", metavar="CELL.toml", help="The robot cell (or in batch.toml).")
@click.option("-o", "--output", required=True, metavar="DIR", help="Folder of the programs.")
@click.option("--config", metavar="BATCH.toml", help="Options per input.")
@click.option("-j", "--jobs", type=click.IntRange(min=1), help="Worker processes; default: cores.")
@click.option("--dask", metavar="ADDRESS", help="Run on this Dask cluster instead.")
@click.option("--split", metavar="RULE", help="region:MM, count:N or operation: large inputs.")
@click.option(
    "--format", "form", type=click.Choice(["auto", "apt", "csv", "delmia"]), default="auto"
)
@click.option("--units", type=click.Choice(["mm", "inch"]), help="Where an input names none.")
@click.option("--strategy", type=click.Choice(["smooth", "each", "global"]))
@click.option("--objective", help="axial, normal, radial, process.")
@click.option("--model", metavar="MODEL.toml", help="Compensate what this model predicts.")
@click.option("--timeout", type=click.FloatRange(min=0.1), help="Seconds per input.")
@click.option("--memory", type=click.FloatRange(min=0.5), help="GiB per worker.")
@click.option("--force", is_flag=True, help="Redo everything.")
@click.option("--prune", is_flag=True, help="Remove outputs whose input is gone.")
@click.option("--check", is_flag=True, help="Write nothing; compare with what is there.")
@click.option("--junit", metavar="FILE.xml", help="Write the outcome as JUnit XML.")
@standard_options
def command(session: Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Convert many inputs: files, folders, globs, or @LIST, a file with one of these a line.

    DIR/manifest.json holds what was made from what; a second run redoes only what changed or
    failed. One bad input never stops the others. With --check nothing is written and the exit
    code is 1 when a program in DIR is not what would be made now.
    """
    from postproc.batch.jobs import Overrides, find_inputs, load_overrides, make_jobs
    from postproc.batch.run import BatchOptions
    from postproc.pipeline.convert import ConvertRequest

    overrides = load_overrides(options["config"]) if options["config"] else Overrides({})
    base = ConvertRequest(
        source="",
        cell=options["cell"] or "",
        format=options["form"],
        units=options["units"],
        strategy=options["strategy"],
        objective=options["objective"],
        model=options["model"],
    )
    jobs = make_jobs(find_inputs(options["inputs"]), base, overrides)
    _require_cells(jobs)
    limits = BatchOptions(
        workers=options["jobs"] or os.cpu_count() or 1,
        dask=options["dask"],
        force=options["force"],
        prune=options["prune"],
        timeout=options["timeout"],
        memory=options["memory"],
        split=options["split"],
    )
    run = _check if options["check"] else _run
    return run(session, jobs, Path(options["output"]), limits, options["junit"])


def _require_cells(jobs: list[Job]) -> None:
    from postproc.errors import UsageError

    for job in jobs:
        if not job.request.cell:
            raise UsageError(
                "BAT004", f"no cell for {job.request.source}, give --cell or set it in --config"
            )


def _run(
    session: Session, jobs: list[Job], folder: Path, options: BatchOptions, junit: str | None
) -> int:
    from postproc.batch.junit import junit_xml
    from postproc.batch.run import run_batch
    from postproc.files import write_files

    with session.progress() as progress:
        outcome = run_batch(jobs, folder, options, progress)
    document = outcome.document()
    if junit:
        write_files({Path(junit): junit_xml(document["entries"])})
    for key in outcome.bad:
        for line in document["entries"][key]["errors"][:3]:
            session.say(line)
    session.document(document)
    _summary(session, outcome)
    return answer(outcome.good)


def _summary(session: Session, outcome: BatchOutcome) -> None:
    session.show(
        f"{len(outcome.keys)} inputs: {len(outcome.done)} done, {len(outcome.kept)} unchanged, "
        f"{len(outcome.bad)} failed"
    )
    if outcome.vanished:
        verb = "removed" if outcome.pruned else "left in place (--prune removes them)"
        session.show(f"{len(outcome.vanished)} files whose input is gone: {verb}")


def _check(
    session: Session, jobs: list[Job], folder: Path, options: BatchOptions, junit: str | None
) -> int:
    from postproc.batch.junit import junit_xml
    from postproc.batch.run import check_batch
    from postproc.files import write_files

    entries, reports = check_batch(jobs, folder, options)
    if junit:
        write_files({Path(junit): junit_xml(entries)})
    bad = [key for key, entry in entries.items() if entry["status"] != "ok"]
    session.document(
        {
            "schema": "postproc.batch_check/1",
            "same": not bad,
            "entries": entries,
            "differences": {name: report.to_dict() for name, report in reports.items()},
        }
    )
    for key in bad:
        for line in entries[key]["errors"]:
            session.say(line)
    for name, report in reports.items():
        session.show(f"{name}:\n{report.summary()}")
    session.show(f"{len(entries)} programs checked, {len(bad)} differ or fail")
    return answer(not bad)
