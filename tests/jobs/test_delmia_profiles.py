"""What motion and accuracy profiles of a task ask for is in the program, and held by ``verify``."""

import re

import pytest

from tests.places import FIXTURES

TASK = FIXTURES / "olp_task"
FAST = '<MotionBasis>Percent</MotionBasis><Speed Units="%" Value="50"/>'
SLOW = '<MotionBasis>Absolute</MotionBasis><Speed Units="m/s" Value="0.05"/>'
FAR = (
    "<FlyByMode>On</FlyByMode><AccuracyType>Distance</AccuracyType>"
    '<AccuracyValue Units="mm" Value="2.5"/>'
)
NEAR, OFF = FAR.replace("2.5", "0.1"), FAR.replace(">On<", ">Off<")


@pytest.fixture
def convert(tmp_path, run):
    """Return a function that converts the task, one profile changed; code, errors and program."""

    def make(old="", new=""):
        text = (TASK / "seam.xml").read_text()
        assert old in text
        (tmp_path / "seam.xml").write_text(text.replace(old, new))
        out = tmp_path / "out"
        call = ("convert", tmp_path / "seam.xml", "--cell", TASK / "cell.toml", "-o", out)
        code, _, err = run(*call, "--json")
        program = out / "seam.src"
        return code, err, program.read_text() if program.exists() else ""

    return make


@pytest.mark.parametrize(
    ("old", "new", "kind"), [(FAR, NEAR, "approximation"), (FAR, OFF, "approximation"),
                             (FAST, FAST.replace("50", "5"), "speed")],
)  # fmt: skip
def test_a_program_of_another_profile_is_not_good(convert, run, tmp_path, old, new, kind):
    """It was made for a wider fly-by or a higher speed than the file has."""
    code, err, before = convert()
    assert code == 0, err
    code, err, after = convert(old, new)
    assert code == 0, err
    widest = max([float(v) for v in re.findall(r"APO\.CDIS=([\d.]+)", after)], default=0.0)
    if new is NEAR:
        assert 0.0 < widest <= 0.1
    elif new is OFF:
        assert "C_DIS" not in after
    else:
        assert re.findall(r"VEL_PTP,(\d+)", before) == ["50"]
        assert "5" in re.findall(r"VEL_PTP,(\d+)", after)
    (tmp_path / "out" / "seam.src").write_text(before)
    data = (TASK / "expected" / "seam.dat").read_bytes()
    (tmp_path / "out" / "seam.dat").write_bytes(data)
    verify = ("verify", tmp_path / "out" / "seam.src", "--cell", TASK / "cell.toml", "--json")
    code, report, _ = run(*verify, "--against", tmp_path / "seam.xml")
    assert (code, {v["kind"] for v in report["violations"]}) == (1, {kind})


def test_a_speed_in_any_unit_is_the_speed(convert):
    code, err, program = convert(SLOW, SLOW.replace("m/s", "mm/min").replace("0.05", "3000"))
    assert code == 0, err
    assert program == convert()[2]


@pytest.mark.parametrize(
    ("new", "word"),
    [
        (
            '<MotionBasis>Time</MotionBasis><Speed Units="s" Value="3"/>',
            "error WRD001: MotionBasis/Time",
        ),
        (SLOW.replace("m/s", "knots"), "error DEL"),
        (SLOW.replace("0.05", "-1"), "error DEL004"),
        (FAST.replace("50", "130"), "error DEL004"),
    ],
)
def test_what_no_program_can_keep_to_is_refused(convert, new, word):
    code, err, program = convert(SLOW, new)
    assert code in (1, 2)
    assert word in err
    assert not program
