"""Measuring campaigns: rows, files, and the one registration."""

from postproc.measurement.campaign import read_campaign
from postproc.measurement.columns import (
    DIRECTION,
    EXPECTED,
    JOINTS,
    ORIENTATION,
    POSITION,
    SPEED,
    WRENCH,
)
from postproc.measurement.datum import BaseFit, DatumPoints, fit_base, read_datum_points
from postproc.measurement.readings import (
    Readings,
    has_points,
    only_points,
    only_told,
    readings_of,
    reads_points,
)
from postproc.measurement.registration import (
    fit_registration,
    frames_of,
    in_robroot,
    points_of,
    rigid_motion,
    unloaded_rows,
)
from postproc.measurement.repair import (
    labels_of,
    points_of_rows,
    repaired,
    tool_points,
    without_copies,
)
from postproc.measurement.rows import (
    MEAN_LENGTH,
    MeasurementSet,
    Remark,
    SetUps,
    robust_sigma,
    set_ups,
)
from postproc.measurement.table import cells, table_to_fill_in
