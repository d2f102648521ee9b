"""Keys of ``[import]``."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from postproc.cell.schema.table import Table, Text


class ImportTable(Table):
    """How CAM files are read where the call does not say; the same keys as its options."""

    format: Text = Field(
        default="auto", description="auto, apt, csv, delmia, gcode or another one of plugins"
    )
    dialect: Text | None = Field(
        default=None, description="dialect of APT or G-code; default: as the file shows"
    )
    units: Literal["mm", "inch", "m"] | None = Field(
        default=None, description="unit of length where the CAM file names none"
    )
    columns: Text | None = Field(
        default=None, description="columns of a CSV, e.g. id,x,y,z,i,j,k,-,depth; - is none"
    )
    cycle_words: Text | None = Field(
        default=None,
        description="meaning of the numbers of a positional drill cycle, e.g. depth,clearance,feed",
    )
    feed_units: Literal["mm", "inch"] | None = Field(
        default=None, description="per minute, where FEDRAT and UNITS of a CAM file contradict"
    )
    arc_sense: Literal["ccw", "cw"] | None = Field(
        default=None,
        description="way of arcs about their vector where their records leave it open, as half "
        "turns do; default: as the rest of the file shows",
    )
    head: Text | None = Field(
        default=None,
        description="rotary axes of the head of the machine that G-code was posted for, from the "
        "machine to the tool, each with the sense and CAM axis about which a growing angle turns "
        "the tool: C+z B+y; tip behind them: X, Y, Z are of the tool tip without G43.4 too",
    )
    task: Text | None = Field(
        default=None, description="DELMIA task to read instead of all that no other one calls"
    )
    accept_words: list[Text] = Field(
        default=[], description="words of CAM files that are known to be harmless; others stop"
    )
