"""Several measurement files as one campaign."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.errors import DataError
from postproc.measurement.campaign import read_campaign

HEAD = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm"


@pytest.fixture
def files(tmp_path):
    def write(*texts):
        paths = [tmp_path / f"part{k}.csv" for k in range(len(texts))]
        for path, text in zip(paths, texts, strict=True):
            path.write_text(text)
        return paths

    return write


def test_rows_follow_each_other_and_absent_loads_are_none(files):
    found = read_campaign(
        files(
            f"id,group,{HEAD},fz_N,hall\na,g,1,2,3,4,5,6,10,20,30,-500,3\nb,h,0,0,0,0,0,0,1,2,3,0,4\n",
            f"id,{HEAD},dir2,hall,why\na,6,5,4,3,2,1,40,50,60,-1,5,tells one from two\n",
        )
    )
    np.testing.assert_allclose(np.degrees(found.q[:, 0]), [1, 0, 6])
    np.testing.assert_allclose(found.position[:, 2] * 1e3, [30, 3, 60])
    np.testing.assert_allclose(found.wrench[:, 2], [-500, 0, 0])
    np.testing.assert_allclose(found.direction[:, 1], [0, 0, -1])
    assert found.ids == ("a", "b", "part1:a")
    assert found.group == ("g", "h", "")
    assert found.line.tolist() == [2, 3, 2]
    np.testing.assert_allclose(found.extra["hall"], [3, 4, 5])
    assert "why" not in found.extra


def test_one_file_is_what_it_is(files):
    path = files(f"id,{HEAD}\na,1,2,3,4,5,6,10,20,30\n")
    assert read_campaign(path).ids == ("a",)


def test_a_clock_in_one_file_only_is_an_error(files):
    one = f"{HEAD},time_s\n1,2,3,4,5,6,10,20,30,0\n"
    paths = files(one, f"{HEAD},time_s\n1,2,3,4,5,6,10,20,30,\n")
    with pytest.raises(DataError, match=r"part1\.csv:1: error MEA011: time_s .* not in .*part1"):
        read_campaign(paths)
