"""``cell.toml`` to ``Cell``: every complaint names the key, the line and what was expected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from postproc.arrays import FloatArray
from postproc.cell.cell import Cell, ExternalAxis, MeshPlacement, Robot, Tool, Workpiece
from postproc.cell.choices import Origin, Provenance
from postproc.cell.complaint import complaint, dotted
from postproc.cell.forms import cam_key, check_forms, routines
from postproc.cell.robotfile import (
    LENGTHS,
    assumed_acceleration,
    kuka_geometry,
    load_robot,
    unknown_arm,
)
from postproc.cell.schema import (
    CellFile,
    DimensionsTable,
    ExternalAxisTable,
    KrlOptions,
    Motion,
    Placement,
    RobotTable,
    Solid,
    Table,
    ToolSolid,
    ToolTable,
    WorkpieceTable,
)
from postproc.cell.urdf import read_urdf_robot
from postproc.errors import CellError
from postproc.files import read_bytes
from postproc.geometry import AXES, transform, transform_from_kuka
from postproc.records import dataclass
from postproc.resources import templates_folder
from postproc.toml import Location, TomlText, parse_toml
from postproc.units import DEG, MM, NMM_PER_RAD

CUTTER = "cutter"
"""Name of the solid that a tool has by its key ``cutter``."""


def load_cell(path: str | Path) -> Cell:
    """Read a cell file.

    Args:
        path: the TOML file; relative paths inside it are relative to its folder.

    Returns:
        The cell in SI units. ``cell.origins`` and ``cell.robot.origins`` say for every number
        whether it stands in the file, comes with the robot, or is a default.

    Raises:
        CellError: with file and line. CEL001 not TOML, CEL002 unknown key, CEL003 missing key,
            CEL004 wrong type, unit or range, CEL005 missing file, CEL010 unknown robot,
            CEL011 the URDF cannot be used, CEL012 and CEL013 contradicting tools or bases.
        ReadError: if the file is missing or unreadable.
    """
    return parse_cell(read_bytes(path), path)


def cell_toml(cell: Cell) -> TomlText:
    """Return the file of a cell, to point at its keys; without any where there is no file."""
    raw = read_bytes(cell.path) if Path(cell.path).is_file() else b""
    return parse_toml(raw, cell.path, CellError, "CEL001")


def parse_cell(raw: bytes, path: str | Path) -> Cell:
    """Read the bytes of a cell file that stands, or is to stand, at ``path``; as ``load_cell``."""
    toml = parse_toml(raw, path, CellError, "CEL001")
    try:
        file = CellFile.model_validate(toml.data)
    except ValidationError as problem:
        raise complaint(toml, problem) from None
    check_forms(toml, file)
    return _Builder(toml, file, Path(path).parent).cell()


@dataclass(frozen=True, slots=True)
class _Builder:
    """Turns the validated tables into the cell, in SI units."""

    toml: TomlText
    file: CellFile
    folder: Path

    def cell(self) -> Cell:
        """Return the cell."""
        file = self.file
        robot = self._robot()
        return Cell(
            name=file.name or Path(self.toml.path).stem,
            path=self.toml.path,
            robot=robot,
            tools=self._tools(),
            bases=self._bases(),
            obstacles=self._solids(file.obstacles, ("obstacles",), "obstacle"),
            limits=file.limits,
            optimize=file.optimize,
            process=file.process,
            motion=self._motion(robot),
            krl=self._krl(),
            reading=file.reading,
            accept=tuple(file.verify.accept),
            external_axes=tuple(_external_axis(axis) for axis in file.external_axes),
            instrument=file.measuring,
            origins=_origins(file, robot, self.toml),
        )

    def _robot(self) -> Robot:
        table = self.file.robot
        if table.model is not None:
            robot = load_robot(table.model, self.toml.source(("robot", "model")))
        elif table.dimensions_mm is not None:
            robot = unknown_arm(table.name or "kuka", _lengths(table.dimensions_mm))
        else:
            robot = read_urdf_robot(
                self._path(str(table.urdf), ("robot", "urdf")),
                table.tip,
                self.toml.source(("robot", "urdf")),
            )
        changes = _robot_changes(table, robot)
        if "torque_max" in changes and not robot.has_inertia:
            text = f"robot.torque_nm: {table.urdf} does not give mass and inertia of every link"
            hint = "complete the <inertial> of the links, or leave torque_nm out"
            raise CellError("CEL033", text, self.toml.source(("robot", "torque_nm")), hint)
        if self.file.stiffness is not None:
            stiffness = np.array(self.file.stiffness.joint_Nmm_per_rad) * NMM_PER_RAD
            changes["joint_stiffness"] = stiffness
        origins = {
            key: origin for key, origin in robot.origins.items() if key.split(".")[0] not in changes
        }
        user = Origin(Provenance.USER, "cell file")
        origins |= {key: user for key in changes}
        doubts = {key: text for key, text in robot.doubts.items() if key not in changes}
        changed = replace(
            robot,
            T_world_robroot=_transform(table.base),
            link_meshes=self._link_meshes(),
            solids=table.solids,
            origins=origins,
            doubts=doubts,
            **changes,
        )
        if np.isfinite(changed.qdd_max).all():
            return changed
        qdd_max, origins["qdd_max"] = assumed_acceleration(changed.qd_max)
        return replace(changed, qdd_max=qdd_max, origins=origins)

    def _link_meshes(self) -> tuple[tuple[int, MeshPlacement], ...]:
        tables = self.file.robot.link_meshes
        solids = self._solids(tables, ("robot", "link_meshes"), "link")
        return tuple((table.link, solid) for table, solid in zip(tables, solids, strict=True))

    def _tools(self) -> tuple[Tool, ...]:
        file = self.file
        if not file.tools:
            return (self._tool(file.tool, ("tool",), file.krl.inertia),)
        shared = file.krl.inertia
        found = []
        for i, table in enumerate(file.tools):
            stand = None if table.stand is None else _transform(table.stand)
            own = self._tool(table, ("tools", i), shared)
            found.append(replace(own, T_world_stand=stand))
        return tuple(found)

    def _tool(self, table: ToolTable, at: Location, inertia: Sequence[float] | None) -> Tool:
        T_flange_tcp = _transform(table.frame)
        axis = None if table.axis is None else AXES[table.axis]
        meshes = self._solids(table.meshes, (*at, "meshes"), "tool")
        if table.cutter is not None and axis is not None:
            size = table.cutter.diameter_mm * MM, table.cutter.length_mm * MM
            meshes += (cutter_solid(*size, T_flange_tcp, axis),)
        own = table.inertia_kg_m2 or inertia
        return Tool(
            number=table.number,
            name=table.name,
            T_flange_tcp=T_flange_tcp,
            known_axis=axis,
            mass=float("nan") if table.mass_kg is None else table.mass_kg,
            com=None if table.cog_mm is None else np.array(table.cog_mm) * MM,
            meshes=meshes,
            cuts_clockwise=table.spindle == "cw",
            cam=tuple(map(cam_key, table.cam)),
            inertia=None if own is None else np.array(own),
            diameter=float("nan") if table.cutter is None else table.cutter.diameter_mm * MM,
            source=self.toml.source(at),
        )

    def _bases(self) -> tuple[Workpiece, ...]:
        file = self.file
        if not file.bases:
            return (self._base(file.workpiece, ("workpiece",)),)
        return tuple(self._base(table, ("bases", i)) for i, table in enumerate(file.bases))

    def _base(self, table: WorkpieceTable, at: Location) -> Workpiece:
        return Workpiece(
            table.number,
            _transform(table.frame),
            self._solids(table.meshes, (*at, "meshes"), "workpiece"),
            tuple(map(cam_key, table.cam)),
            table.name or "",
        )

    def _motion(self, robot: Robot) -> Motion:
        motion = self.file.motion
        if motion.home is not None:
            outside = np.flatnonzero((motion.home < robot.q_min) | (motion.home > robot.q_max))
            for axis in outside[:1]:
                low, high = robot.q_min[axis] / DEG, robot.q_max[axis] / DEG
                text = (
                    f"motion.home_deg: A{axis + 1} = {motion.home[axis] / DEG:g} is outside the "
                    f"robot's limits, expected {low:g} to {high:g}"
                )
                raise CellError("CEL004", text, self.toml.source(("motion", "home_deg")))
        return motion

    def _krl(self) -> KrlOptions:
        krl = self.file.krl
        hooks = routines(krl.hooks, self.file.process.hole)
        return replace(krl, hooks=hooks, template=self._template())

    def _template(self) -> str:
        """Return the name of a built-in template, or the whole path of a folder of one's own."""
        name = self.file.krl.template
        if Path(name).name == name and (templates_folder() / name).is_dir():
            return name
        if not (self.folder / name).is_dir():
            text = (
                f"krl.template: neither a built-in template nor a folder beside the cell file is "
                f"named {name!r}"
            )
            raise CellError("CEL005", text, self.toml.source(("krl", "template")))
        return str((self.folder / name).absolute())

    def _solids(
        self, tables: Sequence[Solid], at: Location, owner: str
    ) -> tuple[MeshPlacement, ...]:
        solids = []
        for index, table in enumerate(tables):
            name = table.name or (f"{owner} {index + 1}" if len(tables) > 1 else owner)
            file = None
            if table.file is not None:
                file = self._path(table.file, (*at, index, "file"))
            solids.append(_solid(table, name, file))
        return tuple(solids)

    def _path(self, name: str, at: Location) -> Path:
        path = self.folder / name
        if not path.is_file():
            text = f"{dotted(at)}: no such file {name!r} beside the cell file"
            raise CellError("CEL005", text, self.toml.source(at))
        return path


