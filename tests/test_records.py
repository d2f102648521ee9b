"""Our cheap dataclasses against those of the standard library: one definition made with both."""

import copy
import dataclasses
import pickle
from dataclasses import field, replace

import pytest

from postproc import records


def defined(dataclass):
    @dataclass(frozen=True, slots=True, kw_only=True)
    class Line:
        comment: str = ""
        line: int = field(default=0, compare=False)

    @dataclass(frozen=True, slots=True)
    class Move(Line):
        word: str
        target: float = 0.0
        blend: tuple = ()
        note: str = field(default="", repr=False)

    @dataclass(frozen=True, slots=True)
    class Assign(Line):
        word: str
        target: float = 0.0

    @dataclass(frozen=True, slots=True)
    class Mark:
        pass

    @dataclass(slots=True)
    class Open:
        items: list = field(default_factory=list)

    return Line, Move, Assign, Mark, Open


OURS, THEIRS = defined(records.dataclass), defined(dataclasses.dataclass)


def made(kinds):
    line, move, assign, mark, is_open = kinds
    return [
        line(),
        line(comment="a", line=3),
        move("PTP"),
        move("PTP", line=7),
        move("PTP", 1.0, ("C_DIS",), "n", comment="c"),
        move("PTP", float("nan")),
        assign("PTP"),
        mark(),
        is_open(),
        is_open([is_open()]),
    ]


def test_texts_are_those_of_dataclasses():
    assert [repr(item) for item in made(OURS)] == [repr(item) for item in made(THEIRS)]


def test_equality_is_that_of_dataclasses():
    ours, theirs = made(OURS), made(THEIRS)
    again_ours, again_theirs = made(OURS), made(THEIRS)
    for row, others in zip(ours, theirs, strict=True):
        found = [row == other for other in again_ours]
        assert found == [others == other for other in again_theirs]
    assert any(a == b and a is not b for a in ours for b in again_ours)


def test_what_is_equal_has_one_hash_and_what_is_not_frozen_has_none():
    for ours, again, theirs in zip(made(OURS), made(OURS), made(THEIRS), strict=True):
        if type(theirs).__hash__ is None:
            assert type(ours).__hash__ is None
        elif ours == again:
            assert hash(ours) == hash(again)


@pytest.mark.parametrize("number", range(5))
def test_fields_are_those_of_dataclasses(number):
    ours, theirs = OURS[number], THEIRS[number]
    for name in ("name", "default", "init", "repr", "compare", "kw_only"):
        found = [getattr(item, name) for item in dataclasses.fields(ours)]
        assert found == [getattr(item, name) for item in dataclasses.fields(theirs)]
    assert ours.__slots__ == theirs.__slots__
    assert ours.__match_args__ == theirs.__match_args__


def test_replace_and_copies():
    move = made(OURS)[4]
    changed = replace(move, target=2.0)
    assert (changed.target, changed.blend, move.target) == (2.0, ("C_DIS",), 1.0)
    assert copy.deepcopy(move) == move


@records.dataclass(frozen=True, slots=True)
class Sent:
    """At the top of a module, as what is sent to other processes."""

    value: int
    more: tuple = ()


def test_instances_go_to_other_processes():
    sent = Sent(3, (1.0,))
    assert pickle.loads(pickle.dumps(sent)) == sent


@pytest.mark.parametrize("slots", [True, False])
def test_fields_of_frozen_instances_are_set_once(slots):
    def own(dataclass):
        @dataclass(frozen=True, slots=slots)
        class Frozen:
            value: int
            other: int = 0
            late: int = field(init=False)

            def __post_init__(self):
                object.__setattr__(self, "late", self.value)

            def method(self): ...

        return Frozen(3)

    for item in (own(records.dataclass), own(dataclasses.dataclass)):  # theirs: TypeError of slots
        for name in ("value", "other", "late", "method", "new"):
            with pytest.raises((AttributeError, TypeError)):
                setattr(item, name, 4)
        with pytest.raises(dataclasses.FrozenInstanceError, match="cannot assign to field 'value'"):
            item.value = 4
        with pytest.raises(dataclasses.FrozenInstanceError, match="cannot delete field 'value'"):
            del item.value
        assert (item.value, item.other, item.late) == (3, 0, 3)
        assert copy.copy(item) == copy.deepcopy(item) == item


@pytest.mark.parametrize("own", [records.dataclass, records.record])
def test_frozen_classes_of_others_can_derive_from_ours(own):
    base = own(frozen=True, slots=True)(type("Base", (), {"__annotations__": {"value": int}}))
    middle = own(frozen=True, slots=True)(type("Middle", (base,), {"__annotations__": {"x": int}}))

    @dataclasses.dataclass(frozen=True, slots=True)
    class Theirs(middle):
        more: int = 0

    item = Theirs(1, 2, 3)
    for name in ("value", "x", "more"):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(item, name, 4)
    assert replace(item, more=5) == Theirs(1, 2, 5)
    with pytest.raises(TypeError, match="non-frozen"):
        dataclasses.dataclass(type("Open", (middle,), {}))


def test_records_are_guarded_by_the_type_checker_alone():
    @records.record(frozen=True, slots=True)
    class Many:
        value: int

    item = Many(3)
    item.value = 4
    assert item == Many(4)
    assert hash(item) == hash(Many(4))


def test_without_equality_an_instance_equals_itself_alone():
    @records.dataclass(frozen=True, slots=True, eq=False)
    class Own:
        value: int

    item = Own(3)
    assert item == item
    assert item != Own(3)
    assert len({item, Own(3)}) == 2


def test_own_methods_are_kept():
    @records.dataclass(frozen=True, slots=True)
    class Own:
        value: int

        def __eq__(self, other):
            return True

        def __hash__(self):
            return 1

        def __repr__(self):
            return "own"

    assert (Own(1) == 2, hash(Own(1)), repr(Own(1))) == (True, 1, "own")
