"""One assignment of any system variable, anywhere in a good program, is noticed.

None may be the same for ``diff`` and good for ``verify``, but those that the table calls harmless
and those that change nothing: the value that is in force already.
"""

from itertools import cycle
from pathlib import Path

import pytest

from postproc.cell import load_cell
from postproc.comparison import diff_files
from postproc.errors import PostprocError
from postproc.krl import Effect, parse_files, system_variables
from postproc.verification import verify

FIXTURES = Path(__file__).parents[2] / "fixtures"
VALUES = {
    "FRAME": ("{X 1,Y 2,Z 3,A 0,B 0,C 0}", ".Z", ".A"),
    "E6POS": ("{X 1,Y 2,Z 3,A 0,B 0,C 0}", ".Z"),
    "E6AXIS": ("{A1 1,A2 -90,A3 90,A4 0,A5 45,A6 0}", ".A2"),
    "LOAD": ("{M 5,CM {X 0,Y 0,Z 9,A 0,B 0,C 0},J {X 0,Y 0,Z 0}}", ".M", ".CM.Z"),
    "BOOL": ("TRUE",),
}
MANY = 9
"""One of so many of the variables whose names are all that is known is put in."""


def assignments():
    """Yield one or more assignments for each variable, none of a value that is in force."""
    table = list(system_variables().values())
    few = [v for v in table if v.source == "D"][::MANY]
    for variable in [v for v in table if v.source != "D"] + few:
        name = variable.name if variable.size is None else f"{variable.name}[1]"
        if variable.effect is Effect.HARMLESS:
            continue
        if variable.constants:
            others = sorted(variable.constants - {variable.initial})
            yield from (f"{name}=#{value}" for value in others)
        elif variable.type in VALUES:
            whole, *parts = VALUES[variable.type]
            yield f"{name}={whole}"
            yield from (f"{name}{part}={name}{part}+1" for part in parts)
        else:
            low = variable.least or 0.0
            yield f"{name}={low + 0.37 * ((variable.most or 50.0) - low):g}"
    yield from ("$NO_SUCH=1", "$NONE[2].PART=#ON", '$TEXT[]="x"', "BAS(#EX_BASE,1)", "BAS(#WHAT,1)")
    yield from ("BAS(#ACC_CP,37)", "BAS(#ACC_PTP,37)", "BAS(#VEL_PTP,37)", "BAS(#VEL_CP,0.037)")


@pytest.mark.slow
@pytest.mark.parametrize(("folder", "name"), [("trim_5axis", "trim"), ("rail_milling", "")])
def test_no_assignment_is_same_and_good(folder, name):
    cell = load_cell(FIXTURES / folder / "cell.toml")
    files = {p.name: p.read_bytes() for p in sorted((FIXTURES / folder / "expected").glob("*.*"))}
    files = {key: data for key, data in files.items() if key.endswith((".src", ".dat"))}
    name = name or next(key[:-4] for key in files if key.endswith(".src"))
    lines = files[f"{name}.src"].decode("ascii").split("\r\n")
    begin = next(i for i, line in enumerate(lines) if "INITMOV" in line)
    end = max(i for i, line in enumerate(lines) if line == "END")
    passed = []
    for line, at in zip(assignments(), cycle(range(begin, end + 1, 7)), strict=False):
        text = "\r\n".join([*lines[:at], line, *lines[at:]])
        changed = {**files, f"{name}.src": text.encode("ascii")}
        try:
            if not diff_files(files, changed, name).same:
                continue
            if verify(parse_files(changed), name, cell, collisions=False).violations:
                continue
        except PostprocError:
            continue
        passed.append(f"{line} in line {at + 1}, before {lines[at][:30]}")
    assert passed == []
