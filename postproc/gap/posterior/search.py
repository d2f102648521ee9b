"""Which candidates are there: sets compared by their evidence, and what all sets together say.

From the best set so far one candidate is added, dropped or exchanged, one is put in the place of
two; each set that comes near is brought to its own most probable scales and noise. The sets that
were visited are the posterior: the probability of a name is the sum over sets that hold it, and
names that stand for each other are those whose sets do.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import field

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.posterior.evidence import NoisePrior, Optimum, optimum, volume
from postproc.gap.posterior.prior import LOG_SCALES, Equations, Sort, log_half_cauchy
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Scan:
    """A set at its optimum, factored.

    root: (p, p) lower triangular whose square is the covariance of the numbers; V: (p, K) products
    of the set with all columns, through it; w: (p,) those with the gap; open: by block what the
    set leaves of the candidates' products, in its noise; floor: least variance of the noise, over
    that of the set.
    """

    equations: Equations
    at: Optimum
    root: FloatArray
    V: FloatArray
    w: FloatArray
    open: tuple[tuple[FloatArray, FloatArray], ...]
    floor: float

    @classmethod
    def of(cls, equations: Equations, at: Optimum, noise: NoisePrior) -> Scan:
        """Return what is asked of a set later."""
        from scipy.linalg.lapack import dtrtri

        s2, D = at.sigma**2, at.deviation
        index, H, b = equations.among(at.keys)
        root = np.zeros((len(D), len(D)))
        if len(D):
            B = np.eye(len(D)) + (D[:, None] * H * D) / s2
            root = dtrtri(np.linalg.cholesky(B), lower=1)[0] * D
        V, w = root @ (equations.H[index] / s2), root @ (b / s2)
        left = []
        for block in equations.blocks:
            part = V[:, block.index].transpose(1, 2, 0)
            own = block.own / s2 - part @ part.transpose(0, 2, 1)
            left.append((own, block.told / s2 - part @ w))
        floor = min(noise.sigma / at.sigma, 1.0) ** 2 if noise.freedom > 0.0 else 0.0
        return cls(equations, at, root, V, w, tuple(left), floor)

    def without(self, gone: Sequence[str] = ()) -> tuple[float, dict[str, tuple[float, float]]]:
        """Return what the set without some of its candidates is worth more than the set [nats].

        Returns:
            Of what is left alone; by each candidate that is not in it what that brings beside
            [nats], and its log scale. The noise is what suits each.
        """
        at, parts = self.at, [self.at.part(self.equations, key) for key in gone]
        every = np.arange(len(self.w))
        columns = np.concatenate([every[:0], *(every[part] for part in parts)])
        Q, R = np.linalg.qr(self.root[:, columns])
        X, x = Q.T @ self.V, Q.T @ self.w
        # the numbers that go are pressed to zero from their own posterior
        size = np.abs(np.diag(R)) / at.deviation[columns]
        alone = -float(np.sum(np.log(size)))
        for key, part in zip(gone, parts, strict=True):
            candidate = self.equations.by_key[key]
            seen = 1.0 - np.diag(at.covariance)[part] / at.deviation[part] ** 2
            alone -= volume(candidate.family, seen)
            alone -= float(np.sum(log_half_cauchy(at.log_scale[key])))
        quadratic = at.quadratic + float(x @ x)
        stays = set(at.keys).difference(gone)
        found: dict[str, tuple[float, float]] = {}
        for block, (own, told) in zip(self.equations.blocks, self.open, strict=True):
            asked = np.array([key not in stays for key in block.keys])
            keys = [key for key in block.keys if key not in stays]
            back = X[:, block.index[asked]].transpose(1, 2, 0)
            A, y = own[asked] + back @ back.transpose(0, 2, 1), told[asked] + back @ x
            each = self._brought(A, y, quadratic) + alone
            summed = each + log_half_cauchy(LOG_SCALES) + np.log(LOG_SCALES[1] - LOG_SCALES[0])
            top = summed.max(axis=1)
            value = top + np.log(np.sum(np.exp(summed - top[:, None]), axis=1))
            scale = LOG_SCALES[np.argmax(each, axis=1)]
            found |= dict(zip(keys, zip(value.tolist(), scale.tolist(), strict=True), strict=True))
        return alone + float(self._likely(np.array(quadratic))), found

    def _likely(self, quadratic: FloatArray) -> FloatArray:
        """Return the log likelihood over that of the set, at the noise that suits the rest."""
        usual = self.at.quadratic
        left = np.maximum(quadratic, 1e-6 * usual)
        variance = np.maximum(left / usual, self.floor)
        log_volume = self.equations.readings * np.log(variance)
        return np.asarray(0.5 * (usual - left / variance) - 0.5 * log_volume)

    def _brought(self, A: FloatArray, y: FloatArray, quadratic: float) -> FloatArray:
        """Return what candidates of products A (m, k, k), y (m, k) bring at each scale [nats]."""
        values, vectors = np.linalg.eigh(A)
        values = np.maximum(values, 0.0)[:, None]
        y2 = np.einsum("mkj,mk->mj", vectors, y)[:, None] ** 2
        t2 = np.exp(2.0 * LOG_SCALES)[None, :, None]
        square = np.sum(y2 * t2 / (1.0 + t2 * values), axis=2)
        likely = self._likely(quadratic - square)
        return np.asarray(likely - 0.5 * np.sum(np.log1p(t2 * values), axis=2))


Subset = tuple[str, ...]
Scale = Sequence[tuple[str, float]]
"""Keys of candidates, each with a log scale."""
_TRIED = 3
"""Most promising candidates of a scan that are brought to their own scales."""
_MOVES = 30
_NEAR = 12.0
"""Nats behind the best set up to which a set is looked at closely."""
TEMPERATURE = 4.0
"""What differences of evidence are divided by before they count as odds: evidence takes every
formula for exact, and none is."""
_ROWS_EACH = 8
LARGEST = 10


@dataclass(slots=True)
class Search:
    """Sets visited, each at its optimum; keys beside those of the frames."""

    equations: Equations
    noise: NoisePrior
    always: Subset
    largest: int
    found: dict[Subset, Optimum]
    believed: Callable[[Optimum], float]
    barred: set[str] = field(default_factory=set)
    """Names that no set may hold any more."""
    _belief: dict[Subset, float] = field(default_factory=dict)

    def optimum(
        self, subset: Iterable[str], start: Optimum | None = None, scale: Scale = ()
    ) -> Optimum:
        """Return (and keep) a set at its optimum.

        Args:
            subset: keys.
            start: another set that it is near to.
            scale: key and first log scale of a candidate that is not in that.
        """
        key = tuple(sorted(subset))
        if key not in self.found:
            by_key = self.equations.by_key
            first = {k: np.full(by_key[k].families, v) for k, v in scale}
            self.found[key] = optimum(
                self.equations, (*self.always, *key), self.noise, start, first
            )
        return self.found[key]

    def score(self, subset: Iterable[str]) -> float:
        """Return the log posterior of a visited set [nats], up to a constant."""
        at = self.found[tuple(sorted(subset))]
        if at.keys not in self._belief:
            self._belief[at.keys] = self.believed(at)
        is_barred = any(self.equations.by_key[k].name in self.barred for k in at.keys)
        return -np.inf if is_barred else self.worth(at) + self._belief[at.keys]

    def scan(self, at: Optimum) -> Scan:
        """Return what candidates would bring to a visited set."""
        return Scan.of(self.equations, at, self.noise)

    def worth(self, at: Optimum) -> float:
        """Return evidence and prior odds of an optimum."""
        return at.value + sum(self.equations.by_key[k].odds for k in at.keys)

    @property
    def best(self) -> Subset:
        """The most probable set."""
        return max(self.found, key=lambda s: (self.score(s), s))

    def is_admissible(self, subset: Iterable[str]) -> bool:
        """Return whether no slot is taken twice, and the rows suffice for so many.

        The ripple of a joint has one form, waves or a table: both together fit the rows as well in
        ways that cancel where there are some, and run away where there are none.
        """
        keys = list(subset)
        each = [self.equations.by_key[k] for k in keys]
        slots, names = [c.slot for c in each], {c.name for c in each}
        waves = {joint for c in each for joint in c.waves}
        tables = {joint for c in each for joint in c.tables}
        if not names.isdisjoint(self.barred) or not waves.isdisjoint(tables):
            return False
        return len(set(slots)) == len(slots) and len(names) <= self.largest

    def promising(
        self, scan: Scan, gone: Subset = (), without: Subset = (), count: int = _TRIED
    ) -> tuple[float, list[tuple[float, str, float]]]:
        """Return the worth of a set without some candidates, and what others would make of it.

        Args:
            scan: the set.
            gone: its candidates that are left out.
            without: candidates that are not looked at.
            count: how many are told.

        Returns:
            Worth; and worth, key, log scale of each, best first.
        """
        odds = {k: c.odds for k, c in self.equations.by_key.items()}
        here = self.worth(scan.at) - sum(odds[k] for k in gone)
        base = tuple(k for k in scan.at.keys if k not in gone and k not in self.always)
        alone, told = scan.without(gone)
        found = [
            (here + gain + odds[key], key, scale)
            for key, (gain, scale) in told.items()
            if key not in self.always and key not in without and self.is_admissible((*base, key))
        ]
        return here + alone, sorted(found, key=lambda f: (-f[0], f[1]))[:count]

    def inclusion(self) -> dict[str, float]:
        """Return the probability of each key over the sets visited, tempered."""
        keys = list(self.found)
        values = np.array([self.score(k) for k in keys])
        weight = np.exp((values - values.max()) / TEMPERATURE)
        weight /= weight.sum()
        found: dict[str, float] = {}
        for subset, share in zip(keys, weight, strict=True):
            for key in subset:
                found[key] = found.get(key, 0.0) + float(share)
        return found


def search(
    equations: Equations,
    noise: NoisePrior,
    always: Subset = (),
    starts: Iterable[Subset] = (),
    believed: Callable[[Optimum], float] = lambda at: 0.0,
    rows: int = 10**6,
    near: Optimum | None = None,
    deep: bool = True,
) -> Search:
    """Return the sets near the most probable one.

    Args:
        equations: products of all candidates.
        noise: what is known of it.
        always: keys of the frames.
        starts: sets to begin with beside the empty one.
        believed: logarithm of the prior of the signs and shapes of the numbers of an optimum.
        rows: how many there are.
        near: a set whose scales and noise are the start of the empty one.
        deep: look at exchanges, too.
    """
    most = int(np.clip(rows // _ROWS_EACH, 1, LARGEST))
    state = Search(equations, noise, always, most, {}, believed)
    ends = []
    for start in ((), *starts):
        if state.is_admissible(start) and tuple(sorted(start)) not in state.found:
            state.optimum(start, near)
            ends.append(climbed(state, tuple(sorted(start))))
    if deep:
        explored(state, max(ends, key=state.score))
    return state


def explored(state: Search, here: Subset) -> None:
    """Look around a visited set, and around any better one that is found."""
    for _ in range(_MOVES):
        _look_around(state, here)
        if state.score(state.best) <= state.score(here) + 1e-6:
            # what has no name may stand for several causes
            for key in here:
                if state.equations.by_key[key].sort in (Sort.CLASS, Sort.RESEMBLANCE):
                    base = tuple(k for k in here if k != key)
                    state.optimum(base, state.found[here])
                    climbed(state, base, (key,))
        better = state.best
        if state.score(better) <= state.score(here) + 1e-6:
            return
        here = climbed(state, better)


def climbed(state: Search, here: Subset, without: Subset = ()) -> Subset:
    """Add one candidate at a time, but certain ones, as long as that helps."""
    for _ in range(_MOVES):
        at = state.found[here]
        told = state.promising(state.scan(at), without=without)[1]
        near = [t for t in told if t[0] > state.score(here) - _NEAR]
        tried = [tuple(sorted((*here, key))) for _, key, _ in near]
        for more, (_, key, scale) in zip(tried, near, strict=True):
            state.optimum(more, at, ((key, scale),))
        better = max(tried, key=lambda s: (state.score(s), s), default=here)
        if state.score(better) <= state.score(here) + 1e-6:
            return here
        here = better
    return here


def _look_around(state: Search, here: Subset) -> None:
    """Look at sets with candidates dropped, one exchanged, or one in the place of two."""
    at, top = state.found[here], state.score(here)
    scan, off = state.scan(at), 0.0
    for size in (1, 2):
        for gone in itertools.combinations(here, size):
            base = tuple(k for k in here if k not in gone)
            alone, told = state.promising(scan, gone, count=_TRIED + 1)
            if alone > top - _NEAR:
                state.optimum(base, at)
            own = [worth for worth, key, _ in told if key in gone]
            if size == 1:
                off = max(off, top - own[0]) if own else off
            least = (own[0] if own and size == 1 else top - off) - _NEAR
            for worth, key, scale in told:
                if key not in gone and worth > least:
                    state.optimum((*base, key), at, ((key, scale),))
