"""Mutants of an emitted program: every small fault of the text, by rule, and who notices it.

    python -m tools.mutants PROGRAM.src --cell CELL.toml --against INPUT [--each N] [--seed S]
    python -m tools.mutants fixtures [--each N] [--seed S]

A mutant changes one thing: a number, a word, a line that is lost, swapped or put in. ``verify``
(with the CAM file) and ``lint`` judge each as they judge any program. What neither notices is
executed beside the program (``effect``): it does the very same, or the same cuts on another way
through the air that is free, or it is a hole in the checks.
"""

from tools.mutants.cases import Case, cases_of
from tools.mutants.judge import Judgement, judge
from tools.mutants.rules import MUST_CATCH, Mutant, mutants

__all__ = ["MUST_CATCH", "Case", "Judgement", "Mutant", "cases_of", "judge", "mutants"]
