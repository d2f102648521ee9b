"""Contracts of what can be plugged in, for the tests of the packages that bring it.

>>> from postproc.testing import check_effect                          # doctest: +SKIP
>>> check_effect(MY_EFFECT)                                            # doctest: +SKIP

Each check returns nothing, or raises ``PluginError`` with what the part breaks. The built-in parts
are held to the same.
"""

from postproc.testing.effect import check_effect
from postproc.testing.emitter import check_emitter
from postproc.testing.made import made_cell, made_plan, made_samples, made_states
from postproc.testing.objective import check_objective
from postproc.testing.reader import check_reader

__all__ = [
    "check_effect",
    "check_emitter",
    "check_objective",
    "check_reader",
    "made_cell",
    "made_plan",
    "made_samples",
    "made_states",
]
