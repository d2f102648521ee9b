"""Every effect of the registry keeps the contract; a new file is tested without an edit here."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.errors import DataError, PluginError
from postproc.gap import contract
from postproc.gap.effect import EFFECTS, Basis, Effect, Parameter, register
from postproc.gap.robot_model import effect_of
from postproc.model.modelfile import EFFECT_NAMES

ALL = [effect for _, effect in EFFECTS]


@pytest.mark.parametrize("effect", ALL, ids=lambda e: e.name)
@pytest.mark.parametrize("check", contract.CHECKS, ids=lambda c: c.__name__)
def test_contract(check, effect, samples):
    check(effect, samples)


def test_every_public_name_is_there():
    assert set(EFFECT_NAMES) <= {effect.name for effect in ALL}


def test_all_parts_of_the_registry_load():
    assert not [info for info in EFFECTS.infos() if info.problem]


def test_a_name_is_taken_once():
    with pytest.raises(PluginError, match="twice"):
        register(type(effect_of("backlash")))


def test_an_unknown_name_is_refused():
    with pytest.raises(DataError, match="no effect is named 'rust'"):
        effect_of("rust")


class Broken(Effect):
    """Two parameters of one name, a constant that no placebo can destroy."""

    name = "broken"
    title = source = action = "x"
    conditions = ("x",)

    def parameters(self, arm, setting):
        return (Parameter("a", 1e-3), Parameter("a", 1e-3))

    def basis(self, samples, setting):
        wave = np.linspace(-1.0, 1.0, len(samples))[:, None, None]
        return Basis(point=wave * np.ones((1, 3, 2)))


class Doubled(type(effect_of("base_frame"))):
    """Columns that are twice what the registered effect does."""

    def basis(self, samples, setting):
        return Basis(link=2.0 * super().basis(samples, setting).link)


def test_the_contract_finds_a_broken_effect(samples):
    with pytest.raises(PluginError, match=r"PLG004: .*two of one name"):
        contract.check_parameters(Broken(), samples)
    with pytest.raises(PluginError, match="off the exact derivative"):
        contract.check_columns(Doubled(), samples)
    with pytest.raises(PluginError, match="placebo explains"):
        contract.check_placebo(Broken(), samples)
