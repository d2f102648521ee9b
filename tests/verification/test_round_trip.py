"""Reading what we print and printing what we read: the same bytes, the same program."""

import numpy as np
import pytest

from postproc.comparison.diff import diff_files
from postproc.errors import PostprocError
from postproc.krl.lint import lint
from postproc.krl.text.parse import parse_files
from postproc.krl.text.render import render
from postproc.verification.verify import verify

STYLES = [
    ("dense", "inline", "8.6", 15),
    ("dense", "dat", "8.6", 1000),
    ("spline", "inline", "8.6", 1000),
    ("spline_block", "dat", "8.6", 15),
    ("forms", "inline", "8.5", 1000),
    ("forms", "dat", "8.6", 15),
]


@pytest.mark.parametrize("style", STYLES, ids=lambda style: "-".join(map(str, style)))
def test_printing_what_was_read_gives_the_same_bytes(emitted, style):
    _, _, files = emitted(*style)
    for module in parse_files(files):
        src, dat = render(module)
        assert src == files[f"{module.name}.src"]
        assert dat == files.get(f"{module.name}.dat", b"")


FRAGMENTS = [
    "{",
    "}",
    "(",
    ",",
    "nan",
    "1e308",
    "-0.0",
    "C_DIS",
    "LIN",
    "XP1",
    "ENDIF",
    "LOOP",
    '"',
]
FRAGMENTS += ["'B1'", "SPLINE", "END", "DEF X( )", "CA 90", "BAS(#TOOL,", "$VEL.CP="]


@pytest.mark.parametrize("style", STYLES[::2], ids=lambda style: "-".join(map(str, style)))
def test_broken_text_is_judged_or_refused_but_never_breaks_the_reader(emitted, style):
    cell, toolpath, files = emitted(*style)
    name = next(iter(files))
    lines = files[name].decode().split("\r\n")
    rng = np.random.default_rng(11)
    for _ in range(60):
        broken = list(lines)
        for _ in range(int(rng.integers(1, 4))):
            at = int(rng.integers(len(broken)))
            word = FRAGMENTS[int(rng.integers(len(FRAGMENTS)))]
            place = int(rng.integers(len(broken[at]) + 1))
            broken[at] = broken[at][:place] + word + broken[at][place:]
        text = "\r\n".join(broken).encode()
        try:
            modules = parse_files({**files, name: text})
            lint(modules)
            verify(modules, modules[0].name, cell, toolpath, collisions=False)
            diff_files({name: files[name]}, {name: text}, name)
        except PostprocError as error:
            assert error.source is not None  # noqa: PT017 - most of them are refused
