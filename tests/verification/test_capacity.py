"""What the controller can take: rate of points, look-ahead, memory; by hand-made programs."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.krl import parse_files
from postproc.verification import verify
from tests.samples import AT_PART, HEAD, START, at, cell_in, modules


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    return cell_in(tmp_path_factory.mktemp("cell"), **AT_PART)


def warned(cell, *lines, source=modules):
    report = verify(source(*HEAD, *lines), "T", cell, collisions=False)
    assert not report.violations
    return {item.code: item.message for item in report.warnings if not item.headline}


def line(count, step, speed, blend="C_DIS", push=2.3):
    """A straight cut of points so far apart [mm], at a speed [m/s]."""
    points = [at(step * i, 0, 0, blend if i < count - 1 else "") for i in range(count)]
    return [START, f"$ACC.CP={push}", f"$VEL.CP={speed}", "$APO.CDIS=0.01", *points]


def test_points_that_follow_faster_than_the_controller_plans(cell):
    """1 mm at 0.08 m/s is 12.5 ms, at 0.1 m/s 10 ms: 12 ms are assumed for each."""
    cell = replace(cell, accept=("$ACC.CP",))
    assert "block_rate" not in warned(cell, *line(60, 1.0, 0.08, push=20.0))
    message = warned(cell, *line(60, 1.0, 0.1, push=20.0))["block_rate"]
    assert "100 points per second" in message
    assert "about 83 (12 ms each)" in message
    quick = replace(cell, krl=replace(cell.krl, block=0.009))
    assert "block_rate" not in warned(quick, *line(60, 1.0, 0.1, push=20.0))
    assert "block_rate" not in warned(cell, *line(60, 1.0, 0.1, blend="", push=20.0))


def test_a_speed_from_which_the_robot_does_not_stop_within_what_is_planned(cell):
    """v^2 = 2 a s: from 0.3 m/s with 2.3 m/s^2 it takes 19.6 mm, three motions of 6.5 mm."""
    assert "look_ahead" not in warned(cell, *line(12, 6.6, 0.3))
    message = warned(cell, *line(12, 6.0, 0.3))["look_ahead"]
    assert f"{np.sqrt(2 * 2.3 * 0.018):.3f} m/s" in message
    assert "18.00 mm" in message
    five = [*line(12, 6.0, 0.3)]
    five.insert(1, "$ADVANCE=5")
    assert "look_ahead" not in warned(cell, *five)
    assert "look_ahead" not in warned(cell, *line(4, 6.0, 0.3))  # it stops anyway


def test_files_larger_than_the_memory(cell):
    def read(*lines):
        text = "\r\n".join(["DEF T( )", *lines, "END", ""])
        return parse_files({"T.src": text.encode(), "T.dat": b"DEFDAT T\r\nENDDAT\r\n"})

    lines = line(200, 1.0, 0.01)
    size = sum(len(text) + 2 for text in ("DEF T( )", *HEAD, *lines, "END")) + 18
    for memory, is_warned in ((size, False), (size - 1, True)):
        small = replace(cell, krl=replace(cell.krl, memory=float(memory)))
        assert ("memory" in warned(small, *lines, source=read)) is is_warned
