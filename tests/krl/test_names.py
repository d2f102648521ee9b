"""Names: legal, short, unique whatever the case, the same in every run."""

import re
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from postproc.errors import EmitError
from postproc.krl.text.names import NameAllocator, legal_name
from postproc.names import is_legal, reserved_names
from tests.places import SHARED

LEGAL = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,23}\Z")
nasty = st.one_of(
    st.text(max_size=80),
    st.sampled_from(["PTP", "END", "A B", "HALT\r\nEND", "x;y", "$TOOL", "bas", "a" * 500, ""]),
)


@given(nasty, st.integers(8, 24))
def test_every_text_gets_a_legal_name(text, length):
    name = legal_name(text, length)
    assert LEGAL.match(name)
    assert len(name) <= length
    assert is_legal(name)
    assert not name.startswith("$")


@given(nasty)
def test_a_name_is_stable(text):
    assert legal_name(legal_name(text)) == legal_name(text)


@given(st.lists(nasty, max_size=30), st.lists(st.sampled_from(["_001", "_002"]), unique=True))
def test_allocated_names_are_unique_with_their_endings(texts, endings):
    names = NameAllocator()
    taken, changes = [], []
    for text in texts:
        name = names.allocate(text, endings)
        changes += [(text, name)] if text != name else []
        taken += [name.upper(), *((name + ending).upper() for ending in endings)]
        assert all(LEGAL.match(item) for item in taken)
    assert len(set(taken)) == len(taken)
    assert list(names.changes) == changes


def test_names_of_the_language_and_of_the_controller_are_avoided():
    """Drawn from each kind: keyword, module, $config.dat, bas.src, function, $operate, axis."""
    known = """
    PTP BAS CELL TOOL_DATA PDAT_ACT USER_GRP XHOME3 PGNO_VALID SVEL_CP SET_CD_PARAMS MSGNOTIFY SIN
    STRADD SYNCCMD BAS_COMMAND MSG H_POS OV_PRO STOPMESS MODE_OP A1 E6 CON
    """
    assert set(known.split()) <= reserved_names()
    for word in sorted(reserved_names()):
        for spelling in (word, word.lower(), word.title()):
            assert not is_legal(spelling)
            assert is_legal(legal_name(spelling)), spelling
            assert legal_name(spelling).upper().startswith(word[:20])


def test_every_global_of_the_controllers_at_hand_is_avoided():
    """Data lists of $config.dat and routines of R1/System, where checkouts of real ones are."""
    shared = {}
    for config in sorted((SHARED / "real" / "krc").rglob("$config.dat")):
        for line in config.read_text("latin-1").splitlines():
            found = re.match(r"\s*(?:DECL\s+)?[A-Z]\w*\s+([A-Z_]\w*)\s*(?:\[|=|$)", line, re.I)
            if found and found[1].upper() not in ("CONFIG", "PUBLIC"):
                shared.setdefault(found[1].upper(), set()).add(config)
    if not shared:
        pytest.skip("no data of controllers at hand")
    assert not {name for name in shared if is_legal(name)}


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("P001-Nut Ø12,5 (rev. B)", "P001_Nut_12_5_rev_B"),
        ("Fräsen", "Frasen"),
        ("2nd side", "P_2nd_side"),
        ("__x__", "x"),
        ("日本", "PROGRAM"),
        ("TASCHE", "TASCHE"),
    ],
)
def test_nearest_legal_name(text, name):
    assert legal_name(text) == name


def test_long_names_that_begin_alike_stay_different():
    first, second = (legal_name(f"FREEFORM_SURFACE_FINISHING_{n}") for n in (1, 2))
    assert first != second
    assert first.startswith("FREEFORM_SURFACE_FI")
    assert legal_name("FREEFORM_SURFACE_FINISHING_1") == first


def test_prefix_and_suffix_count_in_the_24_characters():
    names = NameAllocator()
    assert len("X" + names.allocate("P" * 40, prefix="X")) == 24
    assert len(names.allocate("N" * 40, ["_001", "_SETUP"]) + "_SETUP") == 24


def test_names_differing_in_case_only_are_not_the_same_program():
    names = NameAllocator(["BOHREN"])
    assert names.allocate("Bohren") == "Bohren_2"
    assert names.allocate("bohren") == "bohren_3"
    assert names.changes == (("Bohren", "Bohren_2"), ("bohren", "bohren_3"))


def test_an_ending_must_be_free_too():
    names = NameAllocator(["DECK_002"])
    assert names.allocate("DECK", ["_001", "_002"]) == "DECK_2"


def test_reserved_names_are_not_given():
    names = NameAllocator()
    names.reserve(["PP_STOP"])
    assert names.allocate("pp_stop") == "pp_stop_2"


def test_no_room():
    with pytest.raises(EmitError, match="no room"):
        NameAllocator().allocate("A", ["_" * 20])


def test_the_same_names_whatever_the_hash_seed():
    code = (
        "from postproc.krl.text.names import NameAllocator; n = NameAllocator();"
        "print([n.allocate(t, ('_001',)) for t in ('a' * 40, 'A' * 40, 'LIN', 'x y', 'x-y')])"
    )
    outputs = {
        subprocess.run(
            [sys.executable, "-c", code],
            env={"PYTHONHASHSEED": seed, "PATH": ""},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("0", "1", "4242")
    }
    assert len(outputs) == 1


def test_cyrillic_names_keep_their_sound():
    """By the passport transliteration, so that names that differ stay different to a reader."""
    names = {"Панель 12": "Panel_12", "Отверстие": "Otverstie", "ЩИТ": "ShchIT", "Łódź": "Lodz"}
    assert {text: legal_name(text) for text in names} == names
    assert legal_name("Нервюра") != legal_name("Лонжерон")
