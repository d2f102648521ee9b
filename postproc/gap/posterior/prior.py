"""What is believed before a row is read: widths of numbers, scales of groups, odds of causes.

Each number of an effect is drawn as its width (``Parameter.typical``) times a scale that all
numbers of its family share, times a standard normal. The scale has a half-Cauchy prior of size 1:
an effect of the usual size is as likely as one of a third or of three times it, and one of ten
times is no wonder. So no width has to be right, and none holds a whole group's size.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.gap.data import Samples
from postproc.gap.effect import Effect, Kind, Setting
from postproc.gap.fit import WIDE, unit_root
from postproc.gap.posterior.classes import Group
from postproc.gap.robot_model import columns
from postproc.records import dataclass

LOG_SCALES = np.linspace(-5.0, 4.0, 19)
"""Logarithms of group scales over which evidence is summed."""
CLASS_WIDTH = 1e-4
"""Usual 3D size [m] of each function of a class that no effect has the formula of."""
ODDS = {
    "common": -1.0,
    "cause": -3.0,
    "rare": -7.0,
    "resemblance": -5.0,
    "class": -8.0,
    "wander": -3.0,
}
"""Logarithm of the odds that a candidate is there: one cause of twenty is in a campaign, a rare one
in one of a thousand, what every arm has in one of four large enough to be seen; of what has no name
each single form is seldom."""
LOW_ORDER = 6
"""Waves up to this order are tried for each joint."""
_LOG_WAVES, _LOG_LOW_WAVES = 6.6, 3.4
"""Logarithm of the joints and orders among which a wave is sought, and of those of low order."""


class Sort(StrEnum):
    """What a candidate is to a diagnosis."""

    FRAME = "frame"
    """Of a registration: in every model, of fixed width."""
    CAUSE = "cause"
    RESEMBLANCE = "resemblance"
    """An effect that is never named."""
    CLASS = "class"
    """A function of something logged that no effect has the formula of."""
    WANDER = "wander"
    """Correlated noise."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """Columns (n, 3, k) [m] of what may be in a model, for numbers of unit prior.

    key: its own; name: of the effect or class; slot: of two candidates of one slot a model has one
    at most; family: (k,) 0.. numbers that share a scale; odds: logarithm, before any row; fixed:
    the scale is 1 whatever the rows say; effect, setting: where it is one, and of its numbers the
    root (k, k) of the prior and the least (k,), SI; waves, tables: joints over whose angle it has
    such; group: where it is a class.
    """

    key: str
    name: str
    sort: Sort
    slot: str
    X: FloatArray
    family: IntArray
    odds: float
    effect: Effect | None = None
    setting: Setting | None = None
    root: FloatArray | None = None
    lower: FloatArray | None = None
    waves: frozenset[int] = frozenset()
    tables: frozenset[int] = frozenset()
    group: Group | None = None

    @property
    def fixed(self) -> bool:
        """Whether its scale is 1 whatever the rows say."""
        return self.sort is Sort.FRAME

    @property
    def is_device(self) -> bool:
        """Whether it is of the measuring device, or nothing but a course of time."""
        if self.group is not None:
            return self.group.kind == "time" and self.group.of in ("station", "reflector")
        return self.sort is Sort.WANDER or (self.effect is not None and not self.effect.is_arms)

    @property
    def families(self) -> int:
        """How many scales it has."""
        return int(self.family.max()) + 1


def of_effect(
    effect: Effect, samples: Samples, setting: Setting, key: str = "", always: bool = False
) -> Candidate:
    """Return the candidate of an effect.

    Args:
        effect: of the library.
        samples: rows at the pose that the columns are for.
        setting: of the effect.
        key: of the candidate; "": the effect's name.
        always: a frame of the registration.
    """
    parameters = effect.parameters(samples.arm, setting)
    root = unit_root(effect, samples.arm, setting) * (WIDE if always else 1.0)
    X = columns(samples, effect.basis(samples, setting)) @ root
    if always:
        sort = Sort.FRAME
    else:
        sort = Sort.RESEMBLANCE if effect.kind is Kind.ALTERNATIVE else Sort.CAUSE
    odds = 0.0 if always else odds_of(effect, setting)
    key = key or effect.name
    slot = key if effect.may_be_several else effect.name
    order = list(dict.fromkeys(p.family for p in parameters))
    family = np.array([order.index(p.family) for p in parameters], dtype=np.int32)
    lower = np.array([p.lower for p in parameters])
    waves = frozenset(int(joint) for joint, _ in (setting["waves"] if effect.periodic else ()))
    tables = frozenset(map(int, setting["joint"] if effect.on_demand else ()))
    of = effect, setting, root, lower, waves, tables
    return Candidate(key, effect.name, sort, slot, X, family, odds, *of)


def odds_of(effect: Effect, setting: Setting) -> float:
    """Return the logarithm of the odds that an effect, in one variant, is there."""
    sort = Sort.RESEMBLANCE if effect.kind is Kind.ALTERNATIVE else Sort.CAUSE
    kind = "rare" if effect.is_rare else "common" if effect.is_common else str(sort)
    odds = ODDS[kind]
    orders = [n for _, n in setting["waves"]] if effect.periodic else []
    return odds - (_LOG_LOW_WAVES if min(orders) <= LOW_ORDER else _LOG_WAVES) if orders else odds


def of_group(group: Group) -> Candidate:
    """Return the candidate of a class."""
    k = group.X.shape[2]
    key = f"class:{group.kind}:{group.of}:{group.shape}"
    X = group.X * (CLASS_WIDTH / np.sqrt(k))
    odds = ODDS["class"] - group.price
    family = np.zeros(k, dtype=np.int32)
    return Candidate(key, key, Sort.CLASS, key, X, family, odds, group=group)


def wander(parts: Iterable[tuple[str, FloatArray]]) -> list[Candidate]:
    """Return the candidates of a wander of the readings, of which one may be there.

    Args:
        parts: key and columns (n, 3, k) of unit size [m].
    """
    return [
        Candidate(
            key,
            "wander",
            Sort.WANDER,
            "wander",
            X * 3e-5,
            np.zeros(X.shape[2], dtype=np.int32),
            ODDS["wander"],
        )
        for key, X in parts
    ]


def log_half_cauchy(log_scale: FloatArray) -> FloatArray:
    """Return the density of log scales under a half-Cauchy prior of size 1, as a logarithm."""
    return np.asarray(np.log(2.0 / np.pi) + log_scale - np.log1p(np.exp(2.0 * log_scale)))


@dataclass(frozen=True, slots=True)
class Block:
    """Candidates of k numbers each: keys, columns (m, k), products (m, k, k) and with the gap."""

    keys: tuple[str, ...]
    index: IntArray
    own: FloatArray
    told: FloatArray


@dataclass(frozen=True, slots=True)
class Equations:
    """Products of the columns of all candidates on weighted rows.

    A: (m, K) columns; z: (m,) gap; both in metres times the root of the row's relative weight;
    row: (m,) number of the row of each reading; H: (K, K) products of the columns; b: (K,) those
    with the gap; blocks: candidates by their size.
    """

    candidates: Sequence[Candidate]
    A: FloatArray
    z: FloatArray
    row: IntArray
    H: FloatArray
    b: FloatArray
    slices: Mapping[str, slice]
    by_key: Mapping[str, Candidate]
    blocks: tuple[Block, ...]

    @classmethod
    def of(cls, candidates: Sequence[Candidate], z: FloatArray, root: FloatArray) -> Equations:
        """Return the products.

        Args:
            candidates: with columns (n, 3, k) [m].
            z: (n, 3) gap [m].
            root: (n, 3, 3) root of the relative weight of each row; 0 leaves a row out.
        """
        read = np.any(root != 0.0, axis=2).ravel()
        use = np.flatnonzero(np.any(root != 0.0, axis=(1, 2)))
        A = np.empty((int(read.sum()), sum(c.X.shape[2] for c in candidates)))
        slices, of_size, start = {}, dict[int, list[str]](), 0
        for c in candidates:
            size = c.X.shape[2]
            slices[c.key] = slice(start, start + size)
            weighted = (root[use] @ c.X[use]).reshape(3 * len(use), size)
            A[:, start : start + size] = weighted[read.reshape(-1, 3)[use].ravel()]
            if size:
                of_size.setdefault(size, []).append(c.key)
            start += size
        flat = np.einsum("nij,nj->ni", root, z).ravel()[read]
        row = np.repeat(np.arange(len(root)), 3).astype(np.int32)[read]
        H, b = A.T @ A, A.T @ flat
        blocks = []
        for size, keys in of_size.items():
            first = np.array([slices[key].start for key in keys])
            index = (first[:, None] + np.arange(size)).astype(np.int32)
            own = H[index[:, :, None], index[:, None, :]]
            blocks.append(Block(tuple(keys), index, own, b[index]))
        by_key = {c.key: c for c in candidates}
        return cls(candidates, A, flat, row, H, b, slices, by_key, tuple(blocks))

    @property
    def readings(self) -> int:
        """How many numbers were read."""
        return len(self.z)

    @property
    def square(self) -> float:
        """Square of the gap [m^2]."""
        return float(self.z @ self.z)

    def among(self, keys: Sequence[str]) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return columns (p,), products (p, p) and products with the gap (p,) of candidates."""
        every = np.arange(self.A.shape[1], dtype=np.int32)
        index = np.concatenate([every[:0], *(every[self.slices[key]] for key in keys)])
        return index, self.H[np.ix_(index, index)], self.b[index]
