"""Frames, rotations, lines and arcs."""

from postproc.geometry.curves import (
    STEP_SWEEP,
    Circles,
    angle_about,
    around,
    circles,
    spline_points,
    spline_tangents,
)
from postproc.geometry.frames import (
    AXES,
    abc_from_rotation,
    across,
    angle_between,
    apply,
    axis_angle,
    axis_name,
    inverse,
    kuka_from_transform,
    orthonormalised,
    rotation_about,
    rotation_angle,
    rotation_from_abc,
    rotation_from_vector,
    rotation_x,
    rotation_y,
    rotation_z,
    skew,
    slerp,
    transform,
    transform_from_kuka,
    turned_between,
    twist_about,
    vee,
)
from postproc.geometry.poses import arc_points, arc_poses, line_poses, onto_line, path_length
