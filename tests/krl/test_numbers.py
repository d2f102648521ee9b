"""Number text: fixed point, enough digits, never -0, nan or an exponent."""

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from postproc.errors import KrlError
from postproc.krl.text import numbers

FIXED = re.compile(r"-?\d+\.\d+\Z")
finite = st.floats(-1e9, 1e9)


@given(finite, st.integers(0, 9))
def test_real_is_fixed_point_and_nearest(value, digits):
    text = numbers.real(value, digits)
    whole, _, decimals = text.removeprefix("-").partition(".")
    assert whole.isdigit()
    assert len(decimals) == digits
    assert abs(float(text) - value) <= 0.5 * 10.0**-digits + 1e-15 * abs(value)
    assert not (text.startswith("-") and float(text) == 0.0)


@given(finite, st.sampled_from([4, 5, 6]))
def test_real_of_its_own_text_is_that_text(value, digits):
    text = numbers.real(value, digits)
    assert numbers.real(float(text), digits) == text


@given(st.floats(1e-6, 10.0))
def test_speed_keeps_six_digits_and_never_vanishes(value):
    text = numbers.speed(value)
    assert FIXED.match(text)
    assert len(text.split(".")[1]) >= 6
    assert math.isclose(float(text), value, rel_tol=5.1e-6)
    assert numbers.speed(float(text)) == text


@pytest.mark.parametrize(
    ("feed_mm_min", "text"),
    [(100, "0.00166667"), (600, "0.010000"), (1, "0.0000166667"), (60000, "1.000000")],
)
def test_speed_of_feeds(feed_mm_min, text):
    assert numbers.speed(feed_mm_min / 60000.0) == text


def test_carry_into_the_next_decade_is_idempotent():
    assert numbers.speed(0.09999999999) == "0.100000"
    assert numbers.speed(0.0999999) == "0.0999999"


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 2e9, -1e300])
def test_what_is_no_number_is_refused(value):
    for write in (numbers.real, numbers.significant):
        with pytest.raises(KrlError) as caught:
            write(value)
        assert caught.value.code == "KRL901"


@pytest.mark.parametrize("value", [0.0, -0.1, math.nan, math.inf])
def test_speed_must_be_above_zero(value):
    with pytest.raises(KrlError) as caught:
        numbers.speed(value)
    assert caught.value.code == "KRL903"


@pytest.mark.parametrize("value", [1e-13, 4e-320, -1e-14])
def test_a_value_that_would_print_as_zero_is_refused(value):
    with pytest.raises(KrlError) as caught:
        numbers.significant(value)
    assert caught.value.code == "KRL902"


def test_nonzero():
    assert numbers.nonzero(0.0, 4, "dwell") == "0.0000"
    assert numbers.nonzero(0.0001, 4, "dwell") == "0.0001"
    with pytest.raises(KrlError, match=r"dwell 4e-05 would be written as 0\.0000"):
        numbers.nonzero(0.00004, 4, "dwell")


@given(st.floats(0.001, 100.0))
def test_percent(value):
    text = numbers.percent(value)
    assert abs(float(text) - value) <= 0.0005 + 1e-12
    assert numbers.percent(float(text)) == text


def test_whole_percent_has_no_decimals():
    assert numbers.percent(50.0) == "50"
    assert numbers.percent(33.3333333) == "33.333"


@pytest.mark.parametrize("value", [0.0, 0.0004, 100.001, -1.0, math.nan, math.inf])
def test_percent_out_of_range(value):
    with pytest.raises(KrlError) as caught:
        numbers.percent(value)
    assert caught.value.code == "KRL904"


def test_status_and_turn():
    assert numbers.status(6) == "6"
    assert numbers.turn(0b101010) == "42"
    for write, wrong in ((numbers.status, 32), (numbers.turn, 4096), (numbers.turn, -1)):
        with pytest.raises(KrlError) as caught:
            write(wrong)
        assert caught.value.code == "KRL905"
