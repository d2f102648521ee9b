"""Reads a grammar of ANTLR 4 and says whether a text belongs to it: no code of the grammar runs.

The text is cut into the longest tokens, the first rule winning, and recognised by Earley's method,
which takes left recursion and ambiguity as they come. Actions, modes and predicates are not known.
"""

import re
from collections import defaultdict
from dataclasses import dataclass, field

_COMMENT = re.compile(r"'(?:\\.|[^'\\])*'|\[(?:\\.|[^\]\\])*\]|//[^\n]*|/\*.*?\*/", re.S)
_WORD = re.compile(
    r"'(?:\\.|[^'\\])*'|\[(?:\\.|[^\]\\])*\]|->[^;|]*|#\s*\w+|\w+\s*\+?=|\w+|\.\.|[:;|()?*+~.]"
)
_RULE = re.compile(r"\s*(fragment\s+)?(\w+)\s*\Z")


@dataclass
class Grammar:
    """Tokens in order of their rules, productions by nonterminal; no parser sees ``hidden``."""

    start: str
    tokens: list = field(default_factory=list)
    hidden: set = field(default_factory=set)
    productions: dict = field(default_factory=lambda: defaultdict(list))

    def lex(self, text):
        """Tokens as (name, line); a character that begins none is a ValueError."""
        at, line, found = 0, 1, []
        while at < len(text):
            best, name = 0, ""
            for candidate, pattern in self.tokens:
                match = pattern.match(text, at)
                if match and match.end() - at > best:
                    best, name = match.end() - at, candidate
            if not best:
                raise ValueError(f"line {line}: {text[at]!r} begins no token")
            if name not in self.hidden:
                found.append((name, line))
            line += text.count("\n", at, at + best)
            at += best
        return found

    def fault(self, text):
        """The line of the first token that does not fit, 0 where the whole text does."""
        tokens = [*self.lex(text), ("EOF", text.count("\n") + 1)]
        nullable = self._nullable()
        waiting, items = [], [(self.start, rhs, 0, 0) for rhs in self.productions[self.start]]
        for place in range(len(tokens) + 1):
            wanted, seen, following = defaultdict(list), set(), []
            waiting.append(wanted)
            stack = list(items)
            while stack:
                item = stack.pop()
                if item in seen:
                    continue
                seen.add(item)
                lhs, rhs, dot, origin = item
                if dot == len(rhs):
                    stack += [(a, b, c + 1, d) for a, b, c, d in waiting[origin][lhs]]
                    continue
                symbol = rhs[dot]
                if symbol not in self.productions:
                    if place < len(tokens) and tokens[place][0] == symbol:
                        following.append((lhs, rhs, dot + 1, origin))
                    continue
                if symbol not in wanted:
                    stack += [(symbol, b, 0, place) for b in self.productions[symbol]]
                wanted[symbol].append(item)
                if symbol in nullable:
                    stack.append((lhs, rhs, dot + 1, origin))
            if place == len(tokens):
                whole = any(a == self.start and c == len(b) and d == 0 for a, b, c, d in seen)
                return 0 if whole else tokens[-1][1]
            if not following:
                return tokens[place][1]
            items = following
        raise AssertionError

    def _nullable(self):
        found, grew = set(), True
        while grew:
            more = {
                name
                for name, bodies in self.productions.items()
                if any(all(symbol in found for symbol in body) for body in bodies)
            }
            grew, found = more != found, more
        return found


