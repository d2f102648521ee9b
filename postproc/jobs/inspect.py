"""What is in a CAM file, before any robot is involved."""

from __future__ import annotations

from functools import cached_property
from typing import Any

from postproc.cell import Cell
from postproc.errors import Finding
from postproc.jobs.given import Source, cell_of, reading_of
from postproc.model import ToolPath
from postproc.process import looks, word_findings
from postproc.readers import read, read_options
from postproc.report.inspection import cell_tables, inspection, text_lines


class Inspection:
    """What was read from a CAM file: ``part``, its findings, its figures."""

    def __init__(self, part: ToolPath) -> None:
        self.part = part

    @cached_property
    def document(self) -> dict[str, Any]:
        """The ``postproc.inspect/1`` document, as ``inspect --json`` prints it."""
        return inspection(self.part)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Words that ``convert`` would refuse, doubts about the points, and the reader's own."""
        part = self.part
        return (*word_findings(part), *looks(part), *part.warnings, *part.recovered)

    @property
    def summary(self) -> tuple[str, ...]:
        """The figures in words, line by line, with tables for the cell to fill in."""
        tables = cell_tables(self.part)
        more = (f"\nfor the cell, to be filled in:\n\n{tables}",) if tables else ()
        return (*text_lines(self.part), *more)


def inspect(
    path: Source,
    cell: Cell | Source | None = None,
    *,
    recover: bool = False,
    **keys: Any,  # noqa: ANN401 - as of ``read``
) -> Inspection:
    """Return what is in a CAM file, before any robot is involved.

    Args:
        path: the file.
        cell: its ``[import]`` fills what is left open; None: the file alone.
        recover: as of ``read``.
        keys: keys of ``[import]``, as of ``read``.

    Returns:
        ``part``, ``document``, ``findings``, ``summary``.

    Raises:
        ReadError: if the file cannot be read as its format.
        TypeError: for an option that is none.
        UsageError: if an option is wrong.
    """
    reading = reading_of(None if cell is None else cell_of(cell), keys)
    return Inspection(read(path, read_options(reading, recover=recover, points_only=True)))
