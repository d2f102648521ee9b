"""Measurement CSV: every rule of the format, every message with its line."""

import contextlib
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from postproc.errors import DataError, ReadError
from postproc.measurement.columns import JOINTS, POSITION
from postproc.measurement.file import read_measurements

HEAD = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm"
ROW = "10,-60,90,0,45,180,1500.5,-20.25,800"


def read(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "meas.csv"
    path.write_bytes(text.encode(encoding))
    return read_measurements(path)


def refused(tmp_path, text, code, line):
    with pytest.raises(DataError) as caught:
        read(tmp_path, text)
    assert caught.value.code == code
    assert caught.value.source.line == line
    return str(caught.value)


def test_required_columns_in_si(tmp_path):
    data = read(tmp_path, f"{HEAD}\n{ROW}\n")
    np.testing.assert_allclose(data.q[0], np.radians([10, -60, 90, 0, 45, 180]))
    np.testing.assert_allclose(data.position[0], [1.5005, -0.02025, 0.8])
    assert data.ids == ("1",)
    for name in ("group", "abc", "time", "temperature", "direction", "qd", "wrench"):
        assert getattr(data, name) is None
    assert data.extra == {}


def test_columns_in_any_order_with_comments_blank_lines_and_windows_ends(tmp_path):
    head = ["z_mm", "id", *JOINTS[::-1], "y_mm", "x_mm"]
    row = ["800", "a7", *map(str, range(6, 0, -1)), "2", "1"]
    text = f"\ufeff# made by hand\r\n\r\n{','.join(head)}\r\n# a remark\r\n{', '.join(row)}\r\n"
    data = read(tmp_path, text)
    np.testing.assert_allclose(data.q[0], np.radians([1, 2, 3, 4, 5, 6]))
    np.testing.assert_allclose(data.position[0], [0.001, 0.002, 0.8])
    assert data.ids == ("a7",)
    assert data.line.tolist() == [5]


def test_all_known_columns(tmp_path):
    more = (
        "id,group,a_deg,b_deg,c_deg,time_s,temp_C,dir1,dir2,dir3,dir4,dir5,dir6,"
        "qd1_deg_s,qd2_deg_s,qd3_deg_s,qd4_deg_s,qd5_deg_s,qd6_deg_s,"
        "fx_N,fy_N,fz_N,mx_Nm,my_Nm,mz_Nm"
    )
    values = "p1,g,90,0,-90,12.5,21.5,1,-1,0,+1,-1,0,90,0,0,0,0,0,1,2,-490.3,4,5,6"
    data = read(tmp_path, f"{HEAD},{more}\n{ROW},{values}\n")
    assert data.group == ("g",)
    np.testing.assert_allclose(data.abc[0], [math.pi / 2, 0.0, -math.pi / 2])
    assert data.time[0] == 12.5
    assert data.temperature[0] == 21.5
    assert data.direction[0].tolist() == [1, -1, 0, 1, -1, 0]
    assert data.qd[0, 0] == pytest.approx(math.pi / 2)
    np.testing.assert_allclose(data.wrench[0], [1, 2, -490.3, 4, 5, 6])


def test_missing_loads_and_directions_are_none(tmp_path):
    data = read(tmp_path, f"{HEAD},fz_N,dir2,temp_C\n{ROW},,,\n{ROW},-490,1,\n")
    assert data.wrench.tolist() == [[0] * 6, [0, 0, -490, 0, 0, 0]]
    assert data.direction.tolist() == [[0] * 6, [0, 1, 0, 0, 0, 0]]
    assert data.temperature is None


def test_unknown_columns_are_kept_as_numbers_or_labels(tmp_path):
    data = read(tmp_path, f"{HEAD},humidity,shift\n{ROW},55,early\n{ROW},,late\n")
    assert data.extra["humidity"][0] == 55.0
    assert math.isnan(data.extra["humidity"][1])
    assert data.extra["shift"] == ("early", "late")


def test_quoted_names_may_hold_commas(tmp_path):
    data = read(tmp_path, f'{HEAD},id\n{ROW},"hole 7, left"\n')
    assert data.ids == ("hole 7, left",)


@pytest.mark.parametrize("name", [*JOINTS, *POSITION])
def test_each_required_column_is_asked_for_by_name(tmp_path, name):
    kept = [column for column in HEAD.split(",") if column != name]
    text = ",".join(kept) + "\n" + ",".join("1" for _ in kept) + "\n"
    assert repr(name) in refused(tmp_path, f"# x\n{text}", "MEA004", 2)


def test_a_column_of_another_name_is_pointed_out(tmp_path):
    with pytest.raises(DataError) as caught:
        read(tmp_path, f"{HEAD.replace('q2_deg', 'q2_rad')}\n{ROW}\n")
    assert "q2_rad" in caught.value.hint


@pytest.mark.parametrize("mark", [";", "\t"])
@pytest.mark.parametrize("decimal", [",", "."])
def test_spreadsheets_of_other_countries_are_read_alike(tmp_path, mark, decimal):
    head, row = f"{HEAD},id,humidity,shift,fz_N", f"{ROW},p1,40.5,early,"
    expected = read(tmp_path, f"{head}\n{row}\n")
    text = "\r\n".join(t.replace(".", decimal).replace("~", mark) for t in (
        head.replace(",", "~"), row.replace(",", "~"), ""
    ))  # fmt: skip
    data = read(tmp_path, text)
    np.testing.assert_array_equal(data.q, expected.q)
    np.testing.assert_array_equal(data.position, expected.position)
    assert data.ids == ("p1",)
    assert data.extra["humidity"][0] == 40.5
    assert data.extra["shift"] == ("early",)


def test_decimals_of_both_kinds_are_refused(tmp_path):
    head, row = HEAD.replace(",", ";"), ROW.replace(",", ";")
    text = f"{head}\n{row}\n{row.replace('1500.5', '1,500')}\n"
    message = refused(tmp_path, text, "MEA006", 3)
    assert "y_mm is -20.25 and x_mm is 1,500" in message
    refused(tmp_path, f"{head}\n{row.replace('1500.5', '1.500,5')}\n", "MEA006", 2)


@pytest.mark.parametrize(
    ("row", "code"),
    [
        (ROW + ",1", "MEA005"),
        (ROW.rsplit(",", 1)[0], "MEA005"),
        (ROW.replace("90", "ninety"), "MEA006"),
        (ROW.replace("90", ""), "MEA007"),
        (ROW.replace("90", "nan"), "MEA007"),
        (ROW.replace("1500.5", "inf"), "MEA007"),
        (ROW.replace("90", "9000"), "MEA008"),
        (ROW.replace("1500.5", "1.5e12"), "MEA008"),
    ],
)
def test_a_wrong_cell_is_named_with_its_line(tmp_path, row, code):
    refused(tmp_path, f"{HEAD}\n{ROW}\n# remark\n{row}\n{ROW}\n", code, 4)


@pytest.mark.parametrize(
    ("head", "cell", "code"),
    [
        ("dir3", "2", "MEA009"),
        ("fx_N", "much", "MEA006"),
        ("fx_N", "nan", "MEA007"),
        ("time_s", "late", "MEA006"),
        ("a_deg", "5", "MEA010"),
    ],
)
def test_a_wrong_optional_cell_is_named(tmp_path, head, cell, code):
    refused(tmp_path, f"{HEAD},{head}\n{ROW},{cell}\n", code, 1 if code == "MEA010" else 2)


def test_a_column_twice_is_refused(tmp_path):
    refused(tmp_path, f"{HEAD},q1_deg\n{ROW},1\n", "MEA003", 1)


@pytest.mark.parametrize("text", ["", "\n\n", "# only a remark\n", HEAD, HEAD + "\n# none yet\n"])
def test_a_file_without_rows_is_refused(tmp_path, text):
    with pytest.raises(DataError, match="MEA002"):
        read(tmp_path, text)


def test_a_binary_file_is_refused(tmp_path):
    with pytest.raises(DataError, match="MEA001"):
        read(tmp_path, "q1_deg,\xff\xfe", encoding="latin-1")
    refused(tmp_path, f"{HEAD}\n1\0,2\n", "MEA001", 2)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(ReadError, match="IO001"):
        read_measurements(tmp_path / "none.csv")


@settings(deadline=None, max_examples=150)
@given(st.text(alphabet='q123456_degxyzm,.-+ei\n #"0nan;\t', max_size=300))
def test_any_text_is_read_or_refused_in_words(tmp_path_factory, text):
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_text(text, encoding="utf-8")
    with contextlib.suppress(DataError):
        read_measurements(path)


@settings(deadline=None, max_examples=50)
@given(st.data())
def test_a_damaged_file_is_never_read_as_something_else(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "damaged.csv"
    rows = [f"{i},-60,90,0,45,180,1500.5,-20.25,{800 + i}" for i in range(5)]
    whole = f"{HEAD}\n" + "\n".join(rows) + "\n"
    cut = data.draw(st.integers(0, len(whole)))
    path.write_text(whole[:cut], encoding="utf-8")
    try:
        got = read_measurements(path)
    except DataError:
        return
    # whatever was read is a row of the file, the last one possibly with fewer digits
    for i in range(len(got) - 1):
        assert got.q[i, 0] == pytest.approx(math.radians(i))
        assert got.position[i, 2] == pytest.approx((800 + i) / 1000)
