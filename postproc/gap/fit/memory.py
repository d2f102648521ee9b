"""What the likelihood remembers: a wander of the measurement in time, a smooth rest in joint space.

Both are Gaussian processes written as columns with a standard normal prior each, and integrated
out before anything is compared: an effect has to explain what neither of them does. Leaving them
out gives biased numbers with small intervals (Kennedy and O'Hagan 2001, J. R. Stat. Soc. B 63,
425); how large they may be is their content (Brynjarsdottir and O'Hagan 2014, Inverse Problems 30,
114007), so both are scaled by the evidence of the rows beside every candidate at once, and are
nothing unless that clearly asks for them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.gap.data import Samples
from postproc.gap.effect import Basis, Effect, Kind, Parameter, Setting
from postproc.gap.fit.linear import Block, NormalEquations
from postproc.gap.fit.noise import Noise
from postproc.records import dataclass
from postproc.units import DEG

REST = "memory:rest"
"""Key of the smooth rest; all others are wanders."""
_KNOTS = 24
"""Most knots of the wander at a station."""
_FEATURES = 36
_LENGTH = 40.0 * DEG
"""Angle over which the smooth rest changes."""
_FEELS = np.array([1.0, 1.0, 1.0, 0.5, 0.7, 0.3])
"""How much of that each joint counts for."""
_SIZES = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Sizes tried, in white noise; the wander is noise only up to the third of it."""
_SCALES = (0.02, 0.06, 0.2)
"""Correlation times tried, over the length of the campaign."""
_SURE = 5.0
"""Nats that a process must bring to be there."""
_ROUNDS, _SETTLED = 4, 0.02
_SEED = 23


