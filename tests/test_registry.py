import sys
from importlib.metadata import EntryPoint

import pytest

from postproc import registry as registry_module
from postproc.errors import PluginError, UsageError
from postproc.registry import Registry


def test_a_second_part_of_one_name_is_refused():
    parts = Registry("readers", "postproc.model")
    parts.register("x")(1)
    with pytest.raises(PluginError, match="registered twice"):
        parts.register("x")(2)


def test_an_unknown_name_lists_those_known():
    parts = Registry("readers", "postproc.model")
    parts._loaded = True
    parts.register("apt")(1)
    with pytest.raises(PluginError, match="expected apt"):
        parts.get("atp")


def test_a_broken_plug_in_is_named_and_left_out(monkeypatch):
    broken = EntryPoint("mine", "no_such_package.part:THING", "postproc.readers")
    good = EntryPoint("other", "math:pi", "postproc.readers")
    monkeypatch.setattr(registry_module, "plug_ins", lambda group: [broken, good])
    monkeypatch.setattr(registry_module.pkgutil, "iter_modules", lambda path: [])
    parts = Registry("readers", "postproc.model")
    infos = {info.name: info for info in parts.infos()}
    assert "ModuleNotFoundError" in infos["mine"].problem
    assert infos["other"].problem == ""
    assert [name for name, _ in parts] == ["other"]
    with pytest.raises(PluginError, match=r"reader 'mine' of .* cannot be used: ModuleNotFound"):
        parts.get("mine")


def test_a_plug_in_that_is_none_of_its_kind_is_named_and_left_out(monkeypatch):
    entries = [EntryPoint("number", "math:pi", "x"), EntryPoint("kind", "builtins:dict", "x")]
    monkeypatch.setattr(registry_module, "plug_ins", lambda group: entries)
    monkeypatch.setattr(registry_module.pkgutil, "iter_modules", lambda path: [])
    parts = Registry("readers", "postproc.model", dict)
    problems = {info.name: info.problem for info in parts.infos()}
    assert "a float is no dict" in problems["number"]
    assert "the class dict is no dict" in problems["kind"]
    assert [name for name, _ in parts] == []


def test_a_plug_in_never_takes_the_place_of_another(monkeypatch):
    """Nor does what is wrong with it hide that the other one is good."""
    twin = EntryPoint("x", "math:pi", "postproc.readers")
    monkeypatch.setattr(registry_module, "plug_ins", lambda group: [twin])
    monkeypatch.setattr(registry_module.pkgutil, "iter_modules", lambda path: [])
    parts = Registry("readers", "postproc.model")
    parts.register("x")(1)
    assert parts.get("x") == 1
    states = [(info.origin, bool(info.problem)) for info in parts.infos()]
    assert sorted(states) == [("built-in", False), ("math:pi", True)]


def test_what_a_foreign_part_fails_with_is_its_own_fault(monkeypatch):
    entry = EntryPoint("theirs", "math:pi", "postproc.readers")
    monkeypatch.setattr(registry_module, "plug_ins", lambda group: [entry])
    monkeypatch.setattr(registry_module.pkgutil, "iter_modules", lambda path: [])
    parts = Registry("readers", "postproc.model")
    parts.register("ours")(1)
    words = "PLG006: reader 'theirs' of math:pi .* failed: ZeroDivisionError"
    with pytest.raises(PluginError, match=words), parts.blame("theirs"):
        raise ZeroDivisionError
    with pytest.raises(ZeroDivisionError), parts.blame("ours"):
        raise ZeroDivisionError
    with pytest.raises(UsageError), parts.blame("theirs"):
        raise UsageError("IO020", "expected trouble stays what it is")


def test_a_part_is_registered_under_the_name_that_it_has():
    class Part:
        name = "y"

    with pytest.raises(PluginError, match="calls itself 'y'"):
        Registry("readers", "postproc.model").register("x")(Part())


def test_installed_packages_are_asked_once_each_and_what_is_no_text_is_none(tmp_path, monkeypatch):
    said = {
        ("one", "mine"): b"[postproc.readers]\nmine = mine:THING\n",
        ("one", "torn"): b"[postproc.readers]\n\xff\xfe = torn:THING\n",
        ("two", "mine"): b"[postproc.readers]\nhidden = mine:OLD\n",
        ("two", "quiet"): b"[console_scripts]\nquiet = quiet:main\n",
        ("two", "more"): b"[postproc.effects]\nmore = more:Effect\n",
    }
    for (place, name), text in said.items():
        info = tmp_path / place / f"{name}-1.2.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
        (info / "entry_points.txt").write_bytes(text)
    monkeypatch.setattr(sys, "path", [str(tmp_path / place) for place in ("one", "two")])
    registry_module._installed.cache_clear()
    try:
        assert registry_module.foreign() == ("effects more more 1.2", "readers mine mine 1.2")
    finally:
        registry_module._installed.cache_clear()


def test_installed_plug_ins_are_told_without_loading_them(monkeypatch):
    broken = EntryPoint("mine", "no_such_package.part:THING", "postproc.readers")
    monkeypatch.setattr(
        registry_module, "plug_ins", lambda group: [broken] if "readers" in group else []
    )
    assert registry_module.foreign() == ("readers mine no_such_package.part:THING ?",)
