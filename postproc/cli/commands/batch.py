"""``postproc batch``: many inputs, resumable, checkable."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from postproc.cli import common as cli

if TYPE_CHECKING:
    from collections.abc import Iterable

    from postproc.batch import BatchOptions, BatchOutcome, Job


@cli.command("""
  postproc batch parts/ --cell cell.toml -o out --jobs 4
  postproc batch holes.csv --cell cell.toml -o out --split region:500
  postproc batch parts/ --cell cell.toml -o out --check     (CI: is what is committed current?)
""")
@click.argument("inputs", nargs=-1, required=True, metavar="INPUT...")
@cli.option("--cell CELL.toml", "The robot cell (or in batch.toml).")
@cli.option("-o, --output DIR", "Folder of the programs.", required=True)
@cli.option("--config BATCH.toml", "Options per input.")
@cli.option("-j, --jobs", "Worker processes; default: one per core.", click.IntRange(min=1))
@cli.option("--dask ADDRESS", "Run on this Dask cluster instead.")
@cli.option("--split RULE", "region:MM, count:N or operation: large inputs.")
@cli.reading_options
@cli.planning_options
@cli.option("--timeout", "Seconds per input.", cli.NumberRange(min=0.1))
@cli.option("--memory", "GiB per worker.", cli.NumberRange(min=0.5))
@cli.option("--force", "Redo everything.")
@cli.option("--prune", "Remove outputs whose input is gone.")
@cli.option("--check", "Write nothing; compare with what is there.")
@cli.option(
    "--report FILE.html", "A page of all inputs, with one of each in the folder FILE beside it."
)
@cli.option("--junit FILE.xml", "Write the outcome as JUnit XML.")
def command(session: cli.Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Convert many inputs: files, folders, globs, or @LIST, a file with one of these a line.

    DIR/manifest.json holds what was made from what; a second run redoes only what changed, or what
    a limit or a lost worker has stopped. One bad input never stops the others. With --check nothing
    is written and the exit code is 1 when a program in DIR is not what would be made now.
    """
    from postproc.batch import BatchOptions, call_of
    from postproc.jobs.convert import ConvertRequest

    options["cell"] = options["cell"] or ""
    base = ConvertRequest(source="", **cli.requested(options))
    pages = _pages(options["report"])
    limits = BatchOptions(options["jobs"], pages=pages, **cli.given(BatchOptions, options))
    jobs, remarks = call_of(options["inputs"], base, limits, options["config"])
    for remark in remarks:
        session.say(remark)
    folder = Path(options["output"])
    if options["check"]:
        return _check(session, jobs, folder, limits, options["junit"])
    return _run(session, jobs, folder, limits, options["junit"], options["report"])


def _run(
    session: cli.Session,
    jobs: list[Job],
    folder: Path,
    options: BatchOptions,
    junit: str | None,
    report: str | None,
) -> int:
    from postproc.batch import junit_xml, run_batch
    from postproc.errors import ExitCode
    from postproc.files import write_files
    from postproc.report.pages.batch import batch_page

    try:
        with ticker(session) as progress:
            outcome = run_batch(jobs, folder, options, progress)
    except KeyboardInterrupt:
        session.say(f"{folder}:1: error CLI130: interrupted; the same call goes on from here")
        return ExitCode.INTERRUPTED
    document = outcome.document()
    if junit:
        write_files({Path(junit): junit_xml(document["entries"])})
    if report:
        write_files({Path(report): batch_page(document, _links(Path(report), document["entries"]))})
    for key in outcome.bad:
        for line in document["entries"][key]["errors"][:3]:
            session.error(line)
    for line in outcome.warnings():
        session.say(line)
    if outcome.unsaved:
        session.error(outcome.unsaved)
    session.document(document)
    _summary(session, outcome)
    return cli.answer(outcome.good)


def _pages(report: str | None) -> Path | None:
    """Return the folder of the pages of the inputs: beside the page of the batch."""
    return None if report is None else Path(report).with_suffix("")


