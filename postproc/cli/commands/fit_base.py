"""``postproc fit-base``: the base of a part from datum points measured on its fixture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from postproc.cli import common as cli


@cli.command("""
  postproc fit-base points.csv --cell cell.toml
  postproc fit-base points.csv --cell cell.toml --job holes.csv -o cell2.toml
""")
@click.argument("points", metavar="POINTS.csv")
@cli.CELL
@cli.option("--base N", "BASE number, in a cell with several.", int)
@cli.option("--job INPUT", "CAM file: uncertainty of its holes.")
@cli.option("-o, --output CELL2.toml", "Write the cell with the fitted base.")
@cli.reading_options
def command(session: cli.Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Fit the base to datum points: nominal on the part, measured in the robot root.

    Columns id, x_mm, y_mm, z_mm (nominal, in the base), mx_mm, my_mm, mz_mm (measured) and, where
    it is known, sigma_mm. Points that the others refute are named and left out. Prints BASE_DATA
    for $config.dat. Exit code 1, and no cell, if the points contradict each other.
    """
    from postproc.cell import load_cell
    from postproc.files import write_files
    from postproc.jobs.fit_base import fit_base

    cell = load_cell(options["cell"])
    toolpath = cli.read_cam(options["job"], options, cell) if options["job"] else None
    job = fit_base(options["points"], cell, base=options["base"], part=toolpath)
    content = job.document
    if options["output"] and job.good:
        write_files({Path(options["output"]): job.cell_file(options["output"])})
    if job.points.ignored:
        session.say(f"columns not used for a base: {', '.join(job.points.ignored)}")
    session.findings(job.findings)
    session.document(content)
    rows = [
        (point["id"], *(f"{v:+.3f}" for v in point["residual_mm"]), f"{point['u95_mm']:.3f}",
         "" if point["counts"] else "left out")
        for point in content["points"]
    ]  # fmt: skip
    session.table(("point", "dx mm", "dy mm", "dz mm", "u95 mm", ""), rows)
    at_holes = content["u95_holes_mm"]
    holes = "" if at_holes is None else f", at the job within {at_holes:.3f} mm"
    session.show(
        f"residuals {content['rms_mm']:.3f} mm (rms); the base is known to within "
        f"{content['u95_mm']:.3f} mm (95 %){holes}; moved by {content['moved']['mm']:.3f} mm, "
        f"{content['moved']['deg']:.4f} deg"
    )
    session.show(job.base_data)
    return cli.answer(job.good)
