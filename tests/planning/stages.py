"""The search of one toolpath alone: what ``planned`` makes a plan of."""

from types import SimpleNamespace

from postproc.planning import job
from postproc.planning.attempt import Attempt
from postproc.planning.repairs import REPAIRS, Level, repaired
from postproc.progress import Clock


def solve(checker, *, partial=False):
    """Return checker, choice and route, how often each repair was tried, and tags left out."""
    attempt = Attempt(checker, Clock("place"), partial=partial, goes_on=False)
    (checker, choice, routed), tried = repaired(attempt, Level.SEARCH)
    job._add_hints(routed, sum(tried[row.name] for row in REPAIRS if row.price))
    dropped = []
    if partial:
        routed, dropped = job._without_stuck(checker, choice.chosen, routed, goes_on=False)
    return SimpleNamespace(choice=choice, routed=routed, tried=tried, dropped=dropped)
