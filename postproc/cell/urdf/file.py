"""A robot from a URDF file: limits, speeds, masses; what it lacks is marked assumed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from postproc.cell.cell import Origin, Provenance, Robot, UrdfGeometry
from postproc.cell.robotfile import assumed_acceleration
from postproc.cell.urdf.body import has_inertia, link_inertia
from postproc.cell.urdf.chain import read_chain
from postproc.cell.urdf.numbers import LARGEST
from postproc.errors import SourceRef
from postproc.units import DEG

_FULL_TURN = 360.0 * DEG
_ASSUMED_SPEED = 60.0 * DEG


def read_urdf_robot(path: Path, tip: str | None = None, source: SourceRef | None = None) -> Robot:
    """Return the robot of a URDF file, standing at the world's origin.

    A URDF gives no accelerations: they are assumed such that a joint reaches full speed in half a
    second. A continuous joint gets +-360 degrees, a missing speed 60 degrees per second; each is
    marked assumed in ``origins``. Efforts are the torques where all are above 0, no larger than a
    real arm's, and the file gives the inertias as well.

    Args:
        path: the URDF file.
        tip: name of the flange link; default as in ``read_chain``.
        source: where the cell names the file.

    Raises:
        CellError: CEL011 if this is not the URDF of a six-axis arm.
    """
    chain = read_chain(path, tip, source)
    joints = chain.moving
    lower = np.array([joint.lower for joint in joints])
    upper = np.array([joint.upper for joint in joints])
    speed = np.array([joint.velocity for joint in joints])
    has_limits, has_speed = np.isfinite(lower + upper), np.isfinite(speed)
    speed = np.where(has_speed, speed, _ASSUMED_SPEED)
    from_file = Origin(Provenance.USER, f"URDF file {path.name}")
    assumed = Origin(Provenance.ASSUMED, f"not in the URDF file {path.name}")
    qdd_max, ramp = assumed_acceleration(speed)
    limits = from_file if has_limits.all() else assumed
    origins = {
        "geometry": from_file,
        "q_min": limits,
        "q_max": limits,
        "qd_max": from_file if has_speed.all() else assumed,
        "qdd_max": ramp,
    }
    mass, com = link_inertia(chain)
    if mass is not None:
        origins |= {"link_mass": from_file, "link_com": from_file}
    effort = np.array([joint.effort for joint in joints])
    moved = has_inertia(chain)
    knows_torque = moved and bool(((effort > 0.0) & (effort <= LARGEST)).all())
    if knows_torque:
        origins["torque_max"] = from_file
    return Robot(
        name=str(chain.tree.get("name") or path.stem),
        geometry=UrdfGeometry(path, chain.tip),
        q_min=np.where(has_limits, lower, -_FULL_TURN),
        q_max=np.where(has_limits, upper, _FULL_TURN),
        qd_max=speed,
        qdd_max=qdd_max,
        torque_max=effort if knows_torque else None,
        has_inertia=moved,
        T_world_robroot=np.eye(4),
        link_mass=mass,
        link_com=com,
        origins=origins,
    )
