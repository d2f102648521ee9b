"""What ends up in the folder does not depend on the order in which results come."""

import itertools

from postproc.batch.child import JobResult
from postproc.batch.manifest import Landing, Manifest

FILES = {"a": ["x.src"], "b": ["X.src", "y.src"], "c": ["y.src", "z.src"], "d": ["w.src"]}


def landed(folder, order, owned=None):
    folder.mkdir()
    manifest = Manifest.load(folder)
    landing = Landing(manifest, list(FILES), owned or {})
    for key in order:
        files = {name: key.encode() for name in FILES[key]}
        landing.land(JobResult(key, "ok", key.upper(), files), {"input": key})
    manifest.save()
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_every_order_gives_the_same_folder(tmp_path):
    seen = [landed(tmp_path / "".join(order), order) for order in itertools.permutations(FILES)]
    assert all(folder == seen[0] for folder in seen)
    assert {name: content for name, content in seen[0].items() if name != "manifest.json"} == {
        "x.src": b"a", "w.src": b"d",
    }  # fmt: skip


def test_programs_of_other_inputs_are_not_touched(tmp_path):
    folder = landed(tmp_path / "out", "abcd", {"W.SRC": "other/w.csv"})
    assert "w.src" not in folder


def test_a_renamed_program_does_not_take_its_successor_along(tmp_path):
    manifest = Manifest.load(tmp_path)
    landing = Landing(manifest, ["new", "old"], {})
    landing.land(JobResult("old", "ok", "P", {"P.src": b"old"}), {})
    landing = Landing(manifest, ["new", "old"], {})
    landing.land(JobResult("new", "ok", "P", {"P.src": b"new"}), {})
    landing.land(JobResult("old", "ok", "Q", {"Q.src": b"old"}), {})
    assert (tmp_path / "P.src").read_bytes() == b"new"
    assert (tmp_path / "Q.src").read_bytes() == b"old"
