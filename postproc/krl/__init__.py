"""KRL as data: program type, numbers, rendering, parsing, linting, splitting.

All that ``krl.text`` offers is offered here.
"""

from postproc.krl import text
from postproc.krl.lint import lint
from postproc.krl.rules.scope import AXES_TYPES, POSE_TYPES, declared_names, structure_of
from postproc.krl.rules.subject import LintOptions
from postproc.krl.system import (
    Effect,
    SystemVariable,
    initial_values,
    system_variable,
    system_variables,
)
from postproc.krl.text import *  # noqa: F403 - its names stand once, there
from postproc.krl.text import numbers