def _links(report: Path, keys: Iterable[str]) -> dict[str, str]:
    """Return the addresses of the inputs' own pages, seen from the page of the batch."""
    from urllib.parse import quote

    from postproc.batch import page_file

    pages = {key: page_file(report.with_suffix(""), key) for key in keys}
    return {k: quote(f"{p.parent.name}/{p.name}") for k, p in pages.items() if p.is_file()}


def _summary(session: cli.Session, outcome: BatchOutcome) -> None:
    count = len(outcome.keys)
    again = len(outcome.kept) - len(outcome.unchanged)
    remark = f" ({again} not tried again since nothing changed; --force does)" if again else ""
    session.show(
        f"converted {len(outcome.converted)} of {count}, failed {len(outcome.bad)}{remark}, "
        f"unchanged {len(outcome.unchanged)}"
    )
    if outcome.removed:
        session.show(f"{len(outcome.removed)} files of earlier programs removed")
        for name in outcome.removed[:20]:
            session.show(f"  {name}")
    if outcome.vanished:
        verb = "removed" if outcome.pruned else "left in place (--prune removes them)"
        session.show(f"{len(outcome.vanished)} files whose input is gone: {verb}")
        for name in outcome.vanished[:20]:
            session.show(f"  {name}")


def _check(
    session: cli.Session, jobs: list[Job], folder: Path, options: BatchOptions, junit: str | None
) -> int:
    from postproc.batch import check_batch, junit_xml
    from postproc.files import write_files

    with ticker(session) as progress:
        checked = check_batch(jobs, folder, options, progress)
    if junit:
        write_files({Path(junit): junit_xml(checked.entries)})
    session.document(checked.document())
    for key in checked.bad:
        for line in checked.entries[key]["errors"]:
            session.error(line)
    for name, report in checked.reports.items():
        session.show(f"{name}:\n{report.summary()}")
    session.show(f"checked {len(checked.entries)}, different or failed {len(checked.bad)}")
    return cli.answer(not checked.bad)


Tick = Callable[[int, int, int], None]
"""Takes (done, of how many, how many of them failed)."""

EVERY = 30.0
"""Longest time [s] between two lines in a pipe while jobs finish."""


@contextmanager
def ticker(session: cli.Session) -> Iterator[Tick]:
    """Yield what shows the progress of a batch on stderr; nothing with ``--quiet``."""
    if session.quiet:
        yield lambda done, total, failed: None
    elif sys.stderr.isatty():
        with _bar() as bar:
            yield bar
    else:
        yield Lines(session.say)


class Lines:
    """One line for every tenth of the work, and at least every ``EVERY`` seconds of a ``clock``."""

    def __init__(
        self, say: Callable[[str], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._say, self._clock = say, clock
        self._start = self._last = clock()
        self._tenths = 0

    def __call__(self, done: int, total: int, failed: int) -> None:
        """Take note of a finished job."""
        now, tenths = self._clock(), 10 * done // total
        if tenths == self._tenths and now - self._last < EVERY:
            return
        self._tenths, self._last = tenths, now
        self._say(f"{done} of {total}, {speed(done, total, now - self._start)}, {failed} failed")


def speed(done: int, total: int, seconds: float) -> str:
    """Return rate and time left in words."""
    if seconds <= 0.0 or not done:
        return "just begun"
    rate = done / seconds
    left = (total - done) / rate
    pace = f"{rate:.1f} per s" if rate >= 1.0 else f"{60.0 * rate:.1f} per min"
    return f"{pace}, {int(left // 3600)}:{int(left // 60) % 60:02d}:{int(left) % 60:02d} left"


@contextmanager
def _bar() -> Iterator[Tick]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns: tuple[Any, ...] = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.description}"))
    start = time.monotonic()
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=None)

        def report(done: int, total: int, failed: int) -> None:
            words = f"{speed(done, total, time.monotonic() - start)}, {failed} failed"
            bar.update(task, completed=done, total=total, description=words)

        yield report
