"""``postproc sample``: the measuring plan for joint stiffness."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from postproc.cli.common import (
    CELL,
    NUMBER,
    TOOL,
    NumberRange,
    Session,
    answer,
    option,
    read_cam,
    reading,
    reading_options,
    standard_options,
)

EPILOG = """\b
Examples:
  postproc sample --cell cell.toml --box 1500 -600 500 2100 600 1100 --grid 150 -o measure
  postproc sample --cell cell.toml --box 1500 -600 500 2100 600 1100 --grid 150 -o measure \\
      --method optimal --count 64 --load-kg 50 --force 0 300 0
  postproc sample --cell cell.toml --box 1500 -600 500 2100 600 1100 --for-diagnosis -o measure
  postproc sample --cell cell.toml --box 1500 -600 500 2100 600 1100 --for part.cls -o measure
"""


def _angles(context: click.Context, parameter: click.Parameter, text: str) -> list[float]:
    return [NUMBER.convert(word, parameter, context) for word in text.split(",")]


@click.command(epilog=EPILOG)
@CELL
@TOOL
@option(
    "--box",
    required=True,
    nargs=6,
    kind=NUMBER,
    metavar="X0 Y0 Z0 X1 Y1 Z1",
    help="Lowest and highest corner of the measured space, robot root frame [mm].",
)
@option("--grid", kind=NUMBER, default=150.0, help="Edge of a cell [mm].")
@option("-o", "--output", required=True, metavar="DIR", help="Folder of the plan.")
@option("--name", default="sample", help="Name of the files.")
@option(
    "--method",
    kind=("grid", "optimal"),
    default="grid",
    help="Every posture of the grid, or the --count most informative ones.",
)
@option(
    "--model",
    kind=("constant", "grid", "continuous"),
    default="continuous",
    help="Model that --method optimal plans for.",
)
@option("--count", kind=click.IntRange(3, 5000), default=64, help="Postures.")
@option(
    "--for-diagnosis",
    is_flag=True,
    help="Plan --count postures for diagnose instead, and say what they can show.",
)
@option(
    "--for",
    "part",
    metavar="INPUT",
    help="CAM file of the job that it is for: as --for-diagnosis, little is left at its tags.",
)
@option(
    "--axis",
    kind=("x", "y", "z"),
    default="y",
    help="Axis of the tool frame about which the postures turn.",
)
@option(
    "--angles",
    default="-10,0,10",
    metavar="DEG,DEG,...",
    callback=_angles,
    help="Angles of the postures.",
)
@option(
    "--orientation",
    nargs=3,
    kind=NUMBER,
    metavar="A B C",
    help="Tool orientation at angle 0 [deg]; default: the axis-parallel one that reaches most.",
)
@option("--load-kg", kind=NUMBER, help="Weight to hang on [kg]; default 50 without --force.")
@option(
    "--load-at",
    nargs=3,
    kind=NUMBER,
    metavar="X Y Z",
    help="Centre of gravity of that weight in the flange [mm]; default: the tool point.",
)
@option(
    "--force",
    nargs=3,
    kind=NUMBER,
    multiple=True,
    metavar="FX FY FZ",
    help="Further load: force at the tool point, axes of the robot root [N]; may be repeated.",
)
@option("--wait", kind=NumberRange(0.0, 3600.0), default=5.0, help="Wait at a posture [s].")
@option("--halt", is_flag=True, help="Wait for the operator at each posture instead.")
@option("--speed", kind=NumberRange(1.0, 100.0), default=30.0, help="Axis speed [%].")
@reading_options
@standard_options
def command(session: Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Plan the measurement of joint stiffness over a box by space gridding.

    Writes NAME.csv to fill in with the measured points, NAME.src and NAME.dat that drive the robot
    through all postures without and with each load, and NAME.html that shows cells and tags.
    Postures that the arm cannot take or that collide are left out and named.

    With --for-diagnosis: postures spread over box and wrist, each reached from a side of its own,
    three of them read five times; the smallest size of each effect that will be seen in nine of
    ten campaigns, the pairs that will stay one set, and what a model of the readings will miss at
    fresh poses. Unloaded but for --load-kg and --force. With --for the postures are chosen so that
    it misses little where the arm drives in that job, and says how much.
    """
    from postproc.cell import load_cell
    from postproc.jobs.measuring_plan import sample

    names = {"box": "box_mm", "grid": "grid_mm", "angles": "angles_deg", "load_at": "load_at_mm",
             "orientation": "orientation_deg", "force": "forces_N", "wait": "wait_s",
             "speed": "speed_percent"}  # fmt: skip
    own = options.keys() - {"cell", "output", *reading(options)}
    asked = {names.get(name, name): options[name] for name in own}
    cell = load_cell(options["cell"])
    if options["part"]:
        asked["part"] = read_cam(options["part"], options, cell)
    folder = Path(options["output"])
    with session.progress() as progress:
        plan = sample(cell, **asked, progress=progress)
    plan.write(folder)
    session.document(plan.document)
    show = _diagnosis_summary if "promise" in plan.document else _summary
    show(session, plan.document, folder / f"{options['name']}.csv")
    return answer(good=True)


def _diagnosis_summary(session: Session, content: dict[str, Any], file: Path) -> None:
    session.show(f"plan     {file}")
    session.show(f"postures {content['postures']}, readings {content['readings']}")
    promise = content["promise"]
    left = {"at fresh poses": promise["rms_left_mm"], "at the job": promise["at_the_job_mm"]}
    for where, size in left.items():
        if size is not None:
            session.show(f"leaves   {size:.3f} mm {where}")
    if content["left_out"]:
        session.say(f"{len(content['left_out'])} tags of the job cannot be driven to")
    for told in content["effects"]:
        size = told["smallest_mm"]
        seen = "not shown" if size is None else f"seen from {size:.3f} mm"
        session.show(f"{told['name']:<22} {seen} (usual {told['usual_mm']:.3f})")
    for pair in content["cannot_separate"]:
        session.say(f"{' and '.join(pair['effects'])} of usual size cannot be told apart")


def _summary(session: Session, content: dict[str, Any], file: Path) -> None:
    session.show(f"plan     {file}")
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
