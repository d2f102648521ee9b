from pathlib import Path

import pytest

from postproc.cell.robotfile import load_robot, robot_names
from postproc.kinematics.model import build


@pytest.fixture(params=robot_names())
def robot(request):
    return load_robot(request.param)


@pytest.fixture
def kr500():
    return build(load_robot("kuka_kr500_r2830"))


@pytest.fixture
def corpus():
    """The shared corpus beside the checkout."""
    folder = Path(__file__).resolve().parents[2].parent / "shared"
    if not folder.is_dir():
        pytest.skip("the shared corpus is not beside the checkout")
    return folder
