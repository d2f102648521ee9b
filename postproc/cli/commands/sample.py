"""``postproc sample``: the measuring plan for joint stiffness."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from postproc.cli import common as cli


def _angles(context: click.Context, parameter: click.Parameter, text: str) -> list[float]:
    return [cli.NUMBER.convert(word, parameter, context) for word in text.split(",")]


@cli.command("""
  postproc sample --cell cell.toml --box 1500 -600 500 2100 600 1100 --grid 150 -o measure
  postproc sample --cell cell.toml --box 1500 -600 500 2100 600 1100 --grid 150 -o measure \\
      --method optimal --count 64 --load-kg 50 --force 0 300 0
  postproc sample --cell cell.toml --box 1500 -600 500 2100 600 1100 --for-diagnosis -o measure
  postproc sample --cell cell.toml --box 1500 -600 500 2100 600 1100 --for part.cls -o measure
""")
@cli.CELL
@cli.TOOL
@cli.option(
    "--box X0 Y0 Z0 X1 Y1 Z1",
    "Lowest and highest corner of the measured space, robot root frame [mm].",
    cli.NUMBER,
    required=True,
)
@cli.option("--grid", "Edge of a cell [mm].", cli.NUMBER, default=150.0)
@cli.option("-o, --output DIR", "Folder of the plan.", required=True)
@cli.option("--name TEXT", "Name of the files.", default="sample")
@cli.option(
    "--method",
    "Every posture of the grid, or the --count most informative ones.",
    ("grid", "optimal"),
    default="grid",
)
@cli.option(
    "--model",
    "Model that --method optimal plans for.",
    ("constant", "grid", "continuous"),
    default="continuous",
)
@cli.option("--count", "Postures.", click.IntRange(3, 5000), default=64)
@cli.option(
    "--for-diagnosis", "Plan --count postures for diagnose instead, and say what they can show."
)
@cli.option(
    "--for INPUT",
    "CAM file of the job that it is for: as --for-diagnosis, little is left at its tags.",
)
@cli.option(
    "--axis", "Axis of the tool frame about which the postures turn.", ("x", "y", "z"), default="y"
)
@cli.option("--angles DEG,DEG,...", "Angles of the postures.", default="-10,0,10", callback=_angles)
@cli.option(
    "--orientation A B C",
    "Tool orientation at angle 0 [deg]; default: the axis-parallel one that reaches most.",
    cli.NUMBER,
)
@cli.option("--load-kg", "Weight to hang on [kg]; default 50 without --force.", cli.NUMBER)
@cli.option(
    "--load-at X Y Z",
    "Centre of gravity of that weight in the flange [mm]; default: the tool point.",
    cli.NUMBER,
)
@cli.option(
    "--force FX FY FZ",
    "Further load: force at the tool point, axes of the robot root [N]; may be repeated.",
    cli.NUMBER,
    multiple=True,
)
@cli.option("--wait", "Wait at a posture [s].", cli.NumberRange(0.0, 3600.0), default=5.0)
@cli.option("--halt", "Wait for the operator at each posture instead.")
@cli.option("--speed", "Axis speed [%].", cli.NumberRange(1.0, 100.0), default=30.0)
@cli.reading_options
def command(session: cli.Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
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
             "speed": "speed_percent", "for": "part"}  # fmt: skip
    own = options.keys() - {"cell", "output", *cli.reading(options)}
    asked = {names.get(name, name): options[name] for name in own}
    cell = load_cell(options["cell"])
    if options["for"]:
        asked["part"] = cli.read_cam(options["for"], options, cell)
    folder = Path(options["output"])
    with session.progress() as progress:
        plan = sample(cell, **asked, progress=progress)
    plan.write(folder)
    session.document(plan.document)
    show = _diagnosis_summary if "promise" in plan.document else _summary
    show(session, plan.document, folder / f"{options['name']}.csv")
    return cli.answer(good=True)


def _diagnosis_summary(session: cli.Session, content: dict[str, Any], file: Path) -> None:
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


def _summary(session: cli.Session, content: dict[str, Any], file: Path) -> None:
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
