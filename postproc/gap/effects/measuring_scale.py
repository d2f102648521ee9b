"""The measuring device distorts its volume (an alternative, never named)."""

from __future__ import annotations

import itertools

import numpy as np

from postproc.gap.data import Samples
from postproc.gap.effect import (
    Basis,
    Effect,
    Kind,
    Parameter,
    Setting,
    centre_and_extent,
    from_centre,
    register,
)

_PAIRS = tuple(itertools.combinations_with_replacement(range(3), 2))
_TRIPLES = tuple(itertools.combinations_with_replacement(range(3), 3))


@register
class MeasuringScale(Effect):
    """Scale errors of the measured volume: the same at every pose that reaches a place.

    A field without rotation, straight (six numbers) and curved (ten): the gradients of all
    quadratic and cubic forms of the place. Rotation and shift are the measured frame's.
    """

    name = "measuring_scale"
    title = "behaves like a scale error of the measuring device"
    source = "p' = p + grad(quadratic + cubic form of p)"
    action = "measure a calibrated length in the same volume, in three directions"
    kind = Kind.ALTERNATIVE
    conditions = ("position",)
    parameter_list = (
        *(Parameter("scale_" + "".join("xyz"[i] for i in pair), 1e-4) for pair in _PAIRS),
        *(Parameter("bend_" + "".join("xyz"[i] for i in triple), 3e-5) for triple in _TRIPLES),
    )
    """Relative scale errors, at the usual distance from the centre."""

    def prepare(self, samples: Samples) -> Setting:
        """Return centre [m] and extent [m] of the measured places."""
        return centre_and_extent(samples.point)

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Move the measured point along the gradient of each form."""
        extent = float(setting["extent"])
        place = from_centre(samples.point, setting)
        forms = (*_PAIRS, *_TRIPLES)
        point = np.zeros((len(samples), 3, len(forms)))
        for column, form in enumerate(forms):
            for axis in range(3):
                point[:, axis, column] = _derivative(place, form, axis)
        point *= extent / np.maximum(np.sqrt(np.mean(np.sum(point**2, axis=1), axis=0)), 1e-6)
        return Basis(point=point)


def _derivative(place: np.ndarray, form: tuple[int, ...], axis: int) -> np.ndarray:
    """Return (n,) the derivative of a product of coordinates along one of them."""
    times = form.count(axis)
    if not times:
        return np.zeros(len(place))
    rest = list(form)
    rest.remove(axis)
    return np.asarray(times * np.prod(place[:, rest], axis=1))
