"""``postproc sample``: the measuring plan for joint stiffness."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from postproc.cli.common import (
    NUMBER,
    NumberRange,
    Session,
    answer,
    standard_options,
    tool_option,
)

EPILOG = """\b
Examples:
  postproc sample --cell cell.toml --box 1500 -600 500 2100 600 1100 --grid 150 -o measure
  postproc sample --cell cell.toml --box 1500 -600 500 2100 600 1100 --grid 150 -o measure \\
      --method optimal --count 64 --load-kg 50 --force 0 300 0
  postproc sample --cell cell.toml --box 1500 -600 500 2100 600 1100 --for-diagnosis -o measure
"""


@click.command(epilog=EPILOG)
@click.option("--cell", required=True, metavar="CELL.toml", help="The robot cell.")
@tool_option
@click.option(
    "--box",
    required=True,
    nargs=6,
    type=NUMBER,
    metavar="X0 Y0 Z0 X1 Y1 Z1",
    help="Lowest and highest corner of the measured space, robot root frame [mm].",
)
@click.option("--grid", type=NUMBER, default=150.0, show_default=True, help="Edge of a cell [mm].")
@click.option("-o", "--output", required=True, metavar="DIR", help="Folder of the plan.")
@click.option("--name", default="sample", show_default=True, help="Name of the files.")
@click.option(
    "--method",
    type=click.Choice(["grid", "optimal"]),
    default="grid",
    show_default=True,
    help="Every posture of the grid, or the --count most telling of them.",
)
@click.option(
    "--model",
    type=click.Choice(["constant", "grid", "continuous"]),
    default="continuous",
    show_default=True,
    help="What --method optimal is to tell.",
)
@click.option(
    "--count", type=click.IntRange(3, 5000), default=64, show_default=True, help="Postures."
)
@click.option(
    "--for-diagnosis",
    is_flag=True,
    help="Plan --count postures for diagnose instead, and say what they will tell.",
)
@click.option(
    "--axis",
    type=click.Choice(["x", "y", "z"]),
    default="y",
    show_default=True,
    help="Axis of the tool frame about which the postures turn.",
)
@click.option(
    "--angles",
    default="-10,0,10",
    show_default=True,
    metavar="DEG,DEG,...",
    help="Angles of the postures.",
)
@click.option(
    "--orientation",
    nargs=3,
    type=NUMBER,
    default=None,
    metavar="A B C",
    help="Tool orientation at angle 0 [deg]; default: the axis-parallel one that reaches most.",
)
@click.option(
    "--load-kg",
    type=NUMBER,
    default=None,
    help="Weight to hang on [kg]; default 50 without --force.",
)
@click.option(
    "--load-at",
    nargs=3,
    type=NUMBER,
    default=None,
    metavar="X Y Z",
    help="Centre of gravity of that weight in the flange [mm]; default: the tool point.",
)
@click.option(
    "--force",
    nargs=3,
    type=NUMBER,
    multiple=True,
    metavar="FX FY FZ",
    help="Further load: force at the tool point, axes of the robot root [N]; may be repeated.",
)
@click.option(
    "--wait",
    type=NumberRange(0.0, 3600.0),
    default=5.0,
    show_default=True,
    help="Wait at a posture [s].",
)
@click.option("--halt", is_flag=True, help="Wait for the operator at each posture instead.")
@click.option(
    "--speed",
    type=NumberRange(1.0, 100.0),
    default=30.0,
    show_default=True,
    help="Axis speed [%].",
)
@standard_options
def command(session: Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Plan the measurement of joint stiffness over a box by space gridding.

    Writes NAME.csv to fill in with the measured points, NAME.src and NAME.dat that drive the robot
    through all postures without and with each load, and NAME.html that shows cells and tags.
    Postures that the arm cannot take or that collide are left out and named.

    With --for-diagnosis: postures spread over box and wrist, each reached from a side of its own,
    three of them read five times; the smallest size of each effect that will be seen in nine of
    ten campaigns, and the pairs that will stay one set. Unloaded but for --load-kg and --force.
    """
    from postproc.cell import load_cell
    from postproc.files import write_files
    from postproc.jobs.drawing import drawing_of
    from postproc.jobs.sample import program_files, sample
    from postproc.report.pages.sample import sample_page
    from postproc.stiffness.sample import csv_text, sample_document

    cell = load_cell(options["cell"]).for_tool(options["tool"])
    if options["for_diagnosis"]:
        return _for_diagnosis(session, cell, options)
    with session.progress() as progress:
        sampling = sample(cell, _request(options), progress)
    files = dict(program_files(sampling))
    files[f"{options['name']}.csv"] = csv_text(sampling)
    files[f"{options['name']}.html"] = sample_page(sampling, drawing_of(sampling.cell))
    folder = Path(options["output"])
    write_files({folder / name: content for name, content in files.items()})
    content = sample_document(sampling, sorted(files))
    session.document(content)
    _summary(session, content, folder)
    return answer(good=True)


