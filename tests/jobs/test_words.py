"""A CAM file that asks for what no program does: convert stops, verify says why, inspect lists."""

import re
from dataclasses import replace

import pytest

import postproc
from postproc.model import WordClass, WordUse
from postproc.process import word_findings
from postproc.readers import read

BODY = [
    "PARTNO/LINE", "UNITS/MM", "LOADTL/1", "SPINDL/9000,RPM,CLW", "RAPID", "GOTO/0,0,50,0,0,1",
    "FEDRAT/600,MMPM", "GOTO/0,0,0", "GOTO/100,0,0", "RAPID", "GOTO/100,0,50", "SPINDL/OFF", "FINI",
]  # fmt: skip
WORDS = [
    (8, "CUTCOM/LEFT"), (9, "MYWORD/1"), (9, "MODE/INCR,ON"), (10, "CUTCOM/LEFT"),
]  # fmt: skip
"""Statements put before a line of ``BODY``, counted from 0."""


def source_in(folder, inserted=(), body=BODY, name="line.apt"):
    """The file, and the 1-based lines of each inserted statement."""
    lines = list(body)
    for at, text in sorted(inserted, reverse=True):
        lines.insert(at, text)
    path = folder / name
    path.write_text("\n".join(lines) + "\n")
    found = {text: [i for i, line in enumerate(lines, 1) if line == text] for _, text in inserted}
    return path, found


def test_convert_stops_with_one_finding_for_each_word(tmp_path, cell, run):
    source, lines = source_in(tmp_path, WORDS)
    out = tmp_path / "out"
    code, document, err = run("convert", source, "--cell", cell, "-o", out, "--json")
    assert (code, document["files"], out.exists()) == (1, [], False)
    found = {item["detail"].split(" ")[0]: item for item in document["failures"]}
    assert sorted(found) == ["CUTCOM", "MODE/INCR", "MYWORD"]
    assert found["CUTCOM"]["line"] == lines["CUTCOM/LEFT"][0]
    assert f"(also in line {lines['CUTCOM/LEFT'][1]})" in found["CUTCOM"]["detail"]
    assert "(tool)" in found["CUTCOM"]["detail"]
    for word, item in found.items():
        assert item["code"] == "WRD001"
        assert f"--accept-words {word}" in item["hint"]
        assert f'accept_words = ["{word}"]' in item["hint"]
    assert f"{source}:{lines['MYWORD/1'][0]}: error WRD001: MYWORD" in err


def test_the_option_of_each_hint_is_what_accepts_the_word(tmp_path, cell, run):
    """What the hints say, put together, makes the program; each alone leaves the others."""
    source, _ = source_in(tmp_path, WORDS)
    _, document, _ = run("convert", source, "--cell", cell, "-o", tmp_path / "a", "--json")
    hints = [item["hint"] for item in document["failures"]]
    words = [re.search(r"--accept-words (\S+?),? ", hint)[1] for hint in hints]
    for word in words:
        call = ("convert", source, "--cell", cell, "-o", tmp_path / "b", "--accept-words", word)
        code, document, _ = run(*call, "--json")
        assert (code, len(document["failures"])) == (1, len(words) - 1)
    call = ("convert", source, "--cell", cell, "-o", tmp_path / "c", "--json")
    code, document, err = run(*call, "--accept-words", ",".join(words))
    assert (code, document["failures"]) == (0, [])
    assert "note WRD003" in err
    program = tmp_path / "c" / "line.src"
    against = ("verify", program, "--cell", cell, "--against", source, "--json")
    assert run(*against, "--accept-words", ",".join(words))[0] == 0
    code, report, _ = run(*against)
    kinds = [item["kind"] for item in report["violations"]]
    assert (code, kinds) == (1, ["word"] * len(words))
    assert {item["file"] for item in report["violations"]} == {str(source)}


def test_what_the_cell_accepts_and_the_call_adds(tmp_path, cell, run):
    source, _ = source_in(tmp_path, WORDS)
    cell.write_text(cell.read_text() + '\n[import]\naccept_words = ["cutcom", "MODE"]\n')
    call = ("convert", source, "--cell", cell, "-o", tmp_path / "out", "--json")
    _, document, _ = run(*call)
    assert [item["detail"].split(" ")[0] for item in document["failures"]] == ["MYWORD"]
    assert run(*call, "--accept-words", "MYWORD")[0] == 0


