"""Writing the same file differently never changes its meaning; cutting it off never goes unseen."""

import contextlib
import random
import re

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from postproc.errors import PostprocError
from postproc.readers import ReadOptions, read

PARTS = ("part.cls", "part.apt", "part.ncl.3", "part.aptsource", "part.clt", "part_plain.apt")
TRAPS = ("nx_modes.cls", "nx_nurbs.clsf", "nx_cycles.clsf", "solidworks_setups.apt",
         "catia_frames.aptsource", "camworks_tilt.clt", "plain_inch.apt")  # fmt: skip
OPTIONS = {"cycle_words": "depth clearance retract peck dwell feed"}
FREE_TEXT = re.compile(r"\s*(PARTNO|PPRINT|TPRINT|INSERT|TOOL PATH|OPFEAT|\$\$)", re.IGNORECASE)
NUMBER = re.compile(r"(?<![\w.])[+-]?(\d+\.?\d*|\.\d+)(?![\w.])")


def assert_same_path(a, b, tolerance=0.0):
    assert len(a) == len(b)
    for name in ("points", "axes", "feed"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), atol=tolerance, err_msg=name)
    for name in ("kind", "arc", "cycle", "operation", "tool"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    for name in ("centre", "normal", "radius", "sweep"):
        np.testing.assert_allclose(
            getattr(a.arcs, name), getattr(b.arcs, name), atol=tolerance * 10
        )
    assert tolerance or repr(a.cycles) == repr(b.cycles)
    assert [(e.index, e.kind) for e in a.events] == [(e.index, e.kind) for e in b.events]
    assert a.unknown_words == b.unknown_words


def respelled(line: str, rng: random.Random) -> str:
    """Return one statement with other blanks, case, digits, comments, continuations."""
    if FREE_TEXT.match(line) or "$" in line or not line.strip():
        return line
    word, slash, rest = line.partition("/")
    if rng.random() < 0.3:
        word, rest = word.lower(), rest.lower()
    if rng.random() < 0.3:
        rest = rest.replace(",", rng.choice((" ,", ", ", "\t,  ")))
    if rng.random() < 0.3:
        rest = NUMBER.sub(lambda m: m.group() + ("0" if "." in m.group() else ".00"), rest)
    if rng.random() < 0.2 and "," in rest:
        first, _, last = rest.partition(",")
        rest = f"{first},$\n {last}"
    elif rng.random() < 0.1:
        rest += "  $$ a remark, with 1,2,3"
    return (
        rng.choice(("", " ", "\t"))
        + word
        + (rng.choice(("", " ", "   ")) + slash) * bool(slash)
        + rest
    )


@pytest.mark.parametrize("name", [*PARTS, *TRAPS])
@given(seed=st.integers(0, 2**32))
@settings(
    max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_another_spelling_is_the_same_path(name, seed, fixtures, read_text):
    rng = random.Random(seed)
    text = (fixtures / name).read_text(encoding="latin-1")
    original = read(fixtures / name, options=ReadOptions(**OPTIONS))
    joined = re.sub(r"\$ *(CIR +\d)?\n", "$\n", text)
    lines = []
    keep = False
    for line in joined.splitlines():
        lines.append(line if keep or line.endswith("$") else respelled(line, rng))
        keep = line.endswith("$")
        if rng.random() < 0.1 and not keep:
            lines.append(rng.choice(("", "$$ a remark", "PAINT/COLOR,31")))
    ending = rng.choice(("\n", "\r\n"))
    rewritten = ending.join(lines).replace("\n", ending if ending == "\n" else "\n")
    changed = read_text(rewritten + ending, name, dialect=original.dialect, **OPTIONS)
    assert_same_path(original, changed)


@pytest.mark.parametrize("name", [*PARTS, *TRAPS])
def test_blocks_of_any_size_give_the_same_path(name, fixtures, monkeypatch):
    original = read(fixtures / name, options=ReadOptions(**OPTIONS))
    for size in (37, 200, 1000):
        monkeypatch.setattr("postproc.readers.text.blocks.BLOCK_BYTES", size)
        options = ReadOptions(**OPTIONS, dialect=original.dialect, units=original.units)
        assert_same_path(original, read(fixtures / name, options=options))


def test_inches_are_the_same_path_as_millimetres(fixtures, read_text):
    text = (fixtures / "part_plain.apt").read_text()
    original = read(fixtures / "part_plain.apt")
    lines = []
    for line in text.splitlines():
        word = line.partition("/")[0].strip()
        if word in ("GOTO", "GODLTA", "CUTTER", "FEDRAT"):
            line = NUMBER.sub(lambda m: f"{float(m.group()) / 25.4:.12f}", line)
        elif word in ("CIRCLE", "CYCLE83"):
            numbers = line.partition("/")[2].split(",")
            lengths = (0, 1, 2, 6) if word == "CIRCLE" else range(len(numbers) - 1)
            for i in lengths:
                numbers[i] = f"{float(numbers[i]) / 25.4:.12f}"
            line = f"{word}/{','.join(numbers)}"
        lines.append(line.replace("UNITS/MM", "UNITS/INCH"))
    changed = read_text("\n".join(lines) + "\n")
    assert changed.units == "inch"
    assert_same_path(original, changed, tolerance=1e-9)
    for a, b in zip(original.cycles, changed.cycles, strict=True):
        assert b.depth == pytest.approx(a.depth)
        assert b.peck == pytest.approx(a.peck)


@pytest.mark.parametrize("name", [*PARTS, *TRAPS])
def test_a_file_that_is_cut_off_is_never_another_path(name, fixtures, read_text):
    data = (fixtures / name).read_bytes()
    original = read(fixtures / name, options=ReadOptions(**OPTIONS))
    ends = {i + 1 for i, byte in enumerate(data) if byte == ord("\n")}
    cuts = sorted(ends | set(range(1, len(data), 31)))
    unseen = 0
    for cut in cuts:
        try:
            shorter = read_text(data[:cut], name, dialect=original.dialect, **OPTIONS)
        except PostprocError:
            continue
        unseen += 1
        assert_same_path(original, shorter) if original.dialect != "nx" else _whole_paths(
            original, shorter
        )
    assert unseen < 0.05 * len(cuts)


def _whole_paths(original, shorter):
    """An NX file is a row of whole paths: without the last ones it is still a file."""
    n = len(shorter)
    np.testing.assert_array_equal(original.points[:n], shorter.points)
    assert n == len(original) or original.operation[n] > original.operation[n - 1]


@pytest.mark.parametrize("word", ["GOTO", "CIRCLE", "RAPID", "FEDRAT", "CYCLE", "UNITS", "FINI"])
def test_one_wrong_letter_in_a_moving_word_allows_no_program(word, fixtures, read_text):
    text = (fixtures / "part_plain.apt").read_text()
    at = text.index(f"\n{word}") + 1
    for i in range(len(word)):
        for letter in "AXZ0_":
            if letter == word[i]:
                continue
            wrong = text[: at + i] + letter + text[at + i + 1 :]
            try:
                toolpath = read_text(wrong, units=None if word != "UNITS" else "mm")
            except PostprocError:
                continue
            (use,) = (use for use in toolpath.word_uses if use.refused)
            assert use.word.startswith(word[:i] + letter + word[i + 1 :])


def test_points_are_the_same_from_a_list_and_from_apt(fixtures, read_text):
    milled = read(fixtures / "part.cls")
    rows = [f"{x},{y},{z},0,0,1\n" for x, y, z in (milled.points * 1e3).tolist()]
    listed = read_text("x,y,z,i,j,k\n" + "".join(rows), "a.csv")
    np.testing.assert_allclose(listed.points, milled.points, atol=1e-15)
    np.testing.assert_array_equal(listed.axes, milled.axes)


CELLS = st.floats(-2000, 2000).map(lambda v: round(v, 4))


@given(
    rows=st.lists(st.tuples(CELLS, CELLS, CELLS), min_size=1, max_size=12),
    separator=st.sampled_from([",", ";", "\t", " "]),
    comma=st.booleans(),
    header=st.booleans(),
    named=st.booleans(),
    ending=st.sampled_from(["\n", "\r\n"]),
)
@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_any_way_of_writing_a_list_is_the_same_list(
    rows, separator, comma, header, named, ending, read_text
):
    assume(not 0.0 < np.ptp(rows, axis=0).max() < 1.0)  # closer together the unit is asked back
    decimal = "," if comma and separator != "," else "."
    lines = [["id"] * named + ["x", "y", "z", "i", "j", "k"]] if header else []
    for i, row in enumerate(rows):
        numbers = [f"{value:.4f}".replace(".", decimal) for value in row]
        axis = [f"{value:.1f}".replace(".", decimal) for value in (0.6, 0.0, 0.8)]
        lines.append([f"P{i}"] * named + numbers + axis)
    text = ending.join(separator.join(line) for line in lines) + ending
    toolpath = read_text(text, "list.csv")
    np.testing.assert_allclose(toolpath.points, np.array(rows) * 1e-3, atol=1e-12)
    np.testing.assert_allclose(toolpath.axes, [(0.6, 0, 0.8)] * len(rows))
    assert toolpath.names == (tuple(f"P{i}" for i in range(len(rows))) if named else None)


@given(data=st.binary(max_size=400), suffix=st.sampled_from([".apt", ".csv", ".xml"]))
@settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_any_bytes_are_read_or_refused_in_words(data, suffix, read_text):
    form = suffix[1:].replace("xml", "delmia")
    with contextlib.suppress(PostprocError):
        read_text(data, f"any{suffix}", format=form)
