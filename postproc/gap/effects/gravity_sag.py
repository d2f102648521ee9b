"""The joints give way under the weight of the links themselves."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Samples, first_moment_torque, weight_torque
from postproc.gap.effect import Basis, Effect, Parameter, Setting, diagonal, per_joint, register
from postproc.geometry import skew

_UNLIKE = 0.2
"""How far masses and stiffness of an arm differ from the reference beside a common factor, in
typical sizes: the numbers are looked for more widely than arms have them."""


@register
class GravitySag(Effect):
    """Gravity torque of the links over the joint stiffness, in equilibrium.

    Where the masses come from the size class only, the split of the weight between the upper arm
    and the forearm is as uncertain as its sum: four shape parameters let the torque on axes 2
    and 3 follow the levers of both, along and across each link, and three let the wrist's centre
    of gravity lie off its axes. Parameters are multiples of the
    reference sag; the arm's balancing may take a part of it.
    """

    name = "gravity_sag"
    title = "the arm sags under its own weight"
    source = "J K^-1 g(q); first moments of the links about axes 2 and 3"
    action = "compensate with model.toml; check the counterbalance"
    conditions = ("q2", "q3")
    geometric = True
    is_common = True
    has_tool_weight = True
    equilibrium = True
    layout = (("scale", 6), ("shape", 4), ("wrist_moment", 6))
    parameter_list = (
        *per_joint(1.0),
        Parameter("joint_2_upper_arm", 0.3, joint=2, family="shape"),
        Parameter("joint_2_forearm", 0.3, joint=2, family="shape"),
        Parameter("joint_2_forearm_across", 0.3, joint=2, family="shape"),
        Parameter("joint_3_forearm_across", 0.3, joint=3, family="shape"),
        *(
            Parameter(f"wrist_{link}_{axis}", 0.05, joint=link, family="wrist")
            for link in (4, 5)
            for axis in "xyz"
        ),
    )
    """Six scales of the reference sag, four shapes of axes 2 and 3, wrist moments."""

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn each joint by its gravity torque times the reference compliance."""
        del setting
        reference = samples.arm.reference
        torque = weight_torque(samples)
        joint = np.zeros((len(samples), 6, 16))
        joint[:, :, :6] = diagonal(torque * reference.c_joint)
        upper, along, across = self._levers(samples)
        for column, (axis, lever) in enumerate(
            ((1, upper), (1, along), (1, across), (2, across)), start=6
        ):
            moment = lever @ skew(reference.gravity)
            turn = np.einsum("ni,ni->n", samples.axes[:, :, axis], moment)
            joint[:, axis, column] = turn * self._moment(samples) * reference.c_joint[axis]
        for column, link in ((10, 4), (13, 5)):
            wrist = self._wrist(samples, link) * reference.c_joint[:, None]
            joint[:, :, column : column + 3] = wrist
        return Basis(joint=joint)

    def drawn(self, normal: FloatArray) -> FloatArray:
        """Return numbers of one weight: nearly one multiple of the reference sag of all joints."""
        reference = np.repeat([1.0, 0.0], [6, normal.shape[1] - 6])
        return np.asarray(normal[:, :1] * (reference + _UNLIKE * normal))

    @staticmethod
    def _wrist(samples: Samples, link: int) -> FloatArray:
        """Return (n, 6, 3) torque of the wrist's mass, one metre off along axes of a link."""
        reference = samples.arm.reference
        mass = float(np.sum(reference.link_mass[3:]))
        return mass * first_moment_torque(samples, samples.frames[:, link, :3, :3], link)

    @staticmethod
    def _levers(samples: Samples) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return unit vectors along the upper arm, along and across the forearm (n, 3)."""
        upper = samples.frames[:, 3, :3, 3] - samples.frames[:, 2, :3, 3]
        forearm = samples.frames[:, 5, :3, 3] - samples.frames[:, 3, :3, 3]
        upper = upper / np.linalg.norm(upper, axis=1, keepdims=True)
        axis = samples.axes[:, :, 2]
        forearm = forearm - np.einsum("ni,ni->n", forearm, axis)[:, None] * axis
        forearm = forearm / np.linalg.norm(forearm, axis=1, keepdims=True)
        return upper, forearm, np.cross(axis, forearm)

    @staticmethod
    def _moment(samples: Samples) -> float:
        """Return the first moment of the forearm and wrist [kg*m], as the unit of the shapes."""
        origins, _, _ = samples.arm.link_constants()
        forearm = float(np.linalg.norm(origins[3] + origins[4]))
        return 0.5 * forearm * float(np.sum(samples.arm.reference.link_mass[2:]))
