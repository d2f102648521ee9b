"""Every built-in arm: forward kinematics against pinocchio, all branches against py-opw."""

import numpy as np
import pinocchio
import pytest
from scipy.spatial.transform import RigidTransform

from postproc.cell import load_robot, robot_names
from postproc.kinematics import build
from tests.arms import table_rows
from tests.kinematics.test_forward import pinocchio_arm
from tests.kinematics.test_inverse import OUR_SLOT_IN_THEIRS, apart, oracle, pose_error

POSES = np.random.default_rng(19).uniform(-np.pi, np.pi, (1000, 6))


class Lengths:
    """The lengths of a row of the table [m]."""

    def __init__(self, row):
        for key in ("a1", "a2", "b", "c1", "c2", "c3", "c4"):
            setattr(self, key, float(row[key]) * 1e-3)


def test_forward_kinematics_of_every_row_of_the_table():
    rows = table_rows()
    assert len(rows) >= 150
    for row in rows:
        model, frame = pinocchio_arm(Lengths(row))
        data = model.createData()
        wanted = np.empty((len(POSES), 4, 4))
        for i, q in enumerate(POSES):
            pinocchio.framesForwardKinematics(model, data, q)
            wanted[i] = data.oMf[frame].homogeneous
        found = build(load_robot(row["id"])).fk(POSES)
        assert np.abs(found - wanted).max() < 1e-10, row["id"]


@pytest.mark.parametrize("part", range(4))
def test_all_branches_of_every_arm(part):
    for name in robot_names()[part::4]:
        kinematics = build(load_robot(name))
        T = kinematics.fk(POSES)
        ours, valid = kinematics.ik(T)
        theirs = oracle(kinematics.arm.geometry).reach(RigidTransform.from_matrix(T)).joints
        theirs = theirs[:, OUR_SLOT_IN_THEIRS]
        exists = np.isfinite(theirs[:, :, 0])
        assert (valid | ~exists).all(), name
        assert np.count_nonzero(valid & ~exists) < 3, name  # borders of reach within rounding
        assert np.quantile(apart(ours, theirs)[valid & exists], 0.999) < 1e-6, name
        row, slot = np.nonzero(valid)
        assert pose_error(kinematics, ours[row, slot], T[row]).max() < 1e-8, name
        own = kinematics.slot(POSES)
        assert valid[np.arange(len(POSES)), own].all(), name
