"""Cells from Python: load, draft and check one, ask its arm, plan measurements in it."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import BoolArray, FloatArray
from postproc.cell import Cell as CellValues
from postproc.cell import shared_cell
from postproc.errors import UsageError
from postproc.geometry import inverse, rotation_from_abc, transform
from postproc.jobs.given import Source
from postproc.jobs.new_cell import OPTIONS, CellDraft, draft_cell, draft_from_backup, require_free
from postproc.kinematics import build
from postproc.units import DEG, MM

_KEPT = 8
_FRAMES = ("robroot", "base", "world")


class Cell(CellValues):
    """A robot cell that scripts can ask: forward and inverse kinematics, collisions.

    Angles are degrees, frames 4 x 4 matrices with lengths in mm. External axes stand at 0.
    """

    __slots__ = ()

    def fk(self, q_deg: ArrayLike, *, frame: str = "robroot") -> FloatArray:
        """Return where the tool in work stands.

        Args:
            q_deg: (..., 6) joint angles A1..A6 [deg].
            frame: in which the answer is: ``robroot``, ``base`` (CAM coordinates) or ``world``.

        Returns:
            (..., 4, 4) tool point and axes of the TCP frame, lengths in mm.

        Raises:
            UsageError: CEL034 for another shape or frame.
        """
        T = build(self.robot).fk(_angles(q_deg) * DEG) @ np.asarray(self.tool.T_flange_tcp)
        return _scaled(self._root(frame) @ T, 1.0 / MM)

    def ik(self, T_mm: ArrayLike, *, frame: str = "robroot") -> FloatArray:
        """Return all joint angles within the limits that put the tool in work to a pose.

        Args:
            T_mm: (4, 4) pose of the TCP frame, lengths in mm.
            frame: in which it is given, as of ``fk``.

        Returns:
            (k, 6) [deg], with every whole turn that the limits leave; k = 0 where the arm does not
            get there. The cell's margins and singularities are not asked.

        Raises:
            UsageError: CEL034 for another shape or frame.
        """
        T = np.asarray(T_mm, dtype=np.float64)
        is_pose = T.shape == (4, 4) and np.isfinite(T).all()
        if not is_pose or not np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=_ORTHONORMAL):
            raise UsageError("CEL034", "expected a pose as one finite (4, 4) matrix, lengths in mm")
        kinematics = build(self.robot)
        T_robroot_tcp = inverse(self._root(frame)) @ _scaled(T, MM)
        q, valid = kinematics.ik(T_robroot_tcp @ inverse(np.asarray(self.tool.T_flange_tcp)))
        return np.asarray(kinematics.turns(q[valid])[0] / DEG)

    def collides(self, q_deg: ArrayLike, *, cutting: bool = False) -> BoolArray:
        """Return whether the arm, the tool in work and all solids of the cell meet anywhere.

        Args:
            q_deg: (..., 6) joint angles A1..A6 [deg].
            cutting: the tool works here: its cutter may touch the workpiece.

        Returns:
            (...,) whether solids are nearer than the cell's ``clearance_mm``, or meet.

        Raises:
            CellError: if a mesh file is broken.
            UsageError: CEL034 for another shape.
        """
        from postproc.collision import Scene

        q = _angles(q_deg) * DEG
        hits = Scene.shared(self, build(self.robot)).check(q.reshape(-1, 6), cutting)
        return np.asarray(hits.hit).reshape(q.shape[:-1])

    def with_workpiece_at(
        self, xyz_mm: Sequence[float], abc_deg: Sequence[float] = (0.0, 0.0, 0.0)
    ) -> Cell:
        """Place the workpiece in work elsewhere, with its solids.

        Args:
            xyz_mm: (3,) CAM origin in the robot root.
            abc_deg: (3,) turn of the CAM axes, KUKA A, B, C.

        Returns:
            The cell with it there; this one stays as it is.

        Raises:
            UsageError: CEL034 if these are not three finite numbers each.
        """
        xyz, abc = np.asarray(xyz_mm, dtype=np.float64), np.asarray(abc_deg, dtype=np.float64)
        if xyz.shape != (3,) or abc.shape != (3,) or not np.isfinite([xyz, abc]).all():
            raise UsageError("CEL034", "expected a place of three numbers and a turn of three")
        T = transform(rotation_from_abc(abc * DEG), xyz * MM)
        bases = list(self.bases)
        bases[self.base_index] = replace(self.workpiece, T_robroot_base=T)
        moved: Cell = replace(self, bases=tuple(bases))
        return moved

    def _root(self, frame: str) -> FloatArray:
        """Return T_frame_robroot (4, 4) [m]."""
        if frame not in _FRAMES:
            raise UsageError("CEL034", f"no frame {frame!r}, known are {', '.join(_FRAMES)}")
        if frame == "robroot":
            return np.eye(4)
        at = self.robot.T_world_robroot if frame == "world" else inverse(self.T_robroot_base)
        return np.asarray(at)


_ORTHONORMAL = 1e-6
"""How far the columns of a rotation may be from unit and square."""


def _angles(q_deg: ArrayLike) -> FloatArray:
    q = np.asarray(q_deg, dtype=np.float64)
    if q.ndim == 0 or q.shape[-1] != 6 or not np.isfinite(q).all():
        raise UsageError("CEL034", f"expected finite angles (..., 6) [deg], not {q.shape}")
    return q


def _scaled(T: FloatArray, factor: float) -> FloatArray:
    scaled = np.array(T)
    scaled[..., :3, 3] *= factor
    return scaled


_SCRIPTED: OrderedDict[int, tuple[CellValues, Cell]] = OrderedDict()


def _scripted(values: CellValues) -> Cell:
    """Return a cell with what scripts ask of it: the same one for the same values."""
    known = _SCRIPTED.get(id(values))
    if known is None or known[0] is not values:
        fresh = Cell(**{field.name: getattr(values, field.name) for field in fields(values)})
        known = _SCRIPTED[id(values)] = (values, fresh)
    while len(_SCRIPTED) > _KEPT:
        _SCRIPTED.popitem(last=False)
    return known[1]


def cell_of(cell: CellValues | Source) -> Cell:
    """Return a cell, or that of a file, as scripts see it."""
    if isinstance(cell, Cell):
        return cell
    return _scripted(cell) if isinstance(cell, CellValues) else load_cell(cell)


def load_cell(path: Source) -> Cell:
    """Return the cell of a ``cell.toml``; the same object until one of its files changes.

    Args:
        path: the cell file.

    Returns:
        The cell, read-only.

    Raises:
        CellError: if the file or something that it names is wrong.
        ReadError: if the file is missing.
    """
    return _scripted(shared_cell(str(path)))


def new_cell(path: Source = "cell.toml", **options: Any) -> CellDraft:  # noqa: ANN401 - as of new-cell
    """Return a new cell file, every key with its meaning; nothing is on disk before ``write``.

    Args:
        path: where it is to be; meshes and a URDF are named from there.
        options: as of ``new-cell``, with ``_`` for ``-``: ``robot`` or ``urdf`` (``tip``), or
            ``backup``; ``tool_xyz`` [mm], ``tool_abc`` [deg], ``tool_axis``, ``tool_mass`` [kg],
            ``workpiece_xyz``, ``workpiece_abc``, ``tool_mesh``, ``workpiece_mesh`` (lists),
            ``home`` (six [deg], or () for none), ``spindle``, ``spindle_rpm``, ``feed`` [mm/min],
            ``input`` (place the workpiece for this file), ``force`` (overwrite).

    Returns:
        The draft: ``text``, ``document``, ``write()``.

    Raises:
        CellError: if the cell could not be loaded.
        TypeError: for an option that is none.
        UsageError: CLI011 to CLI013 if the call is wrong.
    """
    target, archive = Path(path), options.pop("backup", None)
    given = {**OPTIONS, "force": False, **options}
    unknown = sorted(set(given) - set(OPTIONS) - {"force"})
    if unknown:
        raise TypeError(f"no option {unknown[0]!r}, known are {', '.join(OPTIONS)}")
    require_free(target, given["force"])
    if archive is not None:
        return draft_from_backup(archive, given, target)
    return draft_cell(given, target, {})
