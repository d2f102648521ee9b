"""What a recording may look like, and what stops it with its line."""

import numpy as np
import pytest

from postproc.errors import DataError
from postproc.trace import read_recording
from tests.trace.known import HEAD, command, rows, written

WHOLE = ",".join(HEAD)
LINE = ",".join(["0.5", *["1.0"] * 12])


def text_of(*, head=WHOLE, count=30, change=None):
    lines = [head, *(LINE.replace("0.5", f"{0.004 * k:.3f}", 1) for k in range(count))]
    if change:
        number, line = change
        lines[number - 1] = line
    return "\n".join(lines) + "\n"


WRONG = {
    "another file": ("GOTO/1,2,3\n", "TRC001", 1),
    "no angle": (text_of(head=",".join([*HEAD[:5], "q5_foo", *HEAD[6:]])), "TRC002", 1),
    "a slip": (text_of(head=",".join([*HEAD[:12], "q6_akt_deg"])), "TRC002", 1),
    "half a group": (text_of(head=",".join([*HEAD[:12], "vx"])), "TRC002", 1),
    "twice": (text_of(head=",".join([*HEAD[:12], "time_s"])), "TRC002", 1),
    "a word": (text_of(change=(7, LINE.replace("1.0", "hm", 1))), "TRC003", 7),
    "too short": (text_of(change=(9, "0.1,2,3")), "TRC003", 9),
    "few": (text_of(count=5), "TRC005", 1),
    "milliseconds": (
        text_of().replace("1.0,", "900.0,", 40).replace("0.0", "0.00000"),
        "TRC004",
        1,
    ),
}


@pytest.mark.parametrize("kind", WRONG)
def test_what_is_wrong_is_told_with_its_line(kind, tmp_path):
    text, code, line = WRONG[kind]
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DataError) as caught:
        read_recording(path)
    assert (caught.value.code, caught.value.source.line) == (code, line), caught.value


def test_wraps_pauses_lost_and_repeated_rows(tmp_path):
    table = rows(command)
    table[:, 1:] += 178.0 * (np.arange(12) % 6 == 5)
    table[:, 1:] = (table[:, 1:] + 180.0) % 360.0 - 180.0
    keep = np.ones(len(table), dtype=bool)
    keep[[100, 101, 700]] = False
    keep[1500:1600] = False
    table = np.insert(table[keep], 300, table[keep][300], axis=0)
    found = read_recording(written(tmp_path / "log.csv", table))
    assert len(found.stretches) == 2
    assert len(found) == keep.sum()
    assert np.abs(np.diff(found.command, axis=0)).max() < 0.2
    assert np.abs(found.actual - found.command).max() < 1e-4
    assert any("repeat" in remark for remark in found.remarks)


def test_semicolons_tags_and_broken_beams(tmp_path):
    table = rows(command)[:200]
    lines = [";".join([*HEAD, "x_mm", "y_mm", "z_mm", "tag", "run"])]
    for k, row in enumerate(table):
        point = ["", "", ""] if k % 50 == 7 else ["1000,5", "1", "2"]
        cells = [f"{v:.5f}".replace(".", ",") for v in row]
        lines.append(";".join([*cells, *point, "H7" if k > 100 else "", "1"]))
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    found = read_recording(path)
    assert found.point is not None
    assert np.isnan(found.point[:, 0]).sum() == 4
    assert np.nanmax(found.point[:, 0]) == pytest.approx(1.0005)
    assert found.is_cut is not None
    assert found.is_cut.sum() == 99
