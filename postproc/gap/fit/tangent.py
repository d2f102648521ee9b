"""A fit to first order: its numbers, and what rows are missed by, without some rows or effects.

Rows are read once: their columns at the fit, and the products of these by parts of the rows. What
the numbers would be without a part, or with some effects alone, follows from the products.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.gap.data import Samples
from postproc.gap.fit.fit import Free, columns_of_all, layout, weighed
from postproc.gap.robot_model import States, effect_of, evaluate
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Tangent:
    """Rows about a fit.

    X: (n, 3, p) columns of unit prior [m]; u: (p,) numbers of the fit beyond the given model's,
    zero of effects that were not fitted; rest: (n, 3) what the fit leaves [m]; weight: that of the
    fit; beside: (n, 3) what it took from the readings [m]; slices: effect to its numbers; root:
    (p, p) of the prior; size: (p,) usual sizes; held: (p,) numbers at a bound.
    """

    X: FloatArray
    u: FloatArray
    rest: FloatArray
    weight: FloatArray
    beside: FloatArray
    slices: Mapping[str, slice]
    root: FloatArray
    size: FloatArray
    held: BoolArray

    @classmethod
    def of(
        cls,
        samples: Samples,
        states: States,
        given: States,
        free: Mapping[str, Free],
        rest: FloatArray,
        weight: FloatArray,
        beside: FloatArray,
    ) -> Tangent:
        """Return the rows of a campaign about some states.

        Args:
            samples: rows.
            states: of all effects that act; free ones that are not among them are at zero.
            given: those of the given model.
            free: effects that were fitted, or whose numbers are open.
            rest: (n, 3) what the readings are beside the states [m].
            weight: of the fit, (n,) or (n, 3, 3); 0 for rows that it left out.
            beside: (n, 3) what the fit took from the readings [m].
        """
        effects = [(effect_of(name), options) for name, options in free.items()]
        parameters, slices, root, mean = layout(samples, given, effects)
        theta = mean.copy()
        for name, part in slices.items():
            if name in states:
                theta[part] = states[name].theta
        X = columns_of_all(evaluate(samples, states)[1], effects) @ root
        bounds = np.array([[p.lower, p.upper] for p in parameters]).reshape(-1, 2)
        held = (theta <= bounds[:, 0]) | (theta >= bounds[:, 1])
        size = np.array([p.typical for p in parameters])
        u = np.asarray(np.linalg.solve(root, theta - mean))
        return cls(X, u, rest, weight, beside, slices, root, size, held)

    def parted(self, label: IntArray) -> Parted:
        """Return products by parts (n,) 0..k-1 of the rows."""
        fitted = np.flatnonzero(np.any(self.weight.reshape(len(self.X), -1) != 0.0, axis=1))
        weight, p = self.weight[fitted], len(self.u)
        A = weighed(self.X[fitted], weight)
        z = weighed(np.stack([self.rest + self.X @ self.u, self.beside], axis=2)[fitted], weight)
        H, b = [], []
        for k in range(int(label.max()) + 1):
            here = label[fitted] == k
            own = A[here].reshape(-1, p)
            H.append(own.T @ own)
            b.append(own.T @ z[here].reshape(-1, 2))
        return Parted(self, label, np.stack(H), np.stack(b))

    def index(self, names: Collection[str]) -> IntArray:
        """Return the numbers of some effects."""
        every = np.arange(len(self.u), dtype=np.int32)
        return np.concatenate([every[:0], *(every[self.slices[n]] for n in names)])


@dataclass(frozen=True, slots=True)
class Parted:
    """Products of rows about a fit, by their label (n,) 0..k-1.

    H: (k, p, p) of the columns; b: (k, p, 2) with the readings, and with what is beside.
    """

    of: Tangent
    label: IntArray
    H: FloatArray
    b: FloatArray

    def numbers(self, names: Collection[str], again: Collection[str] = ()) -> FloatArray:
        """Return the numbers (k, p) of some effects in a fit without each label, others at zero.

        Numbers at a bound stay there.

        Args:
            names: the effects.
            again: effects that are fitted once more to the readings as they are.
        """
        others = 1.0 - np.eye(len(self.H))
        # summed, never taken from the whole: the difference may be rounding
        H = np.tensordot(others, self.H, 1)
        b = np.tensordot(others, self.b, 1)
        every, held = self.of.index(names), self.of.held
        free, still = every[~held[every]], every[held[every]]
        out = np.zeros(b.shape[:2])
        out[:, still] = self.of.u[still]
        told = b[:, :, 0] - b[:, :, 1] - H[:, :, still] @ self.of.u[still]
        out[:, free] = _solved(H, free, told)
        frames = self.of.index(again)
        left = out.copy()
        left[:, frames] = 0.0
        told = b[:, :, 0] - (H @ left[:, :, None])[:, :, 0]
        out[:, frames] = _solved(H, frames, told)
        return out

    def missed(self, names: Collection[str], again: Collection[str]) -> FloatArray:
        """Return by what (n, 3) [m] each row is missed by a fit of effects without its label."""
        numbers, left = self.numbers(names, again), np.empty_like(self.of.rest)
        for k, theta in enumerate(numbers):
            here = self.label == k
            left[here] = self.of.rest[here] - self.of.X[here] @ (theta - self.of.u)
        return left


def _solved(H: FloatArray, index: IntArray, told: FloatArray) -> FloatArray:
    """Return the most probable numbers (k, i) of unit prior."""
    own = H[:, index[:, None], index] + np.eye(len(index))
    return np.asarray(np.linalg.solve(own, told[:, index, None])[:, :, 0])