def test_the_call_wins_over_the_cell(tmp_path, cell, run):
    body = [line for line in BODY if not line.startswith("UNITS")]
    body = [line.replace(",MMPM", "").replace("100,0", "4,0").replace("50", "2") for line in body]
    source, _ = source_in(tmp_path, body=body)
    cell.write_text(cell.read_text() + '\n[import]\nunits = "mm"\n')
    ends = {}
    for name, more in (("mm", ()), ("inch", ("--units", "inch"))):
        out = tmp_path / name
        run("convert", source, "--cell", cell, "-o", out, "--json", *more)
        text = "".join(path.read_text() for path in out.glob("*.src"))
        ends[name] = max(float(x) for x in re.findall(r"LIN \{X (-?[\d.]+)", text))
    assert ends["mm"] == pytest.approx(4.0)
    assert ends["inch"] == pytest.approx(101.6)


def test_inspect_never_stops(tmp_path, run):
    source, lines = source_in(tmp_path, WORDS)
    code, document, _ = run("inspect", source, "--json")
    assert code == 0
    uses = {use["word"]: use for use in document["word_uses"]}
    assert uses["CUTCOM"]["lines"] == lines["CUTCOM/LEFT"]
    assert uses["MYWORD"] == {
        "word": "MYWORD", "class": "unknown", "refused": True, "lines": lines["MYWORD/1"],
        "reason": "is in no table of words",
    }  # fmt: skip
    assert document["unknown_words"]["MYWORD"] == 1


def test_a_second_tool_stops_and_cannot_be_accepted(tmp_path, cell, run):
    source, lines = source_in(tmp_path, [(10, "LOADTL/7,LENGTH,180")])
    text = cell.read_text()
    call = ("convert", source, "--cell", cell, "-o", tmp_path / "out", "--json")
    code, _, err = run(*call)
    assert code == 2, "the one tool claims neither"
    assert "error WRD002: tool 1, called in line 3" in err
    cell.write_text(text.replace('name = "head"\n', 'name = "head"\ncam = ["1"]\n'))
    for more in ((), ("--accept-words", "LOADTL,WRD002")):
        code, document, _ = run(*call, *more)
        (item,) = document["failures"]
        assert (code, document["files"], item["code"]) == (1, [], "WRD002")
        called = lines["LOADTL/7,LENGTH,180"][0]
        assert f"tool 7, called in line {called}" in item["detail"]
        assert item["line"] > called
        assert "--accept-words" not in item["hint"]


def test_one_tool_called_twice_is_one_tool(tmp_path, cell, run):
    source, _ = source_in(tmp_path, [(10, "LOADTL/1")])
    code, document, _ = run("convert", source, "--cell", cell, "-o", tmp_path / "out", "--json")
    assert (code, document["failures"]) == (0, [])


def test_a_list_with_two_tools_stops(tmp_path, cell, run):
    path = tmp_path / "holes.csv"
    path.write_text("x,y,z,i,j,k,depth,tool\n0,0,0,0,0,1,5,3\n40,0,0,0,0,1,5,4\n")
    code, document, _ = run("convert", path, "--cell", cell, "-o", tmp_path / "out", "--json")
    assert (code, document["schema"]) == (2, "postproc.error/1")
    assert document["code"] == "WRD002"


def test_many_lines_are_counted(tmp_path):
    lines = tuple(range(10, 50))
    use = WordUse("CUTCOM", WordClass.TOOL, lines, "is not carried out", True)
    source, _ = source_in(tmp_path)
    toolpath = replace(read(str(source)), word_uses=(use,))
    (finding,) = (item for item in word_findings(toolpath) if item.is_error)
    assert finding.source.line == 10
    assert "lines 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22 and 27 more" in finding.message


def test_from_python(tmp_path, cell):
    source, _ = source_in(tmp_path, WORDS)
    shop = postproc.load_cell(cell)
    refused = postproc.convert(postproc.read(source, shop), shop)
    assert not refused.good
    assert {finding.code for finding in refused.findings if finding.is_error} == {"WRD001"}
    part = postproc.read(source, shop, accept_words=["CUTCOM", "MODE", "MYWORD"])
    assert postproc.convert(part, shop).good


@pytest.mark.usefixtures("batch_here")
def test_sections_of_a_batch_stop_too(tmp_path, cell, run):
    source, _ = source_in(tmp_path, WORDS)
    call = ("batch", source, "--cell", cell, "-o", tmp_path / "out", "--split", "count:2", "--json")
    code, document, _ = run(*call, "--jobs", "1")
    assert code == 1
    errors = [line for entry in document["entries"].values() for line in entry["errors"]]
    errors = [line for line in errors if "BAT015" not in line]
    assert len(errors) == 2 * 3, "three words in each of two sections"
    assert all("WRD001" in line for line in errors)
    assert not list((tmp_path / "out").glob("*.src"))
    assert run(*call, "--jobs", "1", "--accept-words", "CUTCOM,MODE,MYWORD")[0] == 0
