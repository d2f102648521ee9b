"""What a person reads of many findings: errors first, none hidden behind warnings."""

from postproc.cli.common import Session
from postproc.errors import Finding, Severity, SourceRef


def test_an_error_is_printed_before_a_thousand_warnings(capsys):
    many = [
        Finding(Severity.WARNING, "PLN301", f"feed {n}", source=SourceRef("a.cls", n))
        for n in range(1, 1001)
    ]
    error = Finding(Severity.ERROR, "PLN101", "out of reach", source=SourceRef("a.cls", 7))
    Session(json=False, quiet=False).findings([*many, error])
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "a.cls:7: error PLN101: out of reach"
    assert lines[1:4] == [f"a.cls:{n}: warning PLN301: feed {n}" for n in (1, 2, 3)]
    assert lines[4:] == ["... and 997 more of PLN301 (lines 4-1000)"]


def test_findings_without_a_line_are_counted_only(capsys):
    many = [Finding(Severity.NOTE, "CNV010", f"name {n}") for n in range(5)]
    Session(json=False, quiet=False).findings(many)
    assert capsys.readouterr().err.splitlines()[-1] == "... and 2 more of CNV010"