def read_grammar(text, start):
    """The grammar of a ``.g4`` file."""
    text = _COMMENT.sub(lambda m: m[0] if m[0][0] in "'[" else " ", text)
    rules, fragments = {}, set()
    text = text[re.search(r"grammar\s+\w+\s*;", text).end() :]
    for name, is_fragment, tree in _rules(text):
        rules[name] = tree
        if is_fragment:
            fragments.add(name)
    grammar = Grammar(start)
    literals = {}
    for name, tree in rules.items():
        if name[0].islower():
            _expand(grammar, name, tree, literals)
    grammar.tokens = [(name, re.compile(re.escape(value))) for value, name in literals.items()]
    for name, tree in rules.items():
        if name[0].isupper() and name not in fragments:
            for words, command in tree:
                if "HIDDEN" in command or "skip" in command:
                    grammar.hidden.add(name)
                grammar.tokens.append((name, re.compile(_regex([(words, "")], rules))))
    return grammar


def _rules(text):
    """Yield name, whether it is a fragment, and the alternatives of each rule."""
    words = [m[0] for m in _WORD.finditer(text)]
    at = 0
    while at < len(words):
        is_fragment = words[at] == "fragment"
        at += is_fragment
        name, colon = words[at], words[at + 1]
        assert colon == ":", (name, colon)
        tree, at = _alternatives(words, at + 2)
        assert words[at] == ";", (name, words[at])
        at += 1
        yield name, is_fragment, tree


def _alternatives(words, at):
    """Alternatives as (sequence, command); a sequence holds (atom, suffix)."""
    found, sequence, command = [], [], ""
    while words[at] not in (";", ")"):
        word = words[at]
        if word == "|":
            found.append((sequence, command))
            sequence, command = [], ""
        elif word == "(":
            inner, at = _alternatives(words, at + 1)
            sequence.append([inner, ""])
        elif word.startswith("->"):
            command = word
        elif word in ("?", "*", "+"):
            sequence[-1][1] += word
        elif word == "~":
            inner, at = ("~", words[at + 1]), at + 1
            if words[at] == "(":
                group, at = _alternatives(words, at + 1)
                inner = ("~", group)
            sequence.append([inner, ""])
        elif word == "..":
            sequence[-1][0] = ("..", sequence[-1][0], words[at + 1])
            at += 1
        elif not word.startswith("#") and not word.endswith("="):
            sequence.append([word, ""])
        elif word == "=":
            raise AssertionError(word)
        at += 1
    found.append((sequence, command))
    return found, at


def _plain(literal):
    return literal[1:-1].encode().decode("unicode_escape") if "\\" in literal else literal[1:-1]


def _regex(tree, rules):
    """The regular expression of a lexer rule."""
    return "|".join(
        "".join(f"(?:{_atom(atom, rules)}){suffix}" for atom, suffix in sequence)
        for sequence, _ in tree
    )


def _atom(atom, rules):
    if isinstance(atom, list):
        return _regex(atom, rules)
    if isinstance(atom, tuple) and atom[0] == "..":
        return f"[{re.escape(_plain(atom[1]))}-{re.escape(_plain(atom[2]))}]"
    if isinstance(atom, tuple):
        return f"(?!{_atom(atom[1], rules)})[\\s\\S]"
    if atom.startswith("'"):
        return re.escape(_plain(atom))
    if atom.startswith("["):
        return atom
    return "[\\s\\S]" if atom == "." else _regex(rules[atom], rules)


def _expand(grammar, name, tree, literals):
    """Write the alternatives of a parser rule as plain productions."""
    for number, (sequence, _) in enumerate(tree):
        body = []
        for place, (atom, suffix) in enumerate(sequence):
            symbol = atom
            if isinstance(atom, list):
                symbol = f"{name}/{number}.{place}"
                _expand(grammar, symbol, atom, literals)
            elif atom.startswith("'"):
                symbol = literals.setdefault(_plain(atom), atom)
            if suffix:
                many = f"{name}/{number}.{place}{suffix}"
                once = [(symbol,)] if suffix[0] != "*" else []
                grammar.productions[many] += [*once] if suffix[0] == "+" else [(), *once]
                if suffix[0] in "*+":
                    grammar.productions[many].append((many, symbol))
                symbol = many
            body.append(symbol)
        grammar.productions[name].append(tuple(body))
