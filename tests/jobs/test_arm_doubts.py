"""What speaks against the arm or its load is told with every program, not by ``check`` alone."""

import pytest

from postproc.cell import parse_cell
from postproc.errors import Severity
from postproc.jobs.check_cell import check_cell
from postproc.jobs.convert import ConvertRequest, convert
from tests.cells import cell_text
from tests.samples import path_of

SPEEDS = "speed_deg_s = [90, 90, 90, 90, 90, 120]\n"
CASES = [
    ("CEL140", "kuka_kr500_l420_2", SPEEDS, "", "above or below axis 3"),
    ("CEL103", "kuka_kr500_r2830", "", "mass_kg = 620\n", "620 kg, the robot carries 500 kg"),
]


@pytest.mark.parametrize(("code", "model", "robot", "tool", "words"), CASES)
def test_a_doubt_is_a_warning_of_convert(tmp_path, code, model, robot, tool, words):
    text = cell_text(origin=(1900, 0, 700))
    assert 'model = "kuka_kr500_r2830"\n' in text
    path = tmp_path / "cell.toml"
    for asked in (False, True):
        made = text
        if asked:
            made = text.replace('model = "kuka_kr500_r2830"\n', f'model = "{model}"\n{robot}')
            made = made.replace("[tool]\n", f"[tool]\n{tool}")
        path.write_text(made)
        cell = parse_cell(made.encode(), path)
        job = convert(ConvertRequest("a", "b"), toolpath=path_of([(0, 0, 0)]), cell=cell)
        assert job.files
        found = [finding for finding in job.findings if finding.code == code]
        assert len(found) == asked
        assert code in {f.code for f in check_cell(cell).findings} or not asked
        for finding in found:
            assert finding.severity is Severity.WARNING
            assert words in finding.message
            line = (tool or "[robot]\n").strip()
            assert made.splitlines()[finding.source.line - 1] == line
