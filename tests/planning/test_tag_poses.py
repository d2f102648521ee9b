"""What is said of one pose at once is what the plan itself has, tilts and external axes too."""

import numpy as np
import pytest

from postproc.jobs.convert import ConvertRequest, convert
from postproc.planning import SpinClass, TagPoses
from tests.places import FIXTURES


@pytest.mark.parametrize(
    ("folder", "source"),
    [("wall_tilt", "wall.apt"), ("turntable", "ring.csv"), ("tool_changes", "plate.apt")],
)
def test_the_poses_of_a_good_plan_are_free(folder, source):
    cell = FIXTURES / folder / "cell.toml"
    made = convert(ConvertRequest(str(FIXTURES / folder / source), str(cell)))
    plan, poses = made.plan, TagPoses(made.plan, made.cell)
    kind, stiffness = poses.reach()
    assert (kind == SpinClass.FREE).all()
    np.testing.assert_allclose(stiffness, plan.stiffness, rtol=1e-6)
    wrong = []
    for tag in range(len(plan.toolpath)):
        rows = np.flatnonzero(plan.tag == tag)
        pose = poses.at(tag, float(plan.spin[rows[-1]]))
        if pose is None or pose.kind is not SpinClass.FREE or pose.q is None:
            wrong.append((tag, pose))
        elif not np.isnan(plan.stiffness[tag]) and pose.stiffness < 0.999 * plan.stiffness[tag]:
            wrong.append((tag, pose.stiffness, plan.stiffness[tag]))
    assert not wrong
