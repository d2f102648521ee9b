"""What ``import postproc`` offers explains itself: arguments, results, errors."""

import ast
import inspect
import re
import textwrap

import pytest

import postproc

NAMES = sorted(set(postproc.__all__) - {"__version__"})


def functions(name):
    """Return the functions of a public name: itself, or the public methods of a class."""
    thing = getattr(postproc, name)
    if not inspect.isclass(thing):
        return {name: thing}
    members = {key: inspect.unwrap(getattr(thing, key)) for key in vars(thing) if key[0] != "_"}
    return {
        f"{name}.{key}": member
        for key, member in members.items()
        if inspect.isfunction(member) or inspect.ismethod(member)
    }


def section(doc, title):
    """Return the text of a section, None if there is none."""
    found = re.search(rf"^{title}:\n((?: .*(?:\n|$)|\n)+)", doc, re.MULTILINE)
    return found.group(1) if found else None


def raises(function):
    """Whether the function itself raises something."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    return any(isinstance(node, ast.Raise) and node.exc for node in ast.walk(tree))


def faults(name, function):
    doc = inspect.getdoc(function) or ""
    signature = inspect.signature(function)
    arguments = [key for key in signature.parameters if key not in ("self", "cls")]
    if not arguments:
        return [] if doc else [f"{name}: no docstring"]
    told = section(doc, "Args") or ""
    missing = [key for key in arguments if not re.search(rf"^    {key}: ", told, re.MULTILINE)]
    known = {*arguments}
    strange = [key for key in re.findall(r"^    (\w+): ", told, re.MULTILINE) if key not in known]
    found = [f"{name}: Args without {key}" for key in missing]
    found += [f"{name}: Args names {key}, which it does not take" for key in strange]
    if signature.return_annotation not in (None, "None") and not section(doc, "Returns"):
        found.append(f"{name}: no Returns")
    if raises(function) and not section(doc, "Raises"):
        found.append(f"{name}: no Raises")
    return found


@pytest.mark.parametrize("name", NAMES)
def test_public_names_say_what_they_take_return_and_raise(name):
    assert inspect.getdoc(getattr(postproc, name))
    assert [fault for key, f in functions(name).items() for fault in faults(key, f)] == []


def test_the_check_sees_what_is_missing():
    def bad(one: int, two: int) -> int:
        """Return a sum.

        Args:
            one: first.
            three: third.
        """
        if one > two:
            raise ValueError
        return one + two

    assert faults("bad", bad) == [
        "bad: Args without two",
        "bad: Args names three, which it does not take",
        "bad: no Returns",
        "bad: no Raises",
    ]
