"""How sure a model is of the tool point, and where: the table ``[reach]`` of a model file.

The file keeps what a campaign left of its own doubt: by how much rows that were not fitted were
missed, in which directions the numbers of the effects may still be wrong, and which poses and loads
were measured at all.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from postproc.arrays import TINY, BoolArray, FloatArray, IntArray
from postproc.records import dataclass
from postproc.units import DEG, MM

_SAME = 1.0 * DEG
"""Within this angle of a joint a pose is one that was measured."""
_MARGIN = 0.1
"""Share of half the width measured that counts as measured: thirty poses do not reach to the ends
of what they were drawn from."""
_OWN = 0.5
"""Leverage of a pose on the ellipsoid from which it tells more of itself than the others do."""
_DIGITS = 4


@dataclass(frozen=True, slots=True)
class Reach:
    """What a campaign says of the tool point at other poses.

    left: 3D rms [m] by which a point is missed beside what the numbers leave open; factor: radius
    that holds the point with 95 %, over the 3D standard deviation; low, high: (6,) range of the
    joints [rad]; centre (6,) [rad], root (6, 6) [1/rad]: poses with ``|root (q - centre)| <= 1``
    lie in the ellipsoid of those measured; force: largest [N]; spread: by effect (d, p), how its
    numbers may be wrong together in d independent ways, in their usual sizes; moved: 3D rms [m] by
    which the points differ without the model.
    """

    left: float
    factor: float
    low: FloatArray
    high: FloatArray
    centre: FloatArray
    root: FloatArray
    force: float
    spread: Mapping[str, FloatArray]
    moved: float = 0.0

    @classmethod
    def around(
        cls,
        q: FloatArray,
        force: float,
        left: float,
        factor: float,
        spread: Mapping[str, FloatArray],
        moved: float = 0.0,
    ) -> Reach:
        """Return the reach of poses (n, 6) [rad] that were measured.

        Each pose counts once, however often it was read. The ellipsoid holds each of them as the
        others have it, where they have it: a pose that tells itself most of where it lies says
        nothing of any between.
        """
        low, high, pose = q.min(axis=0), q.max(axis=0), cls.poses(q)
        q = np.stack([np.bincount(pose, v) for v in q.T], axis=1) / np.bincount(pose)[:, None]
        n, centre = max(len(q), 2), q.mean(axis=0)
        X = q - centre
        floor = _SAME**2 * np.eye(6)
        root = np.linalg.inv(np.linalg.cholesky(X.T @ X / n + floor))
        square = np.sum((X @ root.T) ** 2, axis=1)
        others = (X.T @ X - n / (n - 1) * X[:, :, None] * X[:, None, :]) / (n - 1) + floor
        away = n / (n - 1) * X
        left_out = np.einsum("ni,ni->n", away, np.linalg.solve(others, away[:, :, None])[:, :, 0])
        square = np.where((square + 1.0) / n < _OWN, left_out, square)
        most = max(float(np.sqrt(square.max(initial=0.0))), 1.0)
        return cls(left, factor, low, high, centre, root / most, force, spread, moved)

    @staticmethod
    def poses(q: FloatArray) -> IntArray:
        """Return which pose 0.. each row (n, 6) [rad] reads: readings of one are no two."""
        label = np.unique(np.round(q / _SAME), axis=0, return_inverse=True)[1]
        return label.reshape(len(q)).astype(np.int32)

    def beyond(self, q: FloatArray) -> FloatArray:
        """Return how far poses (n, 6) [rad] are outside, over half the width measured; 0 inside."""
        half = 0.5 * (self.high - self.low) + _SAME
        box = np.abs(q - 0.5 * (self.high + self.low)) / half
        length = np.linalg.norm((q - self.centre) @ self.root.T, axis=1)
        return np.asarray(np.maximum(np.maximum(box.max(axis=1), length) - 1.0 - _MARGIN, 0.0))

    def share(self, q: FloatArray) -> FloatArray:
        """Return how much of the model's displacement is believed at poses (n, 6): 1 inside.

        It falls with the distance, to nothing as far outside as the campaign reached.
        """
        return np.asarray(np.maximum(1.0 - self.beyond(q), 0.0))

    def holds(self, q: FloatArray, wrench: FloatArray | None) -> BoolArray:
        """Return whether poses (n, 6) [rad] under loads (n, 6) [N, N*m] were reached."""
        inside = self.beyond(q) <= 0.0
        if wrench is None:
            return inside
        return np.asarray(inside & (np.linalg.norm(wrench[:, :3], axis=1) <= 1.05 * self.force))

    def radius(self, q: FloatArray, spread: FloatArray) -> FloatArray:
        """Return the radii (n,) [m] of 95 % at poses (n, 6) [rad].

        ``spread`` (n,): 3D standard deviation that the numbers leave open [m]. Outside, as much as
        the model is not believed any more of what it moves may be wrong.
        """
        astray = (1.0 - self.share(q)) * self.moved
        return np.asarray(self.factor * np.hypot(np.hypot(self.left, spread), astray))

    def doubt(self, q: FloatArray) -> FloatArray:
        """Return how much more the tool may be off at poses (n, 6) than inside: log of the ratio.

        Of what compensation leaves, as ``radius`` has it.
        """
        astray = (1.0 - self.share(q)) * self.moved
        return np.asarray(np.log(np.hypot(1.0, astray / max(self.left, TINY))))

    def table(self) -> dict[str, Any]:
        """Return the table of the model file."""
        angles = {"q_low_deg": self.low, "q_high_deg": self.high, "q_centre_deg": self.centre}
        return {
            "left_mm": _rounded(self.left / MM),
            "moved_mm": _rounded(self.moved / MM),
            "u95_factor": _rounded(self.factor),
            **{key: np.round(value / DEG, _DIGITS).tolist() for key, value in angles.items()},
            "q_root_per_deg": _rounded(self.root * DEG),
            "force_N": _rounded(self.force),
            "spread": {name: _rounded(draws) for name, draws in self.spread.items()},
        }

    @classmethod
    def read(cls, table: Mapping[str, Any]) -> Reach:
        """Return the reach of a table; KeyError, ValueError or TypeError where it is none."""
        spread = table["spread"]
        draws = {name: _numbers(spread, name, (None, None)) for name in dict(spread)}
        if len({len(part) for part in draws.values()}) > 1:
            raise ValueError("spread")
        low, high, centre = (
            _numbers(table, key, (6,)) * DEG for key in ("q_low_deg", "q_high_deg", "q_centre_deg")
        )
        left, factor, force = (
            float(_numbers(table, key, ())) for key in ("left_mm", "u95_factor", "force_N")
        )
        root = _numbers(table, "q_root_per_deg", (6, 6)) / DEG
        moved = float(_numbers(table, "moved_mm", ())) * MM if "moved_mm" in table else 0.0
        found = cls(left * MM, factor, low, high, centre, root, force, draws, moved)
        for key in table:
            if key not in found.table():
                raise KeyError(key)
        return found


def _numbers(table: Mapping[str, Any], key: str, shape: tuple[int | None, ...]) -> FloatArray:
    """Return finite numbers of a shape."""
    try:
        values = np.asarray(table[key], dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(key) from None
    fits = len(values.shape) == len(shape) and all(
        want in (None, have) for want, have in zip(shape, values.shape, strict=True)
    )
    if not fits or not np.all(np.isfinite(values)):
        raise ValueError(key)
    return values


def _rounded(values: FloatArray | float) -> Any:  # noqa: ANN401 - a number or nested lists
    """Return numbers with four digits."""
    array = np.asarray(values, dtype=np.float64)
    size = np.where(array == 0.0, 1.0, np.abs(array))
    scale = 10.0 ** (_DIGITS - 1 - np.floor(np.log10(size)))
    return (np.round(array * scale) / scale + 0.0).tolist()