def _for_diagnosis(session: Session, cell: Any, options: dict[str, Any]) -> int:  # noqa: ANN401
    from postproc.files import write_files
    from postproc.jobs.drawing import drawing_of
    from postproc.jobs.sample_diagnosis import diagnosis_plan_document, files, plan_diagnosis
    from postproc.report.pages.diagnosis_plan import diagnosis_plan_page

    with session.progress() as progress:
        plan = plan_diagnosis(cell, _request(options), progress)
    folder, made = Path(options["output"]), files(plan)
    page = f"{options['name']}.html"
    content = diagnosis_plan_document(plan, sorted([*made, page]))
    names = [plan.name(reading) for reading in range(len(plan.q))]
    made[page] = diagnosis_plan_page(content, names, plan.q, plan.points, drawing_of(cell))
    write_files({folder / name: text for name, text in made.items()})
    session.document(content)
    session.show(f"plan     {folder / (options['name'] + '.csv')}")
    session.show(f"postures {content['postures']}, readings {content['readings']}")
    for told in content["effects"]:
        size = told["smallest_mm"]
        seen = "not shown" if size is None else f"seen from {size:.3f} mm"
        session.show(f"{told['name']:<22} {seen} (usual {told['usual_mm']:.3f})")
    for pair in content["cannot_separate"]:
        session.say(f"{' and '.join(pair['effects'])} of usual size will stay one set")
    return answer(good=True)


def _request(options: dict[str, Any]) -> Any:  # noqa: ANN401 - imported lazily
    import numpy as np

    from postproc.errors import StiffnessError
    from postproc.geometry import rotation_from_abc
    from postproc.stiffness.sample import SampleRequest, SamplingRules, box_grid
    from postproc.units import DEG, MM, PERCENT

    try:
        angles = [NUMBER.convert(text, None, None) for text in options["angles"].split(",")]
    except click.BadParameter:
        raise StiffnessError(
            "STF025", f"--angles {options['angles']!r}, expected numbers with commas between"
        ) from None
    box = np.array(options["box"]) * MM
    abc = options["orientation"]
    rules = SamplingRules(
        axis=np.eye(3)["xyz".index(options["axis"])],
        angles=np.array(angles) * DEG,
        R_robroot_tcp=None if abc is None else rotation_from_abc(np.array(abc) * DEG),
    )
    return SampleRequest(
        grid=box_grid(box[:3], box[3:], options["grid"] * MM),
        rules=rules,
        loads=_loads(options),
        name=options["name"],
        method=options["method"],
        model=options["model"],
        count=options["count"],
        wait=options["wait"],
        halt=options["halt"],
        speed=options["speed"] * PERCENT,
    )


def _loads(options: dict[str, Any]) -> tuple[Any, ...]:
    import numpy as np

    from postproc.stiffness.sample import Load
    from postproc.units import MM

    mass = options["load_kg"]
    if mass is None and not options["force"] and not options["for_diagnosis"]:
        mass = 50.0
    loads = []
    if mass:
        at = options["load_at"]
        loads.append(Load(f"{mass:g}kg", mass, None if at is None else np.array(at) * MM))
    for number, force in enumerate(options["force"], start=1):
        loads.append(Load(f"force{number}", force=np.array(force)))
    return tuple(loads)


def _summary(session: Session, content: dict[str, Any], folder: Path) -> None:
    session.show(f"plan     {folder / content['files'][0]}")
    session.show(
        f"cells    {content['cells']}, tags {content['tags_used']} of {content['tags']}, "
        f"postures {content['postures']}, readings {content['readings']}"
    )
    if content["dropped"]:
        session.say(f"{len(content['dropped'])} postures are left out, see the page")
    for joint in content["joints"]:
        if joint["status"] != "good":
            shown = f"; shown by {joint['shown_by']}" if joint["shown_by"] else ""
            session.say(f"A{joint['joint']} will be {joint['status']}{shown}")
