"""Parts from Python: read a CAM file, look at it, or make holes from arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from numpy.typing import ArrayLike

from postproc.api.cells import Cell, Source, cell_of
from postproc.jobs.convert import ConvertRequest, read_toolpath
from postproc.jobs.inspect import Inspection
from postproc.jobs.inspect import inspect as inspect_file
from postproc.model import ModelFile, ToolPath
from postproc.model import load_model as load_model_file
from postproc.readers import HABITS, holes_of


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
    request = ConvertRequest(
        source=str(path),
        cell=cell.path,
        format=format,
        dialect=dialect,
        units=units,
        columns=columns,
        cycle_words=cycle_words,
        feed_units=feed_units,
        arc_sense=arc_sense,
        head=head,
        task=task,
        accept_words=accept_words if isinstance(accept_words, str) else tuple(accept_words),
        recover=recover,
    )
    return read_toolpath(request, cell)


def inspect(
    path: Source,
    cell: Cell | Source | None = None,
    **reading: Any,  # noqa: ANN401 - as of ``read``
) -> Inspection:
    """Return what is in a CAM file, before any robot is involved.

    Args:
        path: the file.
        cell: its ``[import]`` fills what is left open; None: the file alone.
        reading: how the file is read, as of ``read``.

    Returns:
        ``part``, ``document``, ``findings``, ``summary``.

    Raises:
        ReadError: if the file cannot be read as its format.
        TypeError: for an option that is none.
        UsageError: if an option is wrong.
    """
    options = {name: None for name in ("format", *HABITS)} | {"accept_words": (), "recover": False}
    unknown = sorted(set(reading) - set(options))
    if unknown:
        raise TypeError(f"no option {unknown[0]!r}, known are {', '.join(options)}")
    return inspect_file(str(path), options | reading, None if cell is None else cell_of(cell))


def holes(
    xyz_mm: ArrayLike,
    axes: ArrayLike,
    *,
    depth: ArrayLike | None = None,
    feed: ArrayLike | None = None,
    rpm: ArrayLike | None = None,
    peck: ArrayLike | None = None,
    dwell: ArrayLike | None = None,
    diameter: ArrayLike | None = None,
    clearance: ArrayLike | None = None,
    retract: ArrayLike | None = None,
    names: Sequence[str] | None = None,
    name: str = "holes",
) -> ToolPath:
    """Return holes from arrays, as a point list with these columns gives them.

    Args:
        xyz_mm: (n, 3) points on the surface, CAM coordinates.
        axes: (n, 3) from the tip of the tool to its holder.
        depth: of the holes [mm], one number or (n,), as all below; None: points to touch.
        feed: [mm/min]; None: the cell's.
        rpm: spindle speed [1/min], negative: counterclockwise; None: the cell's.
        peck: step of deep holes [mm].
        dwell: at the bottom [s].
        diameter: of the holes [mm].
        clearance: height where the feed starts [mm].
        retract: height where the tool ends [mm].
        names: (n,) ids.
        name: of the part and its program.

    Returns:
        Tags whose source line is their number, for ``convert`` and ``stiffness``.

    Raises:
        ReadError: if a number cannot be, such as a negative depth.
        UsageError: CSV041 for arrays of another shape, or numbers that are not finite.
    """
    columns = {
        "depth": depth, "feed": feed, "spindle": rpm, "peck": peck, "dwell": dwell,
        "diameter": diameter, "clearance": clearance, "retract": retract,
    }  # fmt: skip
    return holes_of(name, xyz_mm, axes, columns, names)
