import pytest

from postproc.cell.robotfile import load_robot
from postproc.kinematics import build
from tests.arms import DETAILED
from tests.places import SHARED


@pytest.fixture(params=DETAILED)
def robot(request):
    return load_robot(request.param)


@pytest.fixture
def kr500():
    return build(load_robot("kuka_kr500_r2830"))


@pytest.fixture
def corpus():
    """The shared corpus beside the checkout."""
    if not SHARED.is_dir():
        pytest.skip("the shared corpus is not beside the checkout")
    return SHARED
