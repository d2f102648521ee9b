"""Bytes to lines: what is refused, and which facts are kept."""

import pytest

from postproc.errors import KrlError
from postproc.krl.text.source import MAX_LINE, check_size, decode, text_of

PROGRAM = b"&ACCESS RVP\r\nDEF A( )\r\nEND\r\n"


def test_plain_file():
    lines, facts = decode(PROGRAM, "a.src")
    assert lines == ["&ACCESS RVP", "DEF A( )", "END"]
    assert (facts.crlf, facts.lf, facts.has_bom, facts.ends_with_newline) == (3, 0, False, True)


@pytest.mark.parametrize(
    ("data", "code", "line"),
    [
        (b"", "KRL002", 1),
        (b" \r\n\t\r\n", "KRL002", 1),
        (b"DEF A( )\r\nx\x00y\r\n", "KRL001", 2),
        (b"DEF A( )\n\n\x07", "KRL001", 3),
        (b"PK\x03\x04zip", "KRL001", 1),
        ("DEF A( )".encode("utf-16"), "KRL001", 1),
        (b"DEF A( )\n" + b"x" * (MAX_LINE + 1), "KRL001", 2),
    ],
)
def test_what_is_no_text_is_one_error(data, code, line):
    with pytest.raises(KrlError) as caught:
        decode(data, "a.src")
    assert caught.value.code == code
    assert caught.value.source.line == line
    assert "\n" not in str(caught.value)


def test_size_is_refused_before_the_file_is_read():
    with pytest.raises(KrlError, match="KRL003"):
        check_size(300 * 1024 * 1024, "a.src")


def test_encodings_and_line_ends_are_facts():
    _, facts = decode(b'\xef\xbb\xbfDEF A( )\n;gr\xc3\xb6\xc3\x9fe\r\nx="\xc3\xa4"\nEND', "a.src")
    assert facts.has_bom
    assert (facts.crlf, facts.lf, facts.ends_with_newline) == (1, 2, False)
    assert facts.non_ascii == ((2, True), (3, False))
    lines, _ = decode(b";gr\xf6\xdfe\r\n", "a.src")
    assert lines == [";größe"]


def test_old_macintosh_ends_and_dos_end_of_file():
    lines, facts = decode(b"DEF A( )\rEND\r\x1a", "a.src")
    assert lines == ["DEF A( )", "END"]
    assert facts.lf == 2


def test_long_lines_are_listed():
    _, facts = decode(b"DEF A( )\r\n;" + b"x" * 300 + b"\r\n", "a.src")
    assert facts.long_lines == ((2, 301),)


def test_one_rule_for_letters_of_every_controller():
    """UTF-8 where it is, else Windows-1252; bytes that it lacks are shown as not known."""
    assert text_of("Fräser".encode()) == text_of("Fräser".encode("cp1252")) == "Fräser"
    assert text_of(b"\x80 5 \x96 6") == "\u20ac 5 \u2013 6"
    assert text_of(b"Me\x81er") == "Me\ufffder"