class _Process(Effect):
    """A zero-mean process as columns; it is no effect and never among them."""

    kind = Kind.ALTERNATIVE
    title = "correlated noise"
    source = "Gaussian process"
    action = ""

    def __init__(self, name: str) -> None:
        """Name it."""
        self.name = name  # type: ignore[misc]

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Return nothing: the columns are made once, for the rows of a search."""
        del setting
        return Basis(point=np.zeros((len(samples), 3, 0)))


@dataclass(frozen=True, slots=True)
class Memory:
    """The processes of a campaign: sizes per axis [m], correlation time [s] and their blocks.

    sigma: [m] per axis that rows scatter by beside all candidates and processes, and at least by
    the noise: what no candidate has the form of is seen in it, and is no noise.
    """

    wander: float
    correlation: float
    rest: float
    sigma: float
    blocks: tuple[Block, ...]


def processes(samples: Samples, unit: IntArray) -> tuple[Block, ...]:
    """Return the processes that rows may remember, each of unit size [m].

    Args:
        samples: all rows of a campaign.
        unit: (n,) set-up of the measuring device; its wander starts anew with each.
    """
    return (_block(REST, _smooth(samples)), *_wander(samples, unit))


def at_size(block: Block, like: Block) -> Block:
    """Return a process of unit size at the size that it has in another block."""
    return _block(block.key, block.X * float(like.setting["size"]), like.setting)


def memory_of(
    parts: Sequence[Block],
    y: FloatArray,
    weight: FloatArray,
    blocks: Sequence[Block],
    noise: Noise,
    most: float,
) -> Memory:
    """Return the processes that the rows ask for beside all candidates.

    Args:
        parts: processes of unit size, as ``processes`` gives them.
        y: (n, 3) gap [m].
        weight: (n,) 1/sigma [1/m] by the white noise.
        blocks: all candidates.
        noise: of the campaign; its wander counts where the revisited poses tell it.
        most: how far rows scatter [m] per axis beside all candidates without any process. Few rows
            leave so little freedom that the scatter beside both would end anywhere.
    """
    white = noise.white if np.isfinite(noise.white) else noise.sigma
    equations = NormalEquations.of((*blocks, *parts), y, weight)
    compare = _Comparison(equations, [b.key for b in blocks])
    sigma, found = white, dict[str, float]()
    for _ in range(_ROUNDS):
        before = sigma
        compare.scatter = before / white
        found = _sizes(compare, parts, noise, sigma)
        sigma = max(white, min(most, compare.left(found) * white))
        if abs(sigma / before - 1.0) < _SETTLED:
            break
    chosen = [b for b in parts if found.get(b.key)]
    wander = next((b for b in chosen if b.key != REST), None)
    return Memory(
        found.get(wander.key, 0.0) if wander else 0.0,
        float(wander.setting["scale"]) if wander else float("nan"),
        found.get(REST, 0.0),
        sigma,
        tuple(_scaled(b, found[b.key]) for b in chosen),
    )


def _sizes(
    compare: _Comparison, parts: Sequence[Block], noise: Noise, sigma: float
) -> dict[str, float]:
    """Return the sizes [m] of the processes that rows ask for where they scatter by ``sigma``."""
    waves = [b for b in parts if b.key != REST]
    best, found = compare.evidence({}), dict[str, float]()
    told = noise.wander > 0.0
    if told and waves:
        near = min(waves, key=lambda b: abs(np.log(b.setting["scale"] / noise.correlation)))
        found = {near.key: noise.wander}
        best = compare.evidence(found)
    best, found = _grown(compare, REST, [size * sigma for size in _SIZES[1:]], best, found)
    for block in [] if told else waves:
        sizes = [size * sigma for size in _SIZES[1:4]]
        let = [size for size in sizes if noise.lets(size, block.setting["scale"])]
        best, found = _grown(compare, block.key, let, best, found)
    return found


def _grown(
    compare: _Comparison, key: str, sizes: Sequence[float], best: float, found: dict[str, float]
) -> tuple[float, dict[str, float]]:
    """Return evidence and sizes with one more process [m], where it is worth its price."""
    kept = {k: v for k, v in found.items() if k == REST or key == REST}
    for size in sizes:
        trial = kept | {key: size}
        value = compare.evidence(trial)
        price = _SURE if key not in found and len(found) == len(kept) else 0.0
        if value > best + price:
            best, found = value, trial
    return best, found


@dataclass(slots=True)
class _Comparison:
    """Evidence of all candidates beside processes of given sizes, from one set of products.

    scatter: of the rows, over the noise that the products are in units of.
    """

    equations: NormalEquations
    candidates: Sequence[str]
    scatter: float = 1.0

    def evidence(self, sizes: dict[str, float]) -> float:
        """Return it [nats]; ``sizes`` per axis [m], by key."""
        G, b = self._products(sizes)
        L = np.linalg.cholesky(G + np.eye(len(b)))
        z = np.linalg.solve(L, b)
        return float(0.5 * z @ z - np.sum(np.log(np.diag(L))))

    def left(self, sizes: dict[str, float]) -> float:
        """Return what all leave together, root mean square per degree of freedom."""
        G, b = self._products(sizes)
        inverse = np.linalg.inv(G + np.eye(len(b)))
        theta = inverse @ b
        explained = float(theta @ (2.0 * b - G @ theta))
        square = self.equations.total / self.scatter**2 - explained
        free = 3.0 * self.equations.rows - len(b) + float(np.trace(inverse))
        return self.scatter * float(np.sqrt(max(square, 0.0) / max(free, 1.0)))

    def _products(self, sizes: dict[str, float]) -> tuple[FloatArray, FloatArray]:
        scale = np.ones(len(self.equations.b))
        for key, size in sizes.items():
            scale[self.equations.index([key])] = size
        i = self.equations.index([*self.candidates, *sizes])
        G = self.equations.G[np.ix_(i, i)] * np.outer(scale[i], scale[i])
        return G / self.scatter**2, self.equations.b[i] * scale[i] / self.scatter**2


def _block(key: str, X: FloatArray, setting: Setting | None = None) -> Block:
    parameters = tuple(Parameter(f"{key}_{k}", 1.0) for k in range(X.shape[2]))
    return Block(_Process(key), setting or {}, parameters, X, key)


def _scaled(block: Block, size: float) -> Block:
    return _block(block.key, block.X * size, {**block.setting, "size": size})


def _in_space(features: FloatArray) -> FloatArray:
    """Return (n, 3, 3 k): each of k functions (n, k) along x, y and z."""
    n, k = features.shape
    return np.asarray(np.einsum("ij,nk->nijk", np.eye(3), features).reshape(n, 3, 3 * k))


def _wander(samples: Samples, unit: IntArray) -> list[Block]:
    """Return first-order wanders of unit size, one for each correlation time."""
    time = samples.course
    if float(np.ptp(time)) <= 0.0:
        return []
    length = max(float(np.ptp(time[unit == u])) for u in np.unique(unit))
    found = []
    for share in _SCALES:
        scale = share * length
        parts = [_station(time, unit == u, scale) for u in np.unique(unit)]
        X = _in_space(np.concatenate(parts, axis=1))
        found.append(_block(f"memory:wander {share:g}", X, {"scale": scale}))
    return found


def _station(time: FloatArray, here: np.ndarray, scale: float) -> FloatArray:
    """Return (n, k) the wander of one station between knots."""
    start, end = float(time[here].min()), float(time[here].max())
    count = int(np.clip(2.0 * (end - start) / scale, 3, _KNOTS))
    knots = np.linspace(start, max(end, start + 1.0), count)
    step = knots[1] - knots[0]
    hat = np.maximum(1.0 - np.abs(time[:, None] - knots) / step, 0.0) * here[:, None]
    K = np.exp(-np.abs(knots[:, None] - knots) / scale)
    return np.asarray(hat @ np.linalg.cholesky(K + 1e-9 * np.eye(count)))


def _smooth(samples: Samples) -> FloatArray:
    """Return (n, 3, 3 k) a smooth function of the joint angles, of unit size.

    Source:
        Random Fourier features: Rahimi and Recht 2007.
    """
    rng = np.random.default_rng(_SEED)
    rate = rng.normal(size=(_FEATURES, 6)) * _FEELS / _LENGTH
    phase = rng.uniform(0.0, 2.0 * np.pi, _FEATURES)
    features = np.sqrt(2.0 / _FEATURES) * np.cos(samples.q @ rate.T + phase)
    return _in_space(features)
