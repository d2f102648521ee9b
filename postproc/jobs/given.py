"""What a call is given: a cell, a part, a model, each as an object or as the file that holds it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell, shared_cell
from postproc.jobs.joint_targets import with_joint_targets
from postproc.jobs.unit_doubts import check_units
from postproc.kinematics import build
from postproc.model import ModelFile, ToolPath
from postproc.model import load_model as load_model_file
from postproc.process import bases_named, with_orientation
from postproc.readers import SurfaceNormals, read_options
from postproc.readers import read as read_file

Source = str | Path
"""A path, as text or as ``Path``."""


def cell_of(cell: Cell | Source) -> Cell:
    """Return a cell, or that of a file."""
    return cell if isinstance(cell, Cell) else shared_cell(str(cell))


def part_of(part: ToolPath | Source, cell: Cell) -> ToolPath:
    """Return a toolpath, or that of a CAM file, read with what a cell knows."""
    return part if isinstance(part, ToolPath) else read(part, cell)


def model_of(model: ModelFile | Source | None) -> ModelFile | None:
    """Return a model of the arm, or that of a file, None without any."""
    return load_model(model) if isinstance(model, Source) else model


def load_model(path: Source) -> ModelFile:
    """Return what a ``model.toml`` knows of an arm beyond its nominal geometry.

    Args:
        path: the model file.

    Returns:
        Its effects and its registration.

    Raises:
        DataError: if the file is wrong.
    """
    return load_model_file(str(path))


def read(
    path: Source,
    cell: Cell,
    *,
    format: str | None = None,
    dialect: str | None = None,
    units: str | None = None,
    columns: str | None = None,
    cycle_words: str | None = None,
    feed_units: str | None = None,
    arc_sense: str | None = None,
    head: str | None = None,
    task: str | None = None,
    accept_words: Sequence[str] | str = (),
    recover: bool = False,
) -> ToolPath:
    """Return the toolpath of a CAM file, in the CAM file's own coordinates.

    What is left open is read as ``[import]`` of the cell says.

    Args:
        path: APT/CL, CSV or DELMIA file, or whatever a registered reader reads.
        cell: tells the tool axis, and the surface where a CSV gives no normals.
        format: ``auto`` or the name of a reader; None: the cell's, else ``auto``.
        dialect: APT dialect: ``nx``, ``solidworks``, ``creo``, ``catia``, ``camworks``, ``fusion``,
            ``hsmworks``, ``mfgsuite``, ``camplete``, ``manusnc``, ``postworks``, ``surfcam``,
            ``apt``.
        units: ``mm`` or ``inch`` where the file names none.
        columns: columns of a CSV, such as ``id,x,y,z,i,j,k,-,depth``.
        cycle_words: meaning of the numbers of a positional drill cycle: ``depth,clearance,feed``.
        feed_units: ``mm`` or ``inch`` per minute where FEDRAT and UNITS contradict each other.
        arc_sense: ``ccw`` or ``cw`` about their vector, for arcs whose records leave it open.
        head: rotary axes of a G-code head, from the machine to the tool: ``C+z B+y``.
        task: DELMIA task to read instead of all that no other one calls.
        accept_words: words of the file that are harmless, besides those that the cell accepts; a
            text has commas between.
        recover: mend faults that have one possible meaning; each is listed in ``recovered``.

    Returns:
        Tags with their source lines, in SI.

    Raises:
        ReadError: if the file cannot be read as its format.
        UsageError: if an option is wrong.
    """
    call = {
        "dialect": dialect, "units": units, "columns": columns, "cycle_words": cycle_words,
        "feed_units": feed_units, "arc_sense": arc_sense, "head": head, "task": task,
        "accept_words": accept_words, "recover": recover,
    }  # fmt: skip
    axis, habits = cell.tool.known_axis, cell.reading
    options = read_options(
        call,
        habits,
        tool_axis=(np.nan,) * 3 if axis is None else tuple(float(v) for v in axis),
        surface_normals=_surface_normals(cell),
    )
    toolpath = read_file(path, format or habits.format, options)
    if np.isnan(toolpath.axes).any() and len(cell.tools) == 1:
        cell.tool.axis  # noqa: B018 - asks for the axis that the file's orientations need
    toolpath = with_orientation(with_joint_targets(toolpath, cell), cell)
    check_units(toolpath, cell)
    return toolpath


def _surface_normals(cell: Cell) -> SurfaceNormals | None:
    """Return the normals of the workpieces' meshes in the base of each row, None without any."""
    if not any(base.meshes for base in cell.bases):
        return None

    def normals(points: FloatArray, bases: Sequence[str] = (), /) -> FloatArray:
        from postproc.collision import Scene

        kinematics = build(cell.robot)
        entry = bases_named(bases or [""] * len(points), cell)
        found = np.tile([0.0, 0.0, 1.0], (len(points), 1))  # what no base claims stops later
        for index in np.unique(entry[entry >= 0]).tolist():
            rows = np.flatnonzero(entry == index)
            scene = Scene.shared(cell.with_tool(cell.tool_index, index), kinematics)
            found[rows] = scene.surface_normals(points[rows])
        return found

    return normals
