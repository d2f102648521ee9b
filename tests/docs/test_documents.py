"""Every JSON document that a command prints or writes is the one that its schema describes.

Here a schema is closed: a key that it does not describe is an error, so that a new key gets its
line in the reference.
"""

import json
import re

import jsonschema
import pytest

from postproc.cli import app
from tests.places import FIXTURES, ROOT

SCHEMAS = {
    schema["title"]: schema
    for schema in (
        json.loads(path.read_text(encoding="utf-8"))
        for path in sorted((ROOT / "docs" / "schemas").glob("*.json"))
    )
}
TRIM, CELL = str(FIXTURES / "trim_5axis" / "trim.cls"), str(FIXTURES / "trim_5axis" / "cell.toml")
RAIL = str(FIXTURES / "rail_panel" / "panel.csv")
DRIFT = FIXTURES / "drift_campaign"
ROWS, ARM = str(DRIFT / "measured.csv"), str(DRIFT / "cell.toml")
DATUM = str(FIXTURES / "measuring_plan" / "datum.csv")
LOG = str(ROOT / "tests" / "trace" / "data" / "log.csv")
EXPECTED = str(FIXTURES / "trim_5axis" / "expected")
BOX = ["--box", "1400", "-200", "900", "1700", "200", "1200", "--grid", "200"]
NEAR = ["--box", "1750", "-150", "800", "1800", "-100", "850"]
CALLS = {
    "convert": ["convert", TRIM, "--cell", CELL, "-o", "out"],
    "convert failing": ["convert", RAIL, "--cell", CELL, "-o", "out"],
    "verify": ["verify", f"{EXPECTED}/trim.src", "--cell", CELL, "--against", TRIM],
    "verify failing": ["verify", f"{EXPECTED}/trim.src", "--cell", ARM, "--against", TRIM],
    "inspect": ["inspect", TRIM],
    "inspect holes": ["inspect", str(FIXTURES / "peck_cycles" / "holes.clsf")],
    "lint": ["lint", EXPECTED],
    "diff": ["diff", EXPECTED, str(FIXTURES / "olp_task" / "expected")],
    "check": ["check", CELL],
    "check rail": ["check", str(FIXTURES / "rail_panel" / "cell.toml")],
    "robots": ["robots"],
    "robot": ["robots", "kuka_kr500_r2830"],
    "plugins": ["plugins"],
    "explain": ["explain"],
    "explain one": ["explain", "APT010"],
    "stiffness": ["stiffness", TRIM, "--cell", CELL, "--most", "2"],
    "sample": ["sample", "--cell", ARM, *BOX, "-o", "plan"],
    "sample for diagnosis": [
        *("sample", "--cell", ARM, *BOX, "-o", "campaign", "--for-diagnosis", "--count", "20")
    ],
    "diagnose": ["diagnose", ROWS, "--cell", ARM],
    "diagnose trace": ["diagnose", "--trace", LOG, "--cell", ARM],
    "identify": ["identify", ROWS, "--cell", ARM, "-o", "model.toml", "--method", "constant"],
    "predict": ["predict", ROWS, "--cell", ARM, "-o", "expected.csv"],
    "batch": ["batch", TRIM, "--cell", CELL, "-o", "batch", "--jobs", "1"],
    "batch check": ["batch", TRIM, "--cell", CELL, "-o", "batch", "--check", "--jobs", "1"],
    "place": ["place", TRIM, "--cell", CELL, *NEAR],
    "fit-base": ["fit-base", DATUM, "--cell", CELL, "--job", TRIM],
    "error": ["inspect", "nobody.apt"],
    "new-cell": ["new-cell", "-o", "new.toml", "--robot", "kuka_kr500_r2830"],
}


def closed(schema):
    """Return a schema that takes no key which it does not describe."""
    if isinstance(schema, list):
        return [closed(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    result = {key: closed(value) for key, value in schema.items()}
    if isinstance(result.get("properties"), dict) and "additionalProperties" not in result:
        result["additionalProperties"] = False
    return result


def faults(document):
    check = jsonschema.Draft202012Validator(closed(SCHEMAS[document["schema"]]))
    return [f"{list(fault.path)}: {fault.message[:300]}" for fault in check.iter_errors(document)]


@pytest.fixture(scope="module")
def documents(tmp_path_factory):
    """Return a function: the document of a call, each made once, in the order that is asked."""
    folder = tmp_path_factory.mktemp("documents")
    made = {}

    def document(name, capsys, monkeypatch):
        if name == "batch check":
            document("batch", capsys, monkeypatch)
        if name not in made:
            monkeypatch.chdir(folder)
            capsys.readouterr()
            app.run([*CALLS[name], "--json", "--quiet"])
            made[name] = json.loads(capsys.readouterr().out)
        return made[name]

    document.folder = folder
    return document


@pytest.mark.parametrize("name", CALLS)
def test_it_is_as_described(name, documents, capsys, monkeypatch):
    assert faults(documents(name, capsys, monkeypatch)) == []


def test_the_manifest_is_as_described(documents, capsys, monkeypatch):
    documents("batch", capsys, monkeypatch)
    text = (documents.folder / "batch" / "manifest.json").read_text(encoding="utf-8")
    assert faults(json.loads(text)) == []


def test_a_path_is_as_described(tmp_path):
    app.run([*CALLS["verify"], "--quiet", "--path", str(tmp_path / "path.json")])
    assert faults(json.loads((tmp_path / "path.json").read_text(encoding="utf-8"))) == []


def test_every_schema_is_valid_and_met(documents, capsys, monkeypatch):
    met = {documents(name, capsys, monkeypatch)["schema"] for name in CALLS}
    assert met | {"postproc.manifest/1", "postproc.path/1", "postproc.ui/1"} == set(SCHEMAS)
    for schema in SCHEMAS.values():
        jsonschema.Draft202012Validator.check_schema(schema)


def test_an_undescribed_key_and_a_wrong_type_are_seen(documents, capsys, monkeypatch):
    document = documents("convert", capsys, monkeypatch)
    assert faults({**document, "more": 1})
    assert faults({**document, "tags": "12"})
    assert faults({key: value for key, value in document.items() if key != "tags"})


TRANSLATED = re.compile(
    r"leave (?:it|them|--[a-z]+|[A-Z_]+) away|nobody knows|what it hits|stands? beside"
    r"|claimed by no|as stiff as it can stand|is not seen|somebody|mend it|is to be done",
    re.IGNORECASE,
)
"""What is carried over from another language and has a better word on the shop floor."""


def test_texts_for_users_have_no_translated_phrases():
    files = [ROOT / "README.md", *ROOT.glob("docs/**/*.md"), *ROOT.glob("postproc/codes/*.toml")]
    found = [
        f"{path.name}:{number}: {match[0]}"
        for path in sorted(files)
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if (match := TRANSLATED.search(line))
    ]
    assert found == []
