"""What ``verify`` says is allowed is what its checks ask."""

from postproc.jobs.explain import MEASURES
from postproc.kinematics import STRETCHED
from postproc.units import DEG, MM, PERCENT
from postproc.verification.cam.feeds import FEED_TOLERANCE
from postproc.verification.checks import OVERHEAD

NAMES = ("feed", "stretched_arm", "wrist_over_A1")


def test_limits_that_no_key_sets_are_those_of_the_checks():
    said = {name: MEASURES[name].allowed(None, None) for name in NAMES}
    assert said == {
        "feed": f"<= {FEED_TOLERANCE / PERCENT:g}",
        "stretched_arm": f">= {STRETCHED / DEG:g} (warning)",
        "wrist_over_A1": f">= {OVERHEAD / MM:g} (warning)",
    }
