"""Cartesian stiffness and compliance, task indices, identification of joint stiffness."""

from postproc.stiffness.cartesian import joint_compliance, moved_wrench
from postproc.stiffness.field import ContinuousField
from postproc.stiffness.fieldfile import constant_of, describe, field_of, is_field_table

__all__ = [
    "ContinuousField",
    "constant_of",
    "describe",
    "field_of",
    "is_field_table",
    "joint_compliance",
    "moved_wrench",
]
