"""A template of the shop that cannot be judged: the message names its file, line and key."""

import shutil

import pytest

from postproc.cli.app import run
from postproc.resources import templates_folder

HOLES = "id,x,y,z,i,j,k,depth,feed,rpm\nH1,0,0,0,0,0,1,12,120,3000\nH2,60,0,0,0,0,1,12,120,3000\n"


@pytest.fixture
def shop(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(templates_folder() / "default", tmp_path / "shop")
    (tmp_path / "holes.csv").write_text(HOLES, encoding="utf-8")
    call = (
        "new-cell -q -o cell.toml --robot kuka_kr210_r2700_2 --tool-xyz 150 0 250 --tool-axis +x "
        "--tool-mass 35 --workpiece-xyz 1400 -60 700 --home 0 -90 90 0 30 0 --spindle program"
    )
    assert run(call.split()) == 0
    cell = (tmp_path / "cell.toml").read_text(encoding="utf-8")
    cell = cell.replace('template = "default"', 'template = "shop"')

    def told(template, hook="PP_SPINDLE_ON"):
        text = cell.replace('spindle_on = "PP_SPINDLE_ON"', f'spindle_on = "{hook}"')
        (tmp_path / "cell.toml").write_text(text, encoding="utf-8")
        (tmp_path / "shop" / "spindle_on.j2").write_text(template, encoding="utf-8")
        answers = []
        for command in ("convert holes.csv --cell cell.toml -o out", "check cell.toml --templates"):
            capsys.readouterr()
            code = run(command.split())
            answers.append((code, capsys.readouterr().err))
        return answers

    return told


def test_a_routine_of_a_tech_package_is_named_with_the_key_that_accepts_it(shop):
    wrong = []
    for code, text in shop("; high speed\nHS_START({{ rpm }}, 1)\n"):
        place = "shop/spindle_on.j2:2: error EMT336: the template gives 'HS_START("
        if code != 1 or place not in text or "[verify] accept" not in text:
            wrong.append(text)
        if "[krl.hooks] spindle_on" not in text or "fault of postproc" in text:
            wrong.append(text)
    assert wrong == []
    assert [code for code, _ in shop("HS_START({{ rpm }}, 1)\n", "HS_START")] == [0, 0]


def test_a_template_that_leaves_its_event_out_is_named(shop):
    for code, text in shop("$OUT[7]=TRUE\n"):
        assert code == 1
        assert (
            "shop/spindle_on.j2:1: error EMT336: the template of spindle_on does not call" in text
        )


def test_templates_that_are_no_krl_are_found_without_a_part(shop):
    for template, said in (
        ("INIT LIN X\n", "EMT333"), ("PTP {A1 0}\n", "EMT333"), ("{{ nothing }}\n", "EMT331"),
    ):  # fmt: skip
        told = [text for _, text in shop(template)]
        assert all(f"shop/spindle_on.j2:1: error {said}" in text for text in told), told
        assert not any("/shop/" in text for text in told), "named from where the user stands"
    assert [code for code, _ in shop("{{ hooks.spindle_on }}({{ rpm }})\n")] == [0, 0]
