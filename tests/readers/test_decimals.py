"""Bulk numbers against ``float``, the outside truth."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from postproc.readers.text.decimals import parse_number, parse_tokens


def parse(texts: list[str]) -> tuple[np.ndarray, np.ndarray]:
    data = ",".join(texts).encode("latin-1")
    buffer = np.frombuffer(data, dtype=np.uint8)
    ends = np.append(np.flatnonzero(buffer == ord(",")), len(buffer))
    starts = np.concatenate([[0], ends[:-1] + 1])
    return parse_tokens(buffer, starts, ends)


PLAIN = st.from_regex(r"\A[+-]?([0-9]{1,17}\.?[0-9]{0,17}|\.[0-9]{1,17})\Z")
EXPONENT = st.from_regex(r"\A[+-]?[0-9]{1,18}(\.[0-9]{0,18})?[eE][+-]?[0-9]{1,2}\Z")


@given(st.lists(PLAIN | EXPONENT, min_size=1, max_size=40))
def test_every_number_is_the_nearest_float(texts):
    values, valid = parse(texts)
    assert valid.all()
    assert values.tolist() == [float(text) for text in texts]


@given(st.lists(st.text(alphabet="0123456789+-. eExanif_", max_size=12), min_size=1, max_size=30))
def test_bulk_and_single_parser_agree_on_any_text(texts):
    values, valid = parse(texts)
    for value, is_valid, text in zip(values, valid, texts, strict=True):
        single = parse_number(text)
        assert is_valid == (single is not None)
        assert not is_valid or value == single


@pytest.mark.parametrize(
    "text",
    ["", ".", "-", "+.", "1..2", "1.2.3", "--1", "1-", "1 2", "nan", "inf", "-inf", "0x10", "1_0",
     "1e400", "infinity", "1e", "e5", "1,5", "\N{FULLWIDTH DIGIT ONE}"],
)  # fmt: skip
def test_what_is_no_number(text):
    assert parse_number(text) is None


def test_blanks_signs_and_missing_digits():
    values, valid = parse([" 1.5 ", "\t-.25", "+7.", "-0", "12345678901234567890", "1d2"])
    assert valid.all()
    assert values.tolist() == [1.5, -0.25, 7.0, -0.0, 12345678901234567890.0, 100.0]
    assert math.copysign(1.0, values[3]) == -1.0


def test_nothing_to_parse():
    values, valid = parse_tokens(
        np.zeros(0, dtype=np.uint8), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    )
    assert len(values) == len(valid) == 0
