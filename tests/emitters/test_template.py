"""Templates: overridden file by file, in a sandbox, their output read as KRL."""

import pytest

from postproc.emitters.kuka.emitter import emit, render_files
from postproc.emitters.kuka.template import TemplateSet
from postproc.errors import EmitError, PostprocError, SourceRef
from postproc.krl.text.program import Call, Comment, WaitSec
from postproc.model.toolpath import EventKind

from . import plans, texts


def write(folder, text, name="main_tail", **krl):
    (folder / f"{name}.j2").write_text(text, encoding="utf-8")
    cell = plans.cell(template=str(folder), **krl)
    events = [plans.event(0, EventKind.SPINDLE_ON, 100.0, "SPINDL/6000")]
    return render_files(emit(plans.milling(events=events), cell))


def test_a_folder_overrides_single_files(tmp_path):
    files = write(tmp_path, "; park\nPARK_ARM()\n")
    lines = texts.lines(files, "TEST.src")
    assert lines[-3:] == ["; park", "PARK_ARM()", "END"]
    assert "BAS(#INITMOV,0)" in lines


def test_an_event_template_gets_values_names_and_the_text_as_a_comment(tmp_path):
    files = write(
        tmp_path,
        "{% if rpm > 5000 %}\nUP_FAST({{ rpm }},{{ rpm / 60 }}) {{ event }}\n{% endif %}"
        "$OUT[7]=TRUE\n",
        "spindle_on",
    )
    lines = texts.lines(files, "TEST.src")
    at = lines.index("UP_FAST(6000,100.000000) ; CAM line 7: SPINDL/6000")
    assert lines[at + 1] == "$OUT[7]=TRUE"


def test_hook_names_come_from_the_cell():
    cell = plans.cell(hooks={"spindle_on": "SPINDLE_START"}, hooks_example=True)
    events = [plans.event(0, EventKind.SPINDLE_ON, 100.0)]
    files = render_files(emit(plans.milling(events=events), cell))
    assert "SPINDLE_START(6000)" in texts.code(files, "TEST.src")
    assert "GLOBAL DEF SPINDLE_START(RPM:IN)" in texts.lines(files, "PP_HOOKS.src")


def test_a_program_never_takes_the_name_of_a_hook():
    modules = emit(plans.milling(name="pp_stop"), plans.cell())
    assert modules[0].name == "pp_stop_2"


ESCAPES = [
    "{{ ''.__class__.__mro__[1].__subclasses__() }}",
    "{{ hooks.__class__ }}",
    "{{ hooks.items.__func__.__globals__ }}",
    "{{ event.__init__.__globals__ }}",
    "{{ event._comment }}",
    "{{ self._TemplateReference__context }}",
    "{{ cycler.__init__.__globals__.os }}",
    "{{ lipsum.__globals__['os'].popen('id') }}",
    "{{ config }}",
    "{{ request }}",
    "{{ ''|attr('__class__') }}",
    "{{ [1]|map('string')|list }}",
    "{{ 'a' * 999999999 }}",
    "{{ 9 ** 9 ** 9 }}",
    "{{ '%999999999d' % 1 }}",
    "{{ '{0.__class__}'.format(1) }}",
    "{{ 'x'.format_map({}) }}",
    "{{ range(999999999) }}",
    "{% for i in range(10) %}{{ i }}{% endfor %}",
    "{% set x = [] %}{{ x.append(1) }}",
    "{% include '../../../../../../etc/passwd' %}",
    "{% include '/etc/passwd' %}",
    "{% import 'os' as os %}",
    "{% extends 'nowhere.j2' %}",
    "{{ undefined_name }}",
    "{{ 1 / 0 }}",
    "{% if %}",
    "{{ unclosed",
    "{% macro f() %}{{ f() }}{% endmacro %}{{ f() }}",
    "{% include 'main_tail.j2' %}",
]


@pytest.mark.parametrize("text", ESCAPES)
def test_nothing_gets_out_of_the_sandbox(tmp_path, text):
    for name in ("main_tail", "spindle_on"):
        with pytest.raises(PostprocError) as caught:
            write(tmp_path, text, name)
        assert caught.value.code in {"EMT331", "EMT332", "EMT333"}
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("this is no KRL ]]", "EMT333"),
        ("INI", "EMT333"),
        ("// comment", "EMT333"),
        ("; Ä", "EMT332"),
        ("; " + "x" * 300, "EMT332"),
        ("; tab\tin a comment", "EMT332"),
        ("END\nDEF OTHER( )", "EMT333"),
        ("UP({{ event }})", "EMT333"),
        ("{{ (event ~ '')[2:] }}=1", "EMT333"),
    ],
)
def test_output_that_is_no_krl_is_refused(tmp_path, text, code):
    with pytest.raises(EmitError) as caught:
        write(tmp_path, text, "spindle_on")
    assert caught.value.code == code


def test_a_string_with_outside_text_is_refused(tmp_path):
    with pytest.raises(EmitError) as caught:
        write(tmp_path, 'T[]="{{ event }}"', "spindle_on")
    assert caught.value.code == "EMT334"


def test_an_attribute_line_needs_its_mark(tmp_path):
    with pytest.raises(EmitError) as caught:
        write(tmp_path, "ACCESS RVP\n", "attributes")
    assert caught.value.code == "EMT333"


@pytest.mark.parametrize("name", ["nowhere", "../default", "/nonexistent/folder", "default/../x"])
def test_a_missing_template_set_is_named(name):
    with pytest.raises(EmitError) as caught:
        emit(plans.milling(), plans.cell(template=name))
    assert caught.value.code == "EMT330"
    assert "default" in caught.value.message


def test_statements_are_typed_and_texts_filled_in_once():
    templates = TemplateSet("default", SourceRef("cell.toml"))
    made = templates.statements("dwell", {"hooks": {}, "seconds": 0.5}, {"event": "@event@ ; x"})
    assert made == [WaitSec(0.5, comment=" @event@ , x")]
    made = templates.statements("message", {}, {"event": "hello"})
    assert made == [Comment(" hello")]
    made = templates.statements("stop", {"hooks": {"stop": "UP"}}, {"event": ""})
    assert made == [Call("UP")]


def test_every_built_in_template_is_documented():
    from postproc.resources import templates_folder

    folder = templates_folder() / "default"
    readme = (folder / "README.md").read_text(encoding="utf-8")
    for path in folder.glob("*.j2"):
        assert f"`{path.name}`" in readme