def _transform(placement: Placement) -> FloatArray:
    return transform_from_kuka(placement.xyz_mm, placement.abc_deg)


def _solid(table: Solid, name: str, file: Path | None) -> MeshPlacement:
    return MeshPlacement(
        name=name,
        T_owner_mesh=_transform(table),
        file=file,
        scale=table.scale * MM,
        size=None if table.box is None else np.array(table.box.size_mm) * MM,
        radius=0.0 if table.cylinder is None else table.cylinder.radius_mm * MM,
        length=0.0 if table.cylinder is None else table.cylinder.length_mm * MM,
        cutting=isinstance(table, ToolSolid) and table.cutting,
    )


def cutter_solid(
    diameter: float, length: float, T_flange_tcp: FloatArray, axis: FloatArray
) -> MeshPlacement:
    """Return the cylinder of a cutter [m], in the flange: from its tip at the TCP to the holder."""
    main = int(np.argmax(np.abs(axis)))
    R = np.roll(np.eye(3), 2 - main, axis=1)  # a proper rotation whose third column is ``main``
    return MeshPlacement(
        name=CUTTER,
        T_owner_mesh=T_flange_tcp @ transform(R, -0.5 * length * axis),
        radius=0.5 * diameter,
        length=length,
        cutting=True,
    )


