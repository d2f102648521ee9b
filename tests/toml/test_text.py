"""Lines of keys in TOML text, against a second way of finding them."""

import time
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from postproc.errors import CellError
from postproc.toml.text import load_toml, parse_toml

TRICKY = """\
# a = 1
top = "x # y"  # b = 2
"quoted.key" = 'C:\\new'
a.b.c = 1
list = [
  1,            # [no]
  { in = "]}", "w.x" = [2, 3] },
  '''
multi ] line''',
]
text = \"\"\"
[not.a.table]
k = 1\\\"\"\"\"
[table]
v = 2024-01-01T00:00:00Z
[[rows]]
n = 1
[rows.sub]
m = 1
[[rows]]
n = 2
[[rows.deep]]
z = 1
[table.'a b']
e = -1e5
"""
WANTED = {
    ("top",): 2,
    ("quoted.key",): 3,
    ("a", "b", "c"): 4,
    ("list",): 5,
    ("list", 0): 6,
    ("list", 1): 7,
    ("list", 1, "in"): 7,
    ("list", 1, "w.x", 1): 7,
    ("list", 2): 8,
    ("text",): 11,
    ("table",): 14,
    ("table", "v"): 15,
    ("rows", 0): 16,
    ("rows", 0, "n"): 17,
    ("rows", 0, "sub", "m"): 19,
    ("rows", 1): 20,
    ("rows", 1, "n"): 21,
    ("rows", 1, "deep", 0, "z"): 23,
    ("table", "a b", "e"): 25,
}


def written(folder, text):
    path = folder / "x.toml"
    path.write_text(text, encoding="utf-8")
    return load_toml(path, CellError, "CEL001")


def test_lines_of_tricky_text(tmp_path):
    toml = written(tmp_path, TRICKY)
    for location, line in WANTED.items():
        assert (location, toml.lines.get(location)) == (location, line)
    assert toml.source(("rows", 1, "nothing")).line == 20
    assert toml.source(("nothing",)).line == 1
    assert toml.source(("table", "v")).text == "v = 2024-01-01T00:00:00Z"


def locations(value, path=()):
    if path:
        yield path
    items = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
    for key, inner in items:
        yield from locations(inner, (*path, key))


def test_every_value_has_a_line(tmp_path):
    toml = written(tmp_path, TRICKY)
    assert all(location in toml.lines for location in locations(tomllib.loads(TRICKY)))


KEYS = st.text("abc_-19", min_size=1, max_size=4)
VALUES = st.recursive(
    st.integers() | st.text("ab#[]{}=,\"'\\\n", max_size=6) | st.booleans(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=6,
)


def toml_value(value):
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        return str(value)
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
        return f'"{escaped}"'
    if isinstance(value, list):
        return "[" + ", ".join(toml_value(v) for v in value) + "]"
    return "{" + ", ".join(f"{k} = {toml_value(v)}" for k, v in value.items()) + "}"


@given(st.dictionaries(KEYS, VALUES, max_size=5))
def test_one_key_a_line(tmp_path_factory, content):
    text = "".join(f"{key} = {toml_value(value)}\n" for key, value in content.items())
    toml = written(tmp_path_factory.mktemp("toml"), text)
    assert toml.data == content
    for line, (key, value) in enumerate(content.items(), start=1):
        for location in locations(value, (key,)):
            assert toml.lines[location] == line


def test_end_of_file_errors_name_the_last_line(tmp_path):
    with pytest.raises(CellError) as caught:
        written(tmp_path, 'a = 1\nb = """\nopen')
    assert caught.value.source.line == 3


def test_a_long_text_is_read_in_time_that_grows_with_its_length():
    raw = b'x = "' + b"a" * 1_000_000 + b'"\n'
    before = time.process_time()
    parsed = parse_toml(raw, "long.toml", CellError, "CEL001")
    assert len(parsed.data["x"]) == 1_000_000
    assert time.process_time() - before < 10.0, "the square of this length takes an hour"
