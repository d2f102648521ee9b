"""What is in a CAM file, before any robot is involved."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from types import SimpleNamespace
from typing import Any

from postproc.cell import Cell, Reading
from postproc.errors import Finding
from postproc.model import ToolPath
from postproc.process import looks, word_findings
from postproc.readers import ReadOptions, filled, read
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


def inspect(source: str, options: Mapping[str, Any], cell: Cell | None = None) -> Inspection:
    """Read a CAM file without asking for what only a cell knows.

    Args:
        source: the file.
        options: ``format`` and fields of ``ReadOptions``; None: as the cell says.
        cell: its ``[import]`` fills what is left open.

    Raises:
        ReadError: if the file cannot be read as its format.
        UsageError: if an option is wrong.
    """
    call, habits = SimpleNamespace(**options), Reading() if cell is None else cell.reading
    words = ReadOptions(accept_words=call.accept_words).accepted_words
    given = ReadOptions(
        **filled(call, habits),
        points_only=True,
        recover=call.recover,
        accept_words=(*habits.accept_words, *words),
    )
    return Inspection(read(source, call.format or habits.format, given))