def _robot_changes(table: RobotTable, robot: Robot) -> dict[str, Any]:
    """Return the fields of ``Robot`` that the cell file sets itself."""
    changes: dict[str, Any] = {}
    if table.dimensions_mm is not None:
        changes["geometry"] = kuka_geometry(_lengths(table.dimensions_mm))
    if table.limits_deg is not None:
        changes["q_min"] = np.array(table.limits_deg)[:, 0] * DEG
        changes["q_max"] = np.array(table.limits_deg)[:, 1] * DEG
    for name, (low, high) in table.cable.items():
        axis = int(name[1]) - 1
        for key, least, end in (("q_min", np.maximum, low), ("q_max", np.minimum, high)):
            changes.setdefault(key, np.array(getattr(robot, key)))
            changes[key][axis] = least(changes[key][axis], end * DEG)
    largest = {
        "qd_max": (table.speed_deg_s, DEG),
        "qdd_max": (table.accel_deg_s2, DEG),
        "qddd_max": (table.jerk_deg_s3, DEG),
        "torque_max": (table.torque_nm, 1.0),
    }
    changes |= {
        name: np.array(of_joints) * unit
        for name, (of_joints, unit) in largest.items()
        if of_joints is not None
    }
    if table.payload_kg is not None:
        changes["payload"] = table.payload_kg
    return changes


def _lengths(table: DimensionsTable) -> list[float]:
    return [float(getattr(table, key)) for key in LENGTHS]


def _external_axis(table: ExternalAxisTable) -> ExternalAxis:
    is_rail = table.kind == "rail"
    limits = table.range_mm if is_rail else table.range_deg
    speed = table.speed_mm_s if is_rail else table.speed_deg_s
    unit = MM if is_rail else DEG
    low, high = limits or (0.0, 0.0)
    T_world_axis = _transform(table)
    return ExternalAxis(
        name=table.name,
        kind=table.kind,
        axis=T_world_axis[:3, :3] @ AXES[table.axis],
        T_world_axis=T_world_axis,
        q_min=low * unit,
        q_max=high * unit,
        qd_max=(speed or 0.0) * unit,
        moves_in_cuts=table.moves_in_cuts,
    )


def _origins(file: CellFile, robot: Robot, toml: TomlText) -> dict[str, Origin]:
    """Return for each key of the file whether it was given or is a default."""
    given = Origin(Provenance.USER, "cell file")
    default = Origin(Provenance.ASSUMED, "default of postproc, not in the cell file")
    origins: dict[str, Origin] = {}
    for table_name, field in CellFile.model_fields.items():
        name = field.alias or table_name
        kind: Any = field.annotation
        is_table = isinstance(kind, type) and issubclass(kind, Table)
        for key in kind.model_fields if is_table else ():
            is_given = key in toml.data.get(name, {})
            origins[f"{name}.{key}"] = given if is_given else default
    if "joint_stiffness" in robot.origins:
        origins["stiffness.joint_Nmm_per_rad"] = robot.origins["joint_stiffness"]
    return origins
