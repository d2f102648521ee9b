"""Every emitter of the registry keeps the contract, and the contract refuses broken ones.

The broken ones are the example's list of joint angles with one thing done wrong.
"""

import hashlib
import importlib.util
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.emitters import EMITTERS, Emitter, Program, ReadBack
from postproc.errors import PluginError
from postproc.model import EventKind
from postproc.testing import check_emitter, made_cell, made_plan
from postproc.testing.emitter import CHECKS, Case

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "docs" / "examples" / "plugin" / "postproc_example" / "emitter.py"
SPEC = importlib.util.spec_from_file_location("joint_list_example", EXAMPLE)
example = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(example)
JointList = example.JointList


@pytest.mark.parametrize("name", [name for name, _ in EMITTERS])
@pytest.mark.parametrize("check", CHECKS, ids=lambda c: c.__name__)
def test_contract(check, name):
    check(EMITTERS.get(name), Case(made_plan(), made_cell()))


def test_all_parts_of_the_registry_load():
    assert not [info for info in EMITTERS.infos() if info.problem]


def test_the_default_of_a_cell_is_built_in():
    assert made_cell().krl.emitter in EMITTERS


SCRIPT = """
import hashlib
from postproc.emitters import EMITTERS
from postproc.testing import made_cell, made_plan
for name, emitter in EMITTERS:
    program = emitter.emit(made_plan(), made_cell())
    print(name, [(file, hashlib.sha256(text).hexdigest()) for file, text in program.files.items()])
"""


@pytest.mark.parametrize("seed", ["1", "77"])
def test_another_process_writes_the_same(seed):
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        env={**os.environ, "PYTHONHASHSEED": seed},
        capture_output=True,
        text=True,
        check=True,
    )
    for name, emitter in EMITTERS:
        program = emitter.emit(made_plan(), made_cell())
        files = [(f, hashlib.sha256(text).hexdigest()) for f, text in program.files.items()]
        assert f"{name} {files}" in done.stdout.splitlines()


class Bare(Emitter):
    def emit(self, plan, cell):
        return JointList().emit(plan, cell)


class Nothing(JointList):
    def emit(self, plan, cell):
        return Program(plan.name, {})


class Folders(JointList):
    def emit(self, plan, cell):
        program = super().emit(plan, cell)
        return replace(program, files={f"out/{k}": v for k, v in program.files.items()})


class Text(JointList):
    def emit(self, plan, cell):
        program = super().emit(plan, cell)
        return replace(program, files={k: v.decode() for k, v in program.files.items()})


def remark(program, text):
    """Return a program with a line of the target's comments in front."""
    files = {k: b"# " + str(text).encode() + b"\n" + v for k, v in program.files.items()}
    return replace(program, files=files)


class Placed(JointList):
    def emit(self, plan, cell):
        return remark(super().emit(plan, cell), cell.path)


class Counting(JointList):
    calls = 0

    def emit(self, plan, cell):
        Counting.calls += 1
        return remark(super().emit(plan, cell), self.calls)


class Touching(JointList):
    def emit(self, plan, cell):
        program = super().emit(plan, cell)
        plan.T_base_tcp.flags.writeable = True
        plan.T_base_tcp[0, 0, 3] += 1e-3
        return program


class Renaming(JointList):
    def emit(self, plan, cell):
        return replace(super().emit(plan, cell), renamed=())


class Deaf(JointList):
    def emit(self, plan, cell):
        kept = [(i, e) for i, e in plan.events if e.kind is not EventKind.SPINDLE_ON]
        return super().emit(replace(plan, events=tuple(kept)), cell)


class Hasty(JointList):
    def emit(self, plan, cell):
        return super().emit(replace(plan, dwell=np.zeros(len(plan))), cell)


class Slow(JointList):
    def emit(self, plan, cell):
        steady = np.where(np.isfinite(plan.speed), 0.01, np.nan)
        return super().emit(replace(plan, speed=steady), cell)


class Rough(JointList):
    """One digit behind the point: up to 0.05 deg off."""

    def emit(self, plan, cell):
        return super().emit(replace(plan, q=np.radians(np.round(np.degrees(plan.q), 1))), cell)


class Short(JointList):
    def read_back(self, program, cell, against):
        read = super().read_back(program, cell, against)
        return ReadBack(read.kind[:-1], read.q[:-1])


class Remembering(JointList):
    """Answers with the last plan that it wrote, whatever the text says."""

    def emit(self, plan, cell):
        self.plan = plan
        return super().emit(plan, cell)

    def read_back(self, program, cell, against):
        return ReadBack(self.plan.kind, self.plan.q, aux=self.plan.aux)


class Trusting(JointList):
    """Reads the first half and takes the rest from elsewhere."""

    def emit(self, plan, cell):
        program = super().emit(plan, cell)
        self.whole = self.__dict__.setdefault("whole", super().read_back(program, cell, None))
        return program

    def read_back(self, program, cell, against):
        read = super().read_back(program, cell, against)
        q = np.array(self.whole.q)
        half = len(q) // 2 - 1
        q[:half] = read.q[:half]
        return ReadBack(read.kind, q)


class Patient(JointList):
    """Counts on there being all that it wrote."""

    def read_back(self, program, cell, against):
        (content,) = program.files.values()
        return super().read_back(program, cell, against) if content.endswith(b"\n") else {}["end"]


BROKEN = [
    ("offers no read-back", Bare),
    ("without name or files", Nothing),
    ("has a folder in it", Folders),
    ("is no bytes", Text),
    ("a path of this machine", Placed),
    ("the second program of a plan is another one", Counting),
    ("changes the plan", Touching),
    ("renames the program without telling", Renaming),
    ("the event spindle_on is left out", Deaf),
    ("a wait is left out", Hasty),
    ("a path speed is left out", Slow),
    ("the tool is not where the plan has it", Rough),
    ("its own program fails: .* all 72 moves", Short),
    ("does not see a move that goes elsewhere", Remembering),
    ("does not see a move that goes elsewhere", Trusting),
    ("fails with KeyError", Patient),
]


@pytest.mark.parametrize(("words", "kind"), BROKEN, ids=[kind.__name__ for _, kind in BROKEN])
def test_a_broken_emitter_is_refused(words, kind):
    plan = made_plan(arcs=False)
    plan = replace(plan, T_base_tcp=np.array(plan.T_base_tcp))
    with pytest.raises(PluginError, match=f"PLG004: .*{words}"):
        check_emitter(kind(), plan, made_cell())


def test_the_example_keeps_it():
    check_emitter(JointList())
