"""The keys of ``cell.toml``: types, units, ranges, defaults and meaning, in file units.

This is the only place where a key of the cell is described and has its default; the reference page
is generated from it. ``postproc.cell.file`` turns it into SI units.
"""

from postproc.cell.schema.cellfile import (
    CALL_KEYS,
    CellFile,
    CutterTable,
    Reading,
    ToolTable,
    WorkpieceTable,
    call_keys,
)
from postproc.cell.schema.krl import HooksTable, KrlOptions
from postproc.cell.schema.measuring import Instrument
from postproc.cell.schema.motion import Motion, Process, Thin
from postproc.cell.schema.optimize import Limits, Optimize, TiltRange
from postproc.cell.schema.robot import DimensionsTable, ExternalAxisTable, RobotTable
from postproc.cell.schema.table import (
    Options,
    Placement,
    Read,
    Solid,
    Table,
    ToolSolid,
    key_said,
    tables_in,
)
