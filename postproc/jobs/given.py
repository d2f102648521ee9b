"""What a call is given: a cell, a part, a model, each as an object or as the file that holds it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import CALL_KEYS, Cell, Reading, call_keys, shared_cell
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
    recover: bool = False,
    **keys: Any,  # noqa: ANN401 - keys of the cell
) -> ToolPath:
    """Return the toolpath of a CAM file, in the CAM file's own coordinates.

    Args:
        path: APT/CL, CSV, DELMIA or G-code file, or whatever a registered reader reads.
        cell: tells the tool axis, how files are read, and the surface where a CSV gives no normals.
        recover: mend faults that have one possible meaning; each is listed in ``recovered``.
        keys: keys of ``[import]``, instead of those of the cell: ``format``, ``dialect``,
            ``units``, ``columns``, ``cycle_words``, ``feed_units``, ``arc_sense``, ``head``,
            ``task``, and ``accept_words`` (a list, or a text with commas between) besides those
            that the cell accepts; None and empty texts leave the cell's own.

    Returns:
        Tags with their source lines, in SI.

    Raises:
        ReadError: if the file cannot be read as its format.
        TypeError: for a key that ``[import]`` does not have.
        UsageError: if a value is wrong.
    """
    reading, axis = reading_of(cell, keys), cell.tool.known_axis
    options = read_options(
        reading,
        recover=recover,
        tool_axis=(np.nan,) * 3 if axis is None else tuple(float(v) for v in axis),
        surface_normals=_surface_normals(cell),
    )
    toolpath = read_file(path, options)
    if np.isnan(toolpath.axes).any() and len(cell.tools) == 1:
        cell.tool.axis  # noqa: B018 - asks for the axis that the file's orientations need
    toolpath = with_orientation(with_joint_targets(toolpath, cell), cell)
    check_units(toolpath, cell)
    return toolpath


def reading_of(cell: Cell | None, keys: Mapping[str, Any]) -> Reading:
    """Return how files are read: as the keys of a call say, else as the cell does."""
    own = Reading() if cell is None else cell.reading
    return own.with_keys(known_keys(keys, [key.name for key in fields(Reading)]))


def known_keys(keys: Mapping[str, Any], known: Iterable[str] = CALL_KEYS) -> dict[str, Any]:
    """Return what a call gives in place of keys of the cell; TypeError for a key that is none."""
    for name in keys:
        if name not in known:
            raise TypeError(f"no option {name!r}, known are {', '.join(known)}, recover")
    return call_keys(keys)


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
