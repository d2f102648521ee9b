"""Every objective of the registry keeps the contract, and the contract refuses broken ones."""

import numpy as np
import pytest

from postproc.errors import PluginError
from postproc.planning import OBJECTIVES, Objective
from postproc.testing import check_objective, made_states
from postproc.testing.objective import CHECKS


@pytest.mark.parametrize("name", [name for name, _ in OBJECTIVES])
@pytest.mark.parametrize("check", CHECKS, ids=lambda c: c.__name__)
def test_contract(check, name):
    check(OBJECTIVES.get(name), made_states())


def test_all_parts_of_the_registry_load():
    assert not [info for info in OBJECTIVES.infos() if info.problem]


def changing(states):
    states.q[0] += 0.1
    return np.zeros(len(states.q))


def counting(states, calls=[]):  # noqa: B006 - what it remembers is what is wrong
    calls.append(1)
    return np.full(len(states.q), float(len(calls)))


def index(states):
    return 1.0 / np.broadcast_to(states.c_joint, states.q.shape)[:, 1]


BROKEN = [
    ("one number per state", Objective(lambda s: s.q)),
    ("one number per state", Objective(lambda s: 0.0)),
    ("not finite", Objective(lambda s: np.log(s.spin * 0.0 - 1.0))),
    ("changes the states", Objective(changing)),
    ("second time", Objective(counting)),
    ("order of the states", Objective(lambda s: np.cumsum(s.q[:, 0]))),
    ("state alone", Objective(lambda s: s.q[:, 0] / max(len(s.q), 1))),
    ("depends on joint stiffness", Objective(lambda s: s.spin if s.c_joint is None else index(s))),
    ("not above zero", Objective(lambda s: -index(s), is_stiffness=True)),
    ("does not halve", Objective(lambda s: index(s) ** 2, is_stiffness=True)),
    ("turns of the joints", Objective(lambda s: s.q[:, 5] ** 2, is_of_pose=True)),
    ("an index as well", Objective(index, is_stiffness=True, is_of_pose=True)),
]  # fmt: skip


@pytest.mark.parametrize(("words", "objective"), BROKEN, ids=[words for words, _ in BROKEN])
@pytest.mark.filterwarnings("ignore:invalid value encountered in log")
def test_a_broken_objective_is_refused(words, objective):
    with pytest.raises(PluginError, match=f"PLG004: .*{words}"):
        check_objective(objective)


def test_a_bare_function_is_no_objective():
    with pytest.raises(PluginError, match="no Objective"):
        check_objective(lambda states: states.spin)
