"""An emitter: one motion a line, by joint angles, for a player that knows nothing else.

    PTP 0.00000 -90.00000 90.00000 0.00000 45.00000 0.00000
    LIN 1.50000 -88.20000 91.30000 0.00000 44.10000 0.00000 10.000
    WAIT 0.500

Angles A1..A6 in degrees, behind LIN the speed in mm/s, behind WAIT seconds; # begins a comment.

What an emitter owes: the same plan gives the same bytes, nothing is written to disk, what the
target cannot do is refused by name and never left out, and it reads its own text back, so that the
text can be compared with the plan before it lands. ``postproc.testing.check_emitter`` holds it to
that.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from postproc.cell import Cell
from postproc.emitters import Against, Emitter, Program, ReadBack
from postproc.errors import EmitError, SourceRef
from postproc.model import Event, EventKind, MoveKind, Plan
from postproc.units import DEG, MM

KINDS = {"PTP": MoveKind.PTP, "LIN": MoveKind.LIN}


class JointList(Emitter):
    """Lists of joint angles, ``NAME.txt``."""

    def emit(self, plan: Plan, cell: Cell) -> Program:
        """Return the list of a plan.

        Raises:
            EmitError: EXM001 if the plan has external axes, EXM002 for an arc, EXM003 for an event.
        """
        del cell
        source = SourceRef(plan.toolpath.path)
        if plan.external.shape[1]:
            raise EmitError("EXM001", "no external axes in a joint list", source)
        if (plan.kind == MoveKind.CIRC).any():
            hint = 'set [motion] arcs = "lin" in the cell'
            raise EmitError("EXM002", "no arcs in a joint list", source, hint)
        name = re.sub(r"[^A-Za-z0-9_]+", "_", plan.name)[:40]
        text = "".join(f"{line}\n" for line in _lines(plan))
        renamed = ((plan.name, name),) if name != plan.name else ()
        return Program(name, {f"{name}.txt": text.encode("ascii")}, renamed)

    def read_back(self, program: Program, cell: Cell, against: Against) -> ReadBack:
        """Return the motions of a list.

        Raises:
            EmitError: EXM004 for a line that is none of a joint list.
        """
        del cell, against
        (file, content), *_ = program.files.items()
        kind, q, speed, at = [], [], [], []
        for number, line in enumerate(content.decode("ascii").splitlines(), 1):
            word, *numbers = line.split()
            if word in ("#", "WAIT"):
                continue
            if word not in KINDS or len(numbers) != (7 if word == "LIN" else 6):
                raise EmitError(
                    "EXM004", f"not a line of a joint list: {line}", SourceRef(file, number)
                )
            kind.append(KINDS[word])
            q.append([float(text) * DEG for text in numbers[:6]])
            speed.append(float(numbers[6]) * MM if word == "LIN" else np.nan)
            at.append(number)
        n = len(kind)
        return ReadBack(
            kind=np.array(kind, dtype=np.int32),
            q=np.array(q).reshape(n, 6),
            speed=np.array(speed),
            file=np.zeros(n, dtype=np.int32),
            line=np.array(at, dtype=np.int32),
            files=(file,),
        )


def _lines(plan: Plan) -> Iterator[str]:
    for move in range(len(plan)):
        yield from (_event(event, plan) for index, event in plan.events if index == move)
        word = MoveKind(int(plan.kind[move])).name
        angles = " ".join(f"{angle / DEG:z.5f}" for angle in plan.q[move])
        yield f"{word} {angles}" + ("" if word == "PTP" else f" {plan.speed[move] / MM:.3f}")
        if plan.dwell[move] > 0.0:
            yield f"WAIT {plan.dwell[move]:.3f}"
    yield from (_event(event, plan) for index, event in plan.events if index >= len(plan))


def _event(event: Event, plan: Plan) -> str:
    """Return a remark; whatever makes the machine do something is refused."""
    if event.kind is EventKind.DWELL:
        return f"WAIT {event.value:.3f}"
    if event.kind not in (EventKind.MESSAGE, EventKind.UNKNOWN):
        source = SourceRef(plan.toolpath.path, event.line)
        raise EmitError("EXM003", f"no {event.kind} in a joint list", source)
    return f"# {event.text.encode('ascii', errors='replace').decode()}"


JOINT_LIST = JointList()
