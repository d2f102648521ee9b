"""Tokens and comments of one line."""

import pytest

from postproc.krl.text.lexer import KrlSyntaxError, TokenKind, split_comment, tokenise


def kinds(text):
    return [token.kind for token in tokenise(text)][:-1]


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("1", TokenKind.NUMBER),
        ("1.", TokenKind.NUMBER),
        (".25", TokenKind.NUMBER),
        ("1.5E-03", TokenKind.NUMBER),
        ("2.62970374e+14", TokenKind.NUMBER),
        ("'B10110'", TokenKind.BITS),
        ("'H1f'", TokenKind.BITS),
        ('"a;b"', TokenKind.STRING),
        ("$VEL_AXIS", TokenKind.NAME),
        ("#BASE", TokenKind.ENUM),
        ("<>", TokenKind.OPERATOR),
        (":", TokenKind.OPERATOR),
    ],
)
def test_single_tokens(text, kind):
    tokens = tokenise(f"  {text} ")
    assert [(t.kind, t.text) for t in tokens[:-1]] == [(kind, text)]
    assert tokens[-1].kind is TokenKind.END


def test_positions_point_into_the_line():
    tokens = tokenise("a == b[2].X")
    assert [t.text for t in tokens[:-1]] == ["a", "==", "b", "[", "2", "]", ".", "X"]
    assert [t.start for t in tokens[:-1]] == [0, 2, 5, 6, 7, 8, 9, 10]


@pytest.mark.parametrize(
    ("text", "message"),
    [("LIN {X 1.5mm}", "no number"), ('a="b', "not closed"), ("a = 3 ~ 4", "'~'"), ("a=3%", "'%'")],
)
def test_strange_characters(text, message):
    with pytest.raises(KrlSyntaxError, match=message):
        tokenise(text)


@pytest.mark.parametrize(
    ("line", "code", "comment"),
    [
        ("LIN P1", "LIN P1", ""),
        ("LIN P1 ;end", "LIN P1 ", "end"),
        ('a="x;y" ; z;w', 'a="x;y" ', " z;w"),
        (";only", "", "only"),
        ('a="x;y"', 'a="x;y"', ""),
    ],
)
def test_comments(line, code, comment):
    assert split_comment(line) == (code, comment)
