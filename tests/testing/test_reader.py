"""Every reader of the registry keeps the contract, and the contract refuses broken ones.

A reader is held to it on the files of ``tests/readers/data`` that it sniffs best: a new reader
needs at least one there.
"""

from dataclasses import replace
from pathlib import Path

import pytest

from postproc.errors import PluginError, PostprocError, ReadError, SourceRef
from postproc.readers import HEAD_BYTES, READERS, ReadOptions, read
from postproc.testing import check_reader
from postproc.testing.reader import CHECKS

DATA = Path(__file__).resolve().parents[1] / "readers" / "data"
FAR = {"points_far.csv"}
"""Read with a warning: nobody's part is that large."""
AT_MOST = 4


def samples():
    """Return names of readers with a file that each can read without options."""
    found = {name: [] for name, _ in READERS}
    for path in sorted(DATA.iterdir()):
        head = path.read_bytes()[:HEAD_BYTES]
        name = max((reader.sniff(head), name) for name, reader in READERS)[1]
        try:
            read(path)
        except PostprocError:
            continue
        if path.name not in FAR:
            found[name].append(path)
    return [(name, path) for name, paths in found.items() for path in paths[:AT_MOST] or [None]]


SAMPLES = samples()


@pytest.mark.parametrize(("name", "path"), SAMPLES, ids=[f"{n}-{p and p.name}" for n, p in SAMPLES])
@pytest.mark.parametrize("check", CHECKS, ids=lambda c: c.__name__)
def test_contract(check, name, path):
    assert path is not None, f"no file of {DATA} is read by {name}"
    check(READERS.get(name), path, ReadOptions())


def test_all_parts_of_the_registry_load():
    assert not [info for info in READERS.infos() if info.problem]


class Wrapped:
    """The CSV reader with something done to its answers; ``change`` gets the toolpath."""

    def __init__(self, change=None, sniff=None, fail=None):
        self.change, self.how, self.fail = change, sniff, fail
        self.inner = READERS.get("csv")

    def sniff(self, head):
        return self.how(head) if self.how else self.inner.sniff(head)

    def read(self, path, options):
        try:
            toolpath = self.inner.read(path, options)
        except ReadError as error:
            raise (self.fail(error) if self.fail else error) from None
        return self.change(toolpath, path) if self.change else toolpath


def column(name, factor):
    return lambda toolpath, _: replace(toolpath, **{name: getattr(toolpath, name) * factor})


def counting(toolpath, _, calls=[]):  # noqa: B006 - what the reader remembers is what is wrong
    calls.append(1)
    return replace(toolpath, points=toolpath.points + 1e-6 * len(calls))


def touching(toolpath, path):
    Path(path).write_bytes(Path(path).read_bytes() + b"\n")
    return toolpath


def strict(head):
    return 0.9 if "x,y,z" in head.decode("ascii") else 0.0


BROKEN = [
    ("sniffs its own file with 0", Wrapped(sniff=lambda head: 0.0)),
    ("sniffs its own file with 2", Wrapped(sniff=lambda head: 2.0)),
    ("sniffs b'Dear all", Wrapped(sniff=lambda head: 0.7 if head.strip() else 0.0)),
    ("sniffing .* fails: UnicodeDecodeError", Wrapped(sniff=strict)),
    ("not in metres", Wrapped(column("points", 1000.0))),
    ("not in metres per second", Wrapped(column("feed", 60000.0))),
    ("not above zero", Wrapped(column("feed", -1.0))),
    ("no unit vector", Wrapped(column("axes", 2.0))),
    ("a line is not in the file", Wrapped(column("line", 1000))),
    ("operation points beyond", Wrapped(lambda t, _: replace(t, operation=t.line))),
    ("path as it was given", Wrapped(lambda t, p: replace(t, path=Path(p).name))),
    ("units 'furlong'", Wrapped(lambda t, _: replace(t, units="furlong"))),
    ("no MotionKind", Wrapped(lambda t, _: replace(t, kind=t.kind + 77))),
    ("changes the file", Wrapped(touching)),
    ("second time", Wrapped(counting)),
    ("fails with KeyError", Wrapped(fail=lambda error: KeyError(error.code))),
    ("names no place", Wrapped(fail=lambda error: ReadError("X1", "wrong"))),
    ("names no place", Wrapped(fail=lambda error: ReadError("X1", "wrong", SourceRef("else.csv")))),
]  # fmt: skip


@pytest.mark.parametrize(("words", "reader"), BROKEN, ids=[words for words, _ in BROKEN])
def test_a_broken_reader_is_refused(words, reader, tmp_path):
    path = tmp_path / "part.csv"
    path.write_text("id,x,y,z,i,j,k,feed\na,0,0,0,0,0,1,600\nb,150,0,0,0,0,1,600\n")
    check_reader(Wrapped(), path)
    with pytest.raises(PluginError, match=f"PLG004: .*{words}"):
        check_reader(reader, path)


def test_a_part_without_methods_is_no_reader(tmp_path):
    with pytest.raises(PluginError, match="no sniff and no read"):
        check_reader(object(), tmp_path / "none.csv")
