"""Friction holds the joints back in proportion to what they carry (an alternative, never named)."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Arm, Samples, carried_torque
from postproc.gap.effect import Basis, Effect, Kind, Parameter, Setting, register

_MOST_COLUMNS = 3


@register
class FrictionWindup(Effect):
    """Give against the last motion that changes with something.

    With the torque the joint carries, with that of axis 2 (how far the arm is stretched out, which
    loads the bearings of all joints), with the temperature, or with a column that no effect
    knows (such as the dwell before the reading).
    The part that does not change is backlash to any measurement.
    """

    name = "friction_windup"
    title = "behaves like friction wind-up: approach side times torque"
    source = "J (friction torque times sign of motion) / K"
    action = "vary speed and dwell before the reading, and measure again"
    kind = Kind.ALTERNATIVE
    needs = ("direction",)
    conditions = ("approach",)

    def prepare(self, samples: Samples) -> Setting:
        """Return what the give may change with: names, mean and spread of numeric columns."""
        found: dict[str, tuple[float, float]] = {}
        for name, values in _numbers(samples).items():
            spread = float(np.std(values))
            if spread > 0.0 and len(found) < _MOST_COLUMNS:
                found[name] = (float(np.mean(values)), spread)
        return {"columns": found}

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return for each joint the part that changes with the torque, then with columns."""
        del arm
        ways = ["linear", "root", "shoulder"]
        ways += [f"{name}_{power}" for name in setting["columns"] for power in (1, 2)]
        return tuple(
            Parameter(f"joint_{i}_{way}", 1e-4, joint=i) for way in ways for i in range(1, 7)
        )

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn each joint by its side times each form, mean taken out.

        A column that these rows do not have counts as usual: poses yet to be measured.
        """
        side = samples.column("direction")
        torque = np.abs(carried_torque(samples))
        size = torque / (np.mean(torque, axis=0) + 1e-12)
        root = np.sqrt(size)
        shoulder = np.broadcast_to(size[:, 1:2] - 1.0, size.shape)
        forms = [size - 1.0, root - np.mean(root, axis=0), shoulder]
        numbers = _numbers(samples)
        for name, (mean, spread) in setting["columns"].items():
            z = (numbers.get(name, np.full(len(samples), mean)) - mean)[:, None] / spread
            forms += [z, np.clip(z**2 - 1.0, -2.0, 3.0)]
        joint = np.zeros((len(samples), 6, 6 * len(forms)))
        for column, form in enumerate(forms):
            for i in range(6):
                joint[:, i, 6 * column + i] = (side * form)[:, i]
        return Basis(joint=joint)


def _numbers(samples: Samples) -> dict[str, FloatArray]:
    """Return the temperature and the complete numeric columns that no effect knows."""
    found = {} if samples.temperature is None else {"temperature": samples.temperature}
    for name, values in samples.extra.items():
        array = np.asarray(values)
        if array.dtype.kind in "fiu" and bool(np.all(np.isfinite(array))):
            found[name] = array.astype(np.float64)
    return found
