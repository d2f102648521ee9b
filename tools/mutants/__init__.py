"""Mutants of an emitted program: every small fault of the text, by rule, and who notices it.

    python -m tools.mutants PROGRAM.src --cell CELL.toml --against INPUT [--every N]

A mutant changes one thing: a number, a word, a line that is lost, swapped or put in. ``verify``
(with the CAM file) and ``lint`` judge each as they judge any program. What neither notices is on
the list of harmless ones, with the reason why, or a hole in the checks.
"""

from tools.mutants.judge import Judgement, judge
from tools.mutants.rules import HARMLESS, MUST_CATCH, Mutant, harmless, mutants

__all__ = ["HARMLESS", "MUST_CATCH", "Judgement", "Mutant", "harmless", "judge", "mutants"]
