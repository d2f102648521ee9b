"""What a controller would refuse or silently change, seen from the text alone.

Row n of the table is code ``KRL1nn``; E must not be shipped, W is worth a look, N a note.

===  ====  =====================================================================================
row  sev.  check
===  ====  =====================================================================================
1    E     every line parses as KRL
2    E     DEF and END and all blocks balanced; no bare INI, inline-form text, G-code, ``//``
3    E     DEF and DEFDAT called as the file; no two modules of one name
4    E     names at most 24 characters with their prefix, legal, unique; GLOBAL ones in all files
5    E W N every name declared (E), every called routine there (W; N for PP_ hooks), unused points
6    E     declarations first and without value in a .src; on one line in a .dat
7    E     literals finite, components known, not repeated, axes and poses not mixed; no wait < 0
8    E W   ASCII, CR LF, no byte order mark, final newline, lines and files not too long
9    E     INI once and in the main program only; tool with its load and base behind it
10   E     tool and base numbers exist; 0 only on request; frame data of forms agree
11   E     the first motion (also behind calls that move) is a PTP that says the whole pose
12   E W   S and T in range and in agreement about A5; S constant along a path
15   E W   path speed above 0 and within the limit; BAS clamps above the default
16   E     axis speeds 0 to 100 %, index 1 to 6; orientation speed within the limit
17   E W   $ADVANCE 0 to 5; $APO in range, not 0 where blended, at most half of a segment
18   E W   no blending at turning points, before plunges, at the end, before waits, at borders
20   W     what stops the advance run between two path motions
21   W     the spindle is switched off again; no cut before it runs
22   E W   a trigger has its motion; priorities in range; interrupts declared, once; BRAKE in them
23   E W   folds balanced; visible text, parameters, code and frame data of forms agree
24   E W   circles through three points that are apart and not on a line
25   W     external axes on all points or none, as the controller has them
26   W     no date, no time, no -0 in the text
27   E W   types and elements exist, values fit what takes them, motions go to points
28   E W   calls fit their routine, functions have a value, parameters are declared
29   E     every GOTO has its label in the routine, once
30   E W   system variables exist, are not read only where set, take their constants and numbers
31   E     in a spline block only its segments, triggers and times
===  ====  =====================================================================================

Rows 13 (limits, turns, singularities), 14 (pose against the plan), 19 (axis speeds), and the parts
of 12, 15 and 21 that need the cell or the CAM file are ``postproc.verification.verify``.
"""

from __future__ import annotations

from collections.abc import Sequence

from postproc.errors import Finding, Severity
from postproc.krl.rules.blending import advance_stops, blending
from postproc.krl.rules.calls import calls
from postproc.krl.rules.circles import circles, external_axes, spline_blocks, status_and_turn
from postproc.krl.rules.declared import declared
from postproc.krl.rules.forms import folds, forms
from postproc.krl.rules.initial import first_motions, frame_numbers, initialised
from postproc.krl.rules.literals import literals, text, traces
from postproc.krl.rules.naming import file_names, legal_names
from postproc.krl.rules.process import spindle, triggers
from postproc.krl.rules.speeds import speeds
from postproc.krl.rules.structure import blocks, declarations, labels, parses
from postproc.krl.rules.subject import LintOptions, Rule, Subject
from postproc.krl.rules.system import system_variables
from postproc.krl.rules.types import types
from postproc.krl.text import KrlModule

RULES: tuple[Rule, ...] = (
    parses,
    blocks,
    file_names,
    legal_names,
    declared,
    declarations,
    literals,
    text,
    initialised,
    frame_numbers,
    first_motions,
    status_and_turn,
    speeds,
    blending,
    advance_stops,
    spindle,
    triggers,
    folds,
    forms,
    circles,
    external_axes,
    traces,
    types,
    calls,
    labels,
    system_variables,
    spline_blocks,
)
_ORDER = {Severity.ERROR: 0, Severity.WARNING: 1, Severity.NOTE: 2}


def lint(modules: Sequence[KrlModule], options: LintOptions | None = None) -> tuple[Finding, ...]:
    """Return all findings, by file and line.

    Args:
        modules: everything that is on the controller together: a program with its sub-programs,
            or a whole folder (names must be unique over all).
        options: the controller, and what else is there.
    """
    subject = Subject(modules, options or LintOptions())
    for rule in RULES:
        rule(subject)
    return tuple(sorted((*subject.findings, *subject.left_out()), key=_key))


def _key(finding: Finding) -> tuple[str, int, int, str, str]:
    path, line = (finding.source.path, finding.source.line) if finding.source else ("", 0)
    return path, line, _ORDER[finding.severity], finding.code, finding.message


__all__ = ["RULES", "LintOptions", "lint"]
