"""Places from Python: where a part stands best, and where it stands by its datum points."""

from __future__ import annotations

from collections.abc import Sequence

from postproc.api.cells import Cell, Source, cell_of
from postproc.api.parts import read
from postproc.jobs.fit_base import BaseJob, base_of_points
from postproc.jobs.place import PlaceJob
from postproc.jobs.place import place as place_part
from postproc.model import ToolPath
from postproc.progress import Progress


def place(
    part: ToolPath | Source,
    cell: Cell | Source,
    box_mm: Sequence[float] | None = None,
    *,
    free: str = "xyz",
    move: str = "part",
    progress: Progress | None = None,
) -> PlaceJob:
    """Return the best place for a job: every tag in reach, then stiff, clear and unwound.

    Args:
        part: a toolpath of ``read``, or a file.
        cell: a cell of ``load_cell``, or a file.
        box_mm: (6,) lowest and highest corner of where the origin of what moves may be: of the part
            in the robot root, of the robot in the world; None: wherever the arm reaches.
        free: ``xyz``, or ``xyzA`` with turns about the vertical.
        move: ``part``, ``robot``, or ``rail`` with the robot on it.
        progress: called with (done, total, what).

    Returns:
        ``good``, ``frame``, ``findings``, ``document``, ``cell_file(output)``.

    Raises:
        CellError: CEL043 to move a rail that the cell does not have.
        UsageError: CLI016 for a box that is none, or none without a solid of the workpiece.
    """
    known = cell_of(cell)
    path = part if isinstance(part, ToolPath) else read(part, known)
    return place_part(path, known, box_mm, free, move, progress)


def fit_base(
    points: Source,
    cell: Cell | Source,
    *,
    base: int | None = None,
    part: ToolPath | Source | None = None,
) -> BaseJob:
    """Return the base that fits datum points: nominal on the part, measured in the robot root.

    Args:
        points: CSV ``id,x_mm,y_mm,z_mm,mx_mm,my_mm,mz_mm`` and, where known, ``sigma_mm``.
        cell: a cell of ``load_cell``, or a file.
        base: BASE number, in a cell with several.
        part: whose holes are asked how sure they are.

    Returns:
        ``good``, ``frame``, ``findings``, ``document``, ``base_data``, ``cell_file(output)``.

    Raises:
        DataError: if the file holds no points, or too few of them.
        CellError: if the cell has no such base, or several and none is asked for.
    """
    known = cell_of(cell)
    path = part if isinstance(part, ToolPath) or part is None else read(part, known)
    return base_of_points(str(points), known, base, path)
