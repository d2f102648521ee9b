"""How far the gap shrinks on rows that were not fitted, and on new ones.

Each row is missed by the fit to the rows of other places, and by that to other stretches of time;
the mean of both counts. Sealed rows count as all others do: a choice that was made without them
is no worse on them (mean log ratio -0.01 in 57 blind campaigns), and a quarter of the rows, in few
places, tells far less surely than all how large a gap is that differs from place to place.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.gap.fit import Problem
from postproc.gap.posterior import Judged, Name, Named, Serving, frames_of, thinned
from postproc.records import dataclass

NEW_POSES = 60
"""New poses that the interval of a shrinkage is told for: a campaign."""
_DRAWS = 400
_SEED = 3


@dataclass(frozen=True, slots=True)
class Step:
    """What one adopted effect does on rows left out: 3D rms [m] before and once it is added.

    Both of the whole measured difference; the effects listed before it are in the model.
    """

    name: str
    before: float
    after: float
    interval: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Apart:
    """A choice on rows that were left out, once, when everything else is decided.

    steps: the adopted effects, most helpful first; total: 3D rms [m] before and after all of them,
    and the 90 % interval of the shrinkage; sealed: the same two of the sealed rows, by fits without
    any of them, NaN without such; last: fit of all rows; baseline: (n, 3) points
    without effects [m]; held: (k, 2) by how much each row that counts is missed, before and after.
    """

    steps: tuple[Step, ...]
    total: tuple[float, float, float, float]
    sealed: tuple[float, float]
    last: Named
    baseline: FloatArray
    held: FloatArray

    @classmethod
    def best(cls, served: Sequence[Serving], kept: BoolArray) -> Apart:
        """Return that of the names, or of more where that surely misses rows left out by less.

        Args:
            served: the names, and what may serve beside them.
            kept: (n,) rows that are no measuring faults.
        """
        best = cls.of(served[0], kept)
        for more in served[1:]:
            apart = cls.of(more, kept)
            cluster = more.judged.posterior.problem.split.cluster[kept]
            fall = _sums(best.held[:, 1], apart.held[:, 1], cluster) @ np.array([1.0, -1.0])
            if fall.sum() > np.sqrt(np.sum(fall**2)):
                best = apart
        return best

    @classmethod
    def of(cls, served: Serving, kept: BoolArray) -> Apart:
        """Add the adopted effects one by one, then all else that serves, and compare.

        Each step adds the effect that removes most of what is left on fitted rows, and says how
        far the whole gap shrinks by that.

        Args:
            served: what the model holds.
            kept: (n,) rows that are no measuring faults.
        """
        judged = served.judged
        problem = judged.posterior.problem
        parts = _Parts.of(problem, kept)
        order, rows = _ordered(judged), thinned(kept)
        some = [{}, *(served.free(order[:count]) for count in range(1, len(order) + 1))]
        some[0] = frames_of(problem)
        if set(served.keys) != {k for n in order for k in n.keys}:
            some.append(served.free())
        fits = [
            Named.of(problem, free, served.at.sigma, rows, served.beside * bool(count))
            for count, free in enumerate(some)
        ]
        left = [parts.left(fit) for fit in fits]
        steps = tuple(
            Step(name.name, *parts.shrinkage(before, after))
            for name, before, after in zip(order, left, left[1:], strict=False)
        )
        low, high = parts.shrinkage(left[0], left[-1])[2]
        first, last = fits[0], fits[-1]
        return cls(
            steps,
            (rms(left[0]), rms(left[-1]), low, high),
            (parts.sealed(first), parts.sealed(last)),
            last,
            first.fit.point,
            np.stack([left[0], left[-1]], axis=1),
        )


@dataclass(frozen=True, slots=True)
class _Parts:
    """Ways to part rows (n,), and which of them count.

    place, time: (n,) 0..k-1 parts that are left out in turn; cluster: (n,) of alike rows;
    is_sealed: (n,); kept: (n,).
    """

    place: IntArray
    time: IntArray
    cluster: IntArray
    is_sealed: BoolArray
    kept: BoolArray

    @classmethod
    def of(cls, problem: Problem, kept: BoolArray) -> _Parts:
        """Return those of a problem; postures that are all alike have no places."""
        split = problem.split
        place = split.fold if split.folds > 1 else split.stretch
        return cls(place, split.stretch, split.cluster, split.sealed, kept)

    def left(self, fit: Named) -> FloatArray:
        """Return how far each row that counts is missed [m] without its place or its time."""
        square = [fit.missed(label)[self.kept] ** 2 for label in (self.place, self.time)]
        return np.asarray(np.sqrt(np.mean(square, axis=0)))

    def sealed(self, fit: Named) -> float:
        """Return the 3D rms [m] by which the sealed rows are missed by a fit without them."""
        rows = self.is_sealed & self.kept
        if not np.any(rows) or np.all(self.is_sealed):
            return float("nan")
        return rms(fit.missed(self.is_sealed.astype(np.int32))[rows])

    def shrinkage(
        self, before: FloatArray, after: FloatArray
    ) -> tuple[float, float, tuple[float, float]]:
        """Return the 3D rms [m] before and after, and the interval of the shrinkage."""
        clusters, stretches = self.cluster[self.kept], self.time[self.kept]
        return rms(before), rms(after), shrink_interval(before, after, clusters, stretches)


def _ordered(judged: Judged) -> list[Name]:
    """Return the adopted names, most helpful next on the rows that are searched."""
    order: list[Name] = []
    waiting = list(judged.adopted)
    while waiting:
        coming = {name.name for name in waiting}
        free = [n for n in waiting if coming.isdisjoint(n.effect.refines)] or waiting
        best = min(free, key=lambda n: (judged.left([*order, n]), n.name))
        order.append(best)
        waiting.remove(best)
    return order


def shrink_interval(
    before: FloatArray, after: FloatArray, cluster: IntArray, stretch: IntArray
) -> tuple[float, float]:
    """Return the 90 % interval of the shrinkage on ``NEW_POSES`` new poses of the same kind.

    The logarithm of what remains scatters from place to place (clusters of poses are drawn anew)
    and from one time to another (each stretch is left out in turn); the larger counts. So do new
    poses.

    Args:
        before: (n,) distances without the effects [m].
        after: (n,) with them [m].
        cluster: (n,) cluster of each row.
        stretch: (n,) of rows that follow each other.
    """
    from scipy.special import stdtrit

    places, times = _sums(before, after, cluster), _sums(before, after, stretch)
    k = len(places)
    if k < 2:
        return 0.0, 0.0
    draws = np.random.default_rng(_SEED).multinomial(k, np.full(k, 1.0 / k), _DRAWS)
    scatter = float(np.std(_log_left(draws @ places)))
    if len(times) > 1:
        each = _log_left(np.sum(times, axis=0) - times)
        share = (len(times) - 1) / len(times)
        scatter = max(scatter, float(np.sqrt(share * np.sum((each - each.mean()) ** 2))))
    here = float(_log_left(np.sum(places, axis=0)))
    reach = scatter * float(np.sqrt(1.0 + len(before) / NEW_POSES) * stdtrit(k - 1, 0.95))
    return 1.0 - float(np.exp(here + reach)), 1.0 - float(np.exp(here - reach))


def _sums(before: FloatArray, after: FloatArray, label: IntArray) -> FloatArray:
    """Return the sums of squares (k, 2) by label."""
    index = np.unique(label, return_inverse=True)[1]
    return np.stack([np.bincount(index, v**2) for v in (before, after)], axis=1)


def _log_left(sums: FloatArray) -> FloatArray:
    """Return the logarithm (...) of what remains by sums of squares (..., 2)."""
    safe = np.maximum(sums, 1e-30)
    return np.asarray(0.5 * np.log(safe[..., 1] / safe[..., 0]))


def rms(values: FloatArray) -> float:
    """Return the root mean square, NaN of nothing."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")
