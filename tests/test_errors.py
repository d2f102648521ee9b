import pickle

from postproc.errors import Finding, PostprocError, ReadError, Severity, SourceRef, fold


def test_an_error_is_one_line_whatever_it_holds():
    error = ReadError("APT012", "no number\nhere\r\n at all", SourceRef("blade.apt", 1482))
    assert str(error) == "blade.apt:1482: error APT012: no number here at all"


def test_errors_cross_process_borders():
    error = ReadError("APT012", "no number", SourceRef("a.apt", 3, "FEDRAT/"), "give one")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is ReadError
    assert (again.code, again.message, again.source, again.hint) == (
        error.code,
        error.message,
        error.source,
        error.hint,
    )
    assert isinstance(again, PostprocError)
    assert isinstance(again, ValueError)


def test_equal_findings_fold_into_the_first():
    one = Finding(Severity.WARNING, "APT020", "unknown word", source=SourceRef("a", 1))
    two = Finding(Severity.WARNING, "APT020", "unknown word", source=SourceRef("a", 9))
    other = Finding(Severity.ERROR, "APT020", "unknown word", source=SourceRef("a", 9))
    folded = fold([one, two, other, two])
    assert [(i.severity, i.count) for i in folded] == [("error", 1), ("warning", 3)]
    assert str(folded[1]) == "a:1: warning APT020: unknown word (3 times)"


def test_errors_come_first_and_equal_findings_are_one_with_a_count():
    same = [Finding(Severity.WARNING, "PLN301", "slow", source=SourceRef("a", n)) for n in (3, 9)]
    error = Finding(Severity.ERROR, "PLN101", "unreachable")
    folded = fold([*same, error])
    assert [(f.code, f.count) for f in folded] == [("PLN101", 1), ("PLN301", 2)]
    assert folded[1].source == SourceRef("a", 3)
