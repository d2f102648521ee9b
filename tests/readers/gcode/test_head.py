"""Rotary heads: words A, B, C to tool axes by closed forms, and never by a guess."""

import numpy as np
import pytest

from postproc.errors import PostprocError
from postproc.readers import ReadOptions, read

HEAD = "%\nG21 G90 G54\nG43.4 H1\nS3000 M3\n"
FORMS = {
    "C+z B+y": lambda a, b, c: (np.cos(c) * np.sin(b), np.sin(c) * np.sin(b), np.cos(b)),
    "C+z A+x": lambda a, b, c: (np.sin(c) * np.sin(a), -np.cos(c) * np.sin(a), np.cos(a)),
    "C-z A-x": lambda a, b, c: (np.sin(c) * np.sin(a), np.cos(c) * np.sin(a), np.cos(a)),
    "B+y A+x": lambda a, b, c: (np.sin(b) * np.cos(a), -np.sin(a), np.cos(b) * np.cos(a)),
    "B-y": lambda a, b, c: (-np.sin(b), 0.0, np.cos(b)),
}
"""Head to the tool axis of its angles [rad], written out by hand."""


def toolpath(tmp_path, text, head=None, name="part.nc"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return read(path, ReadOptions(format="gcode", head=head))


@pytest.mark.parametrize("head", FORMS)
@pytest.mark.parametrize("mode", ["G90", "G91"])
def test_words_of_a_head_are_the_axis_of_the_tool(tmp_path, head, mode):
    rng = np.random.default_rng(7)
    angles = rng.uniform(-80, 80, (20, 3)).round(3)
    lines = ["G0 X0 Y0 Z50 " + " ".join(f"{x}0" for x in "ABC" if x in head)]
    last = np.zeros(3)
    for k, row in enumerate(angles):
        said = row - last if mode == "G91" else row
        words = [f"{x}{said['ABC'.index(x)]:.3f}" for x in "ABC" if x in head]
        lines.append(f"{mode} G1 X{1 if mode == 'G91' else k + 1} {' '.join(words)} F500")
        last = row
    found = toolpath(tmp_path, HEAD + "\n".join(lines) + "\nM30\n", head)
    expected = [FORMS[head](*np.deg2rad(row)) for row in angles]
    np.testing.assert_allclose(found.axes[1:], expected, atol=1e-6)
    np.testing.assert_allclose(found.points[1:, 0], np.arange(1, 21) * 1e-3, atol=1e-12)
    assert not [use for use in found.word_uses if use.refused]


def test_a_head_turns_where_the_tool_stands_and_rises_as_it_stood(tmp_path):
    text = HEAD + "G0 X0 Y0 Z10 B0\nG1 Z0 F100\nB30\nG91 G28 Z0\nG90\nG0 B0 Z50\nX9\nM30\n"
    found = toolpath(tmp_path, text, "B+y")
    leaning = [np.sin(np.pi / 6), 0, np.cos(np.pi / 6)]
    np.testing.assert_allclose(found.points[:, 2], [0.01, 0, 0, 0.05, 0.05, 0.05], atol=1e-12)
    up = [0, 0, 1]
    np.testing.assert_allclose(found.axes, [up, up, leaning, leaning, up, up], atol=1e-9)


REFUSED = {
    "no head named": ("G0 X0 Y0 Z9 B0\nG1 X1 B5 F9\n", None),
    "not the letter of the head": ("G0 X0 Y0 Z9 B0\nG1 X1 A5 F9\n", "B+y"),
    "tip not said": ("G43 H1\nG0 X0 Y0 Z9 B0\nG1 X1 B5 F9\n", "B+y"),
}
STOPPED = {
    "never said": ("G0 X0 Y0 Z9 B0\n", "C+z B+y", "GCD019"),
    "behind a reference move": ("G0 X0 Y0 Z9 B0\nG28 B0\nG1 X1 F9\n", "B+y", "GCD019"),
    "a hole while it leans": ("G0 X0 Y0 Z9 B5\nG81 X1 Z-1 R1 F9\n", "B+y", "GCD012"),
    "an arc that turns it": ("G0 X0 Y0 Z9 B0\nG2 X2 Y0 I1 J0 B5 F9\n", "B+y", "GCD011"),
    "no head": ("G0 X0 Y0 Z9\n", "B", "GCD018"),
    "twice": ("G0 X0 Y0 Z9\n", "B+y B+z", "GCD018"),
    "empty": ("G0 X0 Y0 Z9\n", "", "GCD018"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_words_that_nothing_explains_stop_the_job(tmp_path, case):
    text, head = REFUSED[case]
    assert [use for use in toolpath(tmp_path, HEAD + text + "M30\n", head).word_uses if use.refused]


@pytest.mark.parametrize("case", STOPPED)
def test_what_no_head_can_mean_is_an_error(tmp_path, case):
    text, head, code = STOPPED[case]
    with pytest.raises(PostprocError) as caught:
        toolpath(tmp_path, HEAD + text + "M30\n", head)
    assert caught.value.code == code


def test_tip_behind_the_axes_says_what_g43_does_not(tmp_path):
    text = "%\nG21 G90 G54\nS3000 M3\nG0 X0 Y0 Z9 B0\nG1 X1 B5 F9\nM30\n"
    assert [use.word for use in toolpath(tmp_path, text, "B+y").word_uses if use.refused] == ["ABC"]
    assert not [use for use in toolpath(tmp_path, text, "B+y tip").word_uses if use.refused]
