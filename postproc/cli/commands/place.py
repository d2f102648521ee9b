"""``postproc place``: where the part, or the robot, stands best for a job."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from postproc.cli import common as cli


@cli.command("""
  postproc place holes.csv --cell cell.toml --box 1200 -600 300 2400 600 1200 -o cell2.toml
  postproc place part.cls --cell cell.toml --free xyzA --json
""")
@click.argument("source", metavar="INPUT")
@cli.CELL
@cli.option(
    "--box X0 Y0 Z0 X1 Y1 Z1",
    "Where the part origin may be, in the robot root [mm]; of the robot in the world. "
    "Without it: wherever the arm reaches, for a workpiece with a solid.",
    cli.NUMBER,
)
@cli.option(
    "--free",
    "What may change: the position, or also the rotation about the vertical.",
    ("xyz", "xyzA"),
    default="xyz",
)
@cli.option(
    "--move",
    "What is moved: the part with all setups, the robot, or the rail with the robot on it.",
    ("part", "rail", "robot"),
    default="part",
)
@cli.option("-o, --output CELL2.toml", "Write the cell with the place found.")
@cli.option("--report FILE.html", "Write a page that shows how good places are.")
@cli.reading_options
def command(session: cli.Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Find the best place for a job: every tag in reach, then stiff, clear and unwound.

    Fixed solids stay where they are. A place is called good when the full plan there is: what
    convert does. Exit code 1, and no cell, where none is found; the best one of all is told.
    """
    from postproc.cell import load_cell
    from postproc.files import write_files
    from postproc.jobs.place import place

    cell = load_cell(options["cell"])
    toolpath = cli.read_cam(options["source"], options, cell)
    with session.progress() as progress:
        asked = {name: options[name] for name in ("free", "move")}
        job = place(toolpath, cell, options["box"], **asked, progress=progress)
    if options["output"] and job.good:
        write_files({Path(options["output"]): job.cell_file(options["output"])})
    if options["report"]:
        job.report(options["report"])
    content = job.document
    if not job.good:
        session.findings(job.findings)
    session.document(content)
    xyz, abc = (" ".join(f"{v:g}" for v in content["frame"][key]) for key in ("xyz_mm", "abc_deg"))
    searched = content["searched"]
    stiff, clear = content["stiffness_mean_N_per_mm"], content["clearance_mm"]
    told = "" if stiff is None else f", mean stiffness {stiff:.0f} N/mm"
    told += "" if clear is None else f", clearance {clear:.1f} mm"
    session.show(
        f"{options['move']} at X Y Z {xyz} mm, A B C {abc} deg: {content['tags_good']} of "
        f"{content['tags']} tags can be run{told}"
    )
    session.show(
        f"{searched['places']} positions tried, {searched['in_reach']} of them within reach; "
        f"{searched['with_solids']} tried with solids, {searched['plans']} planned in full"
    )
    session.show("good: checked by a full plan" if job.good else "no good position was found")
    return cli.answer(job.good)
