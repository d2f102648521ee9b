"""Every effect of the registry keeps the contract, and the contract refuses broken ones."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.errors import DataError, PluginError
from postproc.gap.effect import EFFECTS, Basis, Parameter, State, register
from postproc.gap.robot_model import effect_of
from postproc.testing import check_effect, made_samples
from postproc.testing.effect import CHECKS

ALL = [effect for _, effect in EFFECTS]
SAMPLES = made_samples()
Frame, Lag = type(effect_of("base_frame")), type(effect_of("servo_lag"))


@pytest.mark.parametrize("effect", ALL, ids=lambda e: e.name)
@pytest.mark.parametrize("check", CHECKS, ids=lambda c: c.__name__)
def test_contract(check, effect):
    check(effect, SAMPLES)


def test_all_parts_of_the_registry_load():
    assert not [info for info in EFFECTS.infos() if info.problem]


def test_a_name_is_taken_once():
    with pytest.raises(PluginError, match="twice"):
        register(type(effect_of("backlash")))


def test_an_unknown_name_is_refused():
    with pytest.raises(DataError, match="no effect is named 'rust'"):
        effect_of("rust")


class Silent(Frame):
    title = " "


class Kind(Frame):
    kind = "guess"


class Careless(Frame):
    conditions = ()


class Twice(Frame):
    def parameters(self, arm, setting):
        return (Parameter("a", 1e-3),) * 6


class Size(Frame):
    def parameters(self, arm, setting):
        return tuple(Parameter(f"p{k}", 0.0) for k in range(6))


class Bound(Frame):
    def parameters(self, arm, setting):
        return tuple(Parameter(f"p{k}", 1e-3, lower=1e-4) for k in range(6))


class Joint(Frame):
    def parameters(self, arm, setting):
        return tuple(Parameter(f"p{k}", 1e-3, joint=7) for k in range(6))


class Endless(Frame):
    def basis(self, samples, setting):
        return Basis(point=np.full((len(samples), 3, 6), np.inf))


class Bent(type(effect_of("transmission_error"))):
    """Counts as of the pose that is reached, but its columns are those of the commanded one."""

    equilibrium = True

    def basis(self, samples, setting):
        near = bool(np.array_equal(samples.q, SAMPLES.q))
        basis = super().basis(samples, setting)
        return basis if near else Basis(joint=3.0 * basis.joint)


class Needless(Lag):
    """Does without the column that it says it needs."""

    def basis(self, samples, setting):
        full = samples if samples.has("qd") else SAMPLES
        return super().basis(full, setting)


class Greedy(Frame):
    """Needs a column that it does not name."""

    def basis(self, samples, setting):
        samples.column("temperature")
        return super().basis(samples, setting)


class Forgetful(Frame):
    def read(self, model, arm):
        return State(1.01 * super().read(model, arm).theta)


class Aside(Frame):
    """Its numbers get lost between the fit and the registration of the model file."""

    def registered(self, registration, theta):
        return registration


BROKEN = [
    ("has no title", Silent),
    ("unknown kind", Kind),
    ("names no condition", Careless),
    ("two of one name", Twice),
    ("typical size must be positive", Size),
    ("zero must be inside the bounds", Bound),
    ("no such joint", Joint),
    ("moves the point with zero parameters", Endless),
    ("off the exact derivative", Bent),
    ("does not miss its column qd", Needless),
    ("it needs the columns temp_C without saying so", Greedy),
    ("a model file changes it", Forgetful),
    ("a registration with it moves a point", Aside),
]


@pytest.mark.parametrize(("words", "effect"), BROKEN, ids=[words for words, _ in BROKEN])
@pytest.mark.filterwarnings("ignore:invalid value encountered")
def test_a_broken_effect_is_refused(words, effect):
    with pytest.raises(PluginError, match=f"PLG004: .*{words}"):
        check_effect(effect(), SAMPLES)
