"""Outside text in comments: one line of ASCII that means nothing to a controller or pad."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from postproc.krl.text.names import ascii_text, comment_text

HOSTILE = [
    "x\nHALT",
    "x\r\nEND\r\nDEF EVIL( )",
    "; HALT",
    "FOLD INI;%{PE}",
    "endfold",
    "Params IlfProvider=x; Kuka.PointName=P1",
    'say "hello"',
    "a\x00b\x1b[31mc\x7f",
    "a\x85next line\u2028HALT\u3000ideographic",
    "Fräskopf ø12 µm 日本",
    "A" * 500,
    "%R 8.3.42,%MKUKATPBASIS,%CMOVE,%VLIN,%P 1:LIN",
    "\\\\server\\share",
]


@given(st.one_of(st.text(max_size=300), st.sampled_from(HOSTILE)), st.integers(10, 200))
def test_one_line_of_printable_ascii(text, limit):
    safe = comment_text(text, limit)
    assert safe.isascii()
    assert safe == "" or safe.isprintable()
    assert len(safe) <= limit
    assert not set(safe) & set(';%"\\`')
    assert not safe.upper().startswith(("FOLD", "ENDFOLD", "PARAMS"))
    assert safe == safe.strip()


@given(st.text(max_size=200))
def test_safe_text_stays_as_it_is(text):
    assert comment_text(comment_text(text)) == comment_text(text)


@pytest.mark.parametrize(
    ("text", "safe"),
    [
        ("SPINDL/12000,CLW", "SPINDL/12000,CLW"),
        ("Fräskopf", "Fraskopf"),
        ("tool\tD12\n", "tool D12"),
        ("a;b", "a,b"),
        ("FOLD x", "'FOLD x"),
    ],
)
def test_readable_text(text, safe):
    assert comment_text(text) == safe


def test_long_text_is_cut_visibly():
    assert comment_text("word " * 100, 20) == "word word word wo..."


def test_ascii_text_keeps_semicolons():
    assert ascii_text("a;\u00e9") == "a;e"
