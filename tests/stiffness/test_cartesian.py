"""Cartesian stiffness against pinocchio, literal formulas of the paper and plain inverses."""

import numpy as np
import pinocchio
import pytest

from postproc.errors import StiffnessError
from postproc.stiffness import cartesian
from tools.dev.hidden_twin import Twin

from .conftest import K_PAPER, TCP, WEIGHT, wrench_of

C = 1.0 / K_PAPER


def random_jacobians(count=50, seed=0):
    return np.random.default_rng(seed).normal(size=(count, 6, 6)) + 4.0 * np.eye(6)


def screw_jacobian(q):
    """Return the Jacobian (n, 6, 6) at the tool point from the twin's own screws."""
    twin = Twin()
    axes, points, _ = twin.chain(q)
    lever = twin.point(q)[:, None] - points
    return np.swapaxes(np.concatenate([np.cross(axes, lever), axes], axis=-1), 1, 2)


def test_compliance_of_the_arm_from_pinocchio(arm, postures):
    # a chain of revolute joints built from the twin's screw axes, in pinocchio
    model = pinocchio.Model()
    from tools.dev.hidden_twin import AXES, POINTS

    parent, before = 0, np.zeros(3)
    for axis, point in zip(AXES, POINTS, strict=True):
        joint = pinocchio.JointModelRevoluteUnaligned(axis)
        parent = model.addJoint(parent, joint, pinocchio.SE3(np.eye(3), point - before), "")
        before = point
    data = model.createData()
    q = postures(20)
    ours = cartesian.compliance(arm.jacobian(q, TCP), C)
    for row, angles in enumerate(q):
        J = pinocchio.computeJointJacobians(model, data, angles)
        pinocchio.forwardKinematics(model, data, angles)
        shift = Twin().point(angles[None])[0] - data.oMi[6].translation
        J = pinocchio.getJointJacobian(model, data, 6, pinocchio.LOCAL_WORLD_ALIGNED)
        J = np.vstack([J[:3] - np.cross(shift, J[3:], axisb=0, axisc=0).copy(), J[3:]])
        expected = J @ np.diag(C) @ J.T
        np.testing.assert_allclose(ours[row], expected, atol=1e-15, rtol=1e-9)


def test_held_stiffness_equals_the_literal_formula():
    J = random_jacobians(seed=3)
    B = np.linalg.inv(J)
    literal = np.swapaxes(B, 1, 2) @ np.diag(K_PAPER) @ B  # Eq. (12)
    held = np.linalg.inv(cartesian.compliance_rotation_held(J, C))
    np.testing.assert_allclose(held, literal[:, :3, :3], rtol=1e-6)


def test_free_stiffness_is_the_schur_complement():
    J = random_jacobians(seed=4)
    B = np.linalg.inv(J)
    K = np.swapaxes(B, 1, 2) @ np.diag(K_PAPER) @ B
    fd, fm, mm = K[:, :3, :3], K[:, :3, 3:], K[:, 3:, 3:]
    schur = fd - fm @ np.linalg.inv(mm) @ np.swapaxes(fm, 1, 2)
    free = np.linalg.inv(cartesian.translational_compliance(J, C))
    np.testing.assert_allclose(free, schur, rtol=1e-5)


def test_nothing_blows_up_at_a_straight_wrist(arm):
    q = np.radians([[10.0, -60.0, 90.0, 20.0, 0.0, 30.0]])
    J = arm.jacobian(q, TCP)
    assert np.all(np.isfinite(cartesian.compliance_rotation_held(J, C)))
    near = cartesian.translational_compliance(arm.jacobian(q + 1e-6, TCP), C)
    np.testing.assert_allclose(cartesian.translational_compliance(J, C), near, rtol=1e-4)


def test_regressor_is_the_papers_matrix():
    rng = np.random.default_rng(5)
    J, F = rng.normal(size=(6, 6)), rng.normal(size=6)
    literal = np.array(  # Eq. (5), entry by entry
        [[J[r, i] * sum(J[k, i] * F[k] for k in range(6)) for i in range(6)] for r in range(6)]
    )
    np.testing.assert_allclose(cartesian.regressor(J, F), literal, rtol=1e-12)
    np.testing.assert_allclose(literal @ C, cartesian.compliance(J, C) @ F, rtol=1e-12)


def test_deflection_against_the_equilibrium_of_the_twin(arm, postures):
    twin = Twin()
    q = postures(30, seed=2)
    J = arm.jacobian(q, TCP)
    linear = (cartesian.regressor(J, wrench_of(twin, q, WEIGHT, twin.com)) @ C)[:, :3]
    real = twin.weight(q) - twin.point(q)
    # the arm moves a third of a millimetre over metres: the linear response is good to 1e-3
    np.testing.assert_allclose(linear, real, atol=2e-3 * np.abs(real).max())


def test_jacobian_of_the_product_is_that_of_the_screws(arm, postures):
    q = postures(10, seed=6)
    np.testing.assert_allclose(arm.jacobian(q, TCP), screw_jacobian(q), atol=1e-12)


def test_joint_compliance_refuses_what_no_spring_has():
    assert cartesian.joint_compliance([np.inf, 2.0]).tolist() == [0.0, 0.5]
    with pytest.raises(StiffnessError, match="STF001"):
        cartesian.joint_compliance([1.0, 0.0])
