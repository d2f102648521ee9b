"""Cartesian stiffness and compliance, task indices, identification of joint stiffness."""

from postproc.stiffness.cartesian import joint_compliance
from postproc.stiffness.field import ConstantField, ContinuousField, Locate, StiffnessField
from postproc.stiffness.fieldfile import (
    STIFFNESS,
    constant_of,
    constant_table,
    describe,
    field_table,
    is_field_table,
    whole_field,
)
