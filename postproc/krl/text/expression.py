"""KRL expressions: literals, variables, calls, operators and the frame operator ``:``.

Precedence from tight to loose: sign and NOT, ``:``, ``* /``, ``+ -``, comparisons, AND, EXOR, OR.
KRL's printed table puts comparisons last; in ``a == 1 AND b == 2`` only the reading used here has
matching types, so both give the same for every program that a controller takes.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import TypeAlias

from postproc.krl.text.lexer import KrlSyntaxError, Token, TokenKind, tokenise
from postproc.krl.text.literals import bits, components, number, pose_or_axes
from postproc.krl.text.program import Aggregate, Axes, Enum, Expr, Pose, Text, Value
from postproc.records import dataclass

MAX_DEPTH = 60
"""Nesting beyond this is no program that a person or a post has written."""


@dataclass(frozen=True, slots=True)
class Reference:
    """A variable: ``name`` in upper case, then indices (tuples of nodes) and components (str)."""

    name: str
    selectors: tuple[tuple[Node, ...] | str, ...] = ()


@dataclass(frozen=True, slots=True)
class FunctionCall:
    """``name(arguments)``; an argument left out is None."""

    name: str
    arguments: tuple[Node | None, ...]


@dataclass(frozen=True, slots=True)
class Unary:
    """``-``, ``+``, ``NOT`` or ``B_NOT`` of a node."""

    operator: str
    operand: Node


@dataclass(frozen=True, slots=True)
class Binary:
    """Two nodes and the operator between them, in upper case."""

    operator: str
    left: Node
    right: Node


@dataclass(frozen=True, slots=True)
class Structure:
    """A structure literal whose components need computing."""

    type_name: str
    fields: tuple[tuple[str, Node], ...]


Literal: TypeAlias = float | int | bool | Text | Enum | Pose | Axes | Aggregate
Node: TypeAlias = Literal | Reference | FunctionCall | Unary | Binary | Structure

_LEVELS = (
    ("OR", "B_OR"),
    ("EXOR", "B_EXOR"),
    ("AND", "B_AND"),
    ("==", "<>", "<", ">", "<=", ">="),
    ("+", "-"),
    ("*", "/"),
    (":",),
)
_WORDS = frozenset({"OR", "B_OR", "EXOR", "B_EXOR", "AND", "B_AND"})


class ExpressionParser:
    """Recursive descent over the tokens of one line; what is wrong is a ``KrlSyntaxError``."""

    def __init__(self, text: str, line: int = 0) -> None:
        self.text, self.line = text, line
        self.tokens = tokenise(text)
        self.at = 0
        self._depth = 0

    # ------------------------------------------------------------------ tokens

    @property
    def token(self) -> Token:
        """The token that comes next."""
        return self.tokens[self.at]

    def word(self) -> str:
        """Return the next token in upper case if it is a name, else an empty string."""
        token = self.tokens[self.at]
        return token.text.upper() if token.kind is TokenKind.NAME else ""

    def take(self) -> Token:
        """Return the next token and go on."""
        token = self.tokens[self.at]
        if token.kind is not TokenKind.END:
            self.at += 1
        return token

    def accept(self, text: str) -> bool:
        """Take the next token if it reads ``text`` (operators and upper-case words)."""
        token = self.tokens[self.at]
        if token.text == text or (token.kind is TokenKind.NAME and token.text.upper() == text):
            self.at += 1
            return True
        return False

    def expect(self, text: str) -> None:
        """Take the token ``text``."""
        if not self.accept(text):
            raise KrlSyntaxError(f"expected {text!r}, found {self.here()}")

    def here(self) -> str:
        """Return the next token as a message names it."""
        token = self.token
        return "the end of the line" if token.kind is TokenKind.END else repr(token.text)

    def finish(self) -> None:
        """Check that nothing is left."""
        if self.token.kind is not TokenKind.END:
            raise KrlSyntaxError(f"{self.here()} does not belong here")

    # ------------------------------------------------------------- expressions

    def expression(self, level: int = 0) -> Node:
        """Return the expression that comes next; stop where it cannot go on."""
        if level == len(_LEVELS):
            return self._unary()
        left = self.expression(level + 1)
        while True:
            token = self.token
            operator = token.text.upper()
            if operator not in _LEVELS[level]:
                return left
            if token.kind is TokenKind.NAME and operator not in _WORDS:
                return left
            self.at += 1
            left = Binary(operator, left, self.expression(level + 1))

    def _unary(self) -> Node:
        token = self.token
        operator = token.text.upper()
        if operator not in ("-", "+", "NOT", "B_NOT"):
            return self._primary()
        self.at += 1
        self._deeper()
        operand = self._unary()
        self._depth -= 1
        if operator == "-" and isinstance(operand, int | float) and not isinstance(operand, bool):
            return -operand if operand else -float(operand)
        return operand if operator == "+" else Unary(operator, operand)

    def _primary(self) -> Node:
        token = self.token
        if token.kind is TokenKind.NUMBER:
            self.at += 1
            return number(token.text)
        if token.kind is TokenKind.BITS:
            self.at += 1
            return bits(token.text)
        if token.kind is TokenKind.STRING:
            self.at += 1
            return Text(token.text[1:-1])
        if token.kind is TokenKind.ENUM:
            self.at += 1
            return Enum(token.text[1:].lstrip())
        if token.kind is TokenKind.NAME:
            return self._named()
        if token.text in ("(", "{"):
            return self._bracketed()
        raise KrlSyntaxError(f"expected a value, found {self.here()}")

    def _bracketed(self) -> Node:
        self._deeper()
        if self.accept("("):
            inner = self.expression()
            self.expect(")")
        else:
            inner = self._structure()
        self._depth -= 1
        return inner

    def _deeper(self) -> None:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise KrlSyntaxError(f"more than {MAX_DEPTH} brackets within each other")

    def _named(self) -> Node:
        name = self.take().text
        upper = name.upper()
        if upper in ("TRUE", "FALSE"):
            return upper == "TRUE"
        if self.token.text == "(":
            return FunctionCall(name, self.arguments())
        return Reference(upper, self.selectors())

    def selectors(self) -> tuple[tuple[Node, ...] | str, ...]:
        """Return the indices and components behind a name."""
        found: list[tuple[Node, ...] | str] = []
        while True:
            if self.accept("["):
                found.append(self._indices())
            elif self.accept("."):
                component = self.take()
                if component.kind is not TokenKind.NAME:
                    raise KrlSyntaxError(f"expected a component, found {component.text!r}")
                found.append(component.text.upper())
            else:
                return tuple(found)

    def _indices(self) -> tuple[Node, ...]:
        self._deeper()
        indices: list[Node] = []
        while not self.accept("]"):
            if self.accept(","):
                continue
            indices.append(self.expression())
            if self.token.text not in ("]", ","):
                raise KrlSyntaxError(f"expected ']', found {self.here()}")
        self._depth -= 1
        return tuple(indices)

    def arguments(self) -> tuple[Node | None, ...]:
        """Return the arguments in the brackets that come next."""
        self.expect("(")
        self._deeper()
        found: list[Node | None] = []
        while True:
            found.append(None if self.token.text in (",", ")") else self.expression())
            if self.accept(")"):
                break
            self.expect(",")
        self._depth -= 1
        return () if found == [None] else tuple(found)

    # -------------------------------------------------------------- structures

    def _structure(self) -> Node:
        self.expect("{")
        type_name = ""
        if self.token.kind is TokenKind.NAME and self.tokens[self.at + 1].text == ":":
            type_name = self.take().text
            self.at += 1
        fields: list[tuple[str, Node]] = []
        while not self.accept("}"):
            fields.append(self._component())
            if self.token.text != "}":
                self.expect(",")
        return _shape(type_name, fields)

    def _component(self) -> tuple[str, Node]:
        token = self.take()
        if token.kind is not TokenKind.NAME:
            found = "the end of the line" if token.kind is TokenKind.END else repr(token.text)
            hint = ", or a decimal comma" if token.kind is TokenKind.NUMBER else ""
            raise KrlSyntaxError(f"expected a component name, found {found}{hint}")
        name = token.text
        if self.accept("["):
            name += "[" + "".join(str(index) for index in self._indices()) + "]"
        return name, self.expression()

    def value(self) -> Value:
        """Return the value that comes next as the program type holds it."""
        start = self.token.start
        node = self.expression()
        return as_value(node, self.text[start : self.tokens[self.at - 1].end])


def _shape(type_name: str, fields: list[tuple[str, Node]]) -> Node:
    """Return a literal where all components are literals, else a structure to be computed."""
    plain: list[tuple[str, float]] = []
    for name, value in fields:
        if isinstance(value, Reference | FunctionCall | Unary | Binary | Structure):
            return Structure(type_name, tuple(fields))
        if isinstance(value, int | float) and not isinstance(value, bool):
            plain.append((name, value))
    if plain and len(plain) == len(fields):
        shaped = pose_or_axes(type_name, plain)
        if shaped is not None:
            return shaped
    return Aggregate(tuple(fields), type_name)  # type: ignore[arg-type]  # no node is left among them


def as_value(node: Node, text: str) -> Value:
    """Return a node as the program type holds it: literals as they are, the rest as text."""
    if isinstance(node, Structure):
        parts = tuple((name, as_value(part, unparse(part))) for name, part in node.fields)
        return Aggregate(parts, node.type_name)
    if isinstance(node, Reference | FunctionCall | Unary | Binary):
        return Expr(" ".join(text.split()))
    return node


def unparse(node: Node) -> str:
    """Return an expression as text: same meaning, own spelling."""
    if isinstance(node, Reference):
        return node.name + "".join(_selector(item) for item in node.selectors)
    if isinstance(node, FunctionCall):
        inner = ",".join("" if item is None else unparse(item) for item in node.arguments)
        return f"{node.name}({inner})"
    if isinstance(node, Unary):
        blank = "" if node.operator == "-" else " "
        return f"{node.operator}{blank}{unparse(node.operand)}"
    if isinstance(node, Binary):
        return f"({unparse(node.left)} {node.operator} {unparse(node.right)})"
    return _unparse_literal(node)


def _selector(item: tuple[Node, ...] | str) -> str:
    if isinstance(item, str):
        return f".{item}"
    return "[" + ",".join(unparse(index) for index in item) + "]"


def _unparse_literal(node: Node) -> str:
    if isinstance(node, bool):
        return "TRUE" if node else "FALSE"
    if isinstance(node, Text):
        return f'"{node.value}"'
    if isinstance(node, Enum):
        return f"#{node.name}"
    if isinstance(node, Structure | Aggregate):
        head = f"{node.type_name}: " if node.type_name else ""
        inner = ",".join(
            f"{name} {value.text if isinstance(value, Expr) else unparse(value)}"
            for name, value in node.fields
        )
        return "{" + head + inner + "}"
    if isinstance(node, Pose | Axes):
        return "{" + ",".join(f"{name} {value!r}" for name, value in components(node)) + "}"
    return repr(node)


@lru_cache(maxsize=8192)
def parse_expression(text: str) -> Node:
    """Return the tree of a whole expression."""
    parser = ExpressionParser(text)
    node = parser.expression()
    parser.finish()
    return node


def nodes_in(node: Node) -> Iterator[Node]:
    """Yield a tree's nodes, the tree itself first."""
    stack: list[Node] = [node]
    while stack:
        item = stack.pop()
        yield item
        if isinstance(item, Reference):
            for selector in item.selectors:
                if not isinstance(selector, str):
                    stack.extend(selector)
        elif isinstance(item, FunctionCall):
            stack.extend(argument for argument in item.arguments if argument is not None)
        elif isinstance(item, Unary):
            stack.append(item.operand)
        elif isinstance(item, Binary):
            stack += [item.left, item.right]
        elif isinstance(item, Structure):
            stack.extend(value for _, value in item.fields)
        elif isinstance(item, Aggregate):
            stack.extend(
                parse_expression(value.text) if isinstance(value, Expr) else value
                for _, value in item.fields
            )


def names_in(node: Node) -> Iterator[tuple[str, bool]]:
    """Yield (name in upper case, whether it is called) of all variables and functions in a tree."""
    for item in nodes_in(node):
        if isinstance(item, Reference):
            yield item.name, False
        elif isinstance(item, FunctionCall):
            yield item.name.upper(), True
