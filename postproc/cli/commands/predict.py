"""``postproc predict``: the tool points that a model expects."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from postproc.cli import common as cli


@cli.command("""
  postproc predict measured.csv --cell cell.toml --model out/model.toml -o expected.csv
""")
@click.argument("measurements", metavar="MEAS.csv")
@cli.CELL
@cli.TOOL
@cli.option("--model MODEL.toml", "What is known of the robot; else nominal.")
@cli.option(
    "--register", "Fit the measured frame and the reflector anew on these rows; keep the effects."
)
@cli.option("-o, --output OUT.csv", "id,x_mm,y_mm,z_mm; with --model u95_mm,inside.", required=True)
def command(session: cli.Session, /, **options: Any) -> int:  # noqa: ANN401 - click's own names
    """Write the tool point that the model expects for each row of a measurement file.

    The answer is in the robot root; in the measured frame where the model carries a registration
    or --register fits one.
    """
    from postproc.cell import load_cell
    from postproc.files import write_files
    from postproc.jobs.readings import predict
    from postproc.model import load_model

    cell = load_cell(options["cell"]).for_tool(options["tool"])
    model = load_model(options["model"]) if options["model"] else None
    prediction, rows = predict(options["measurements"], cell, model, options["register"])
    write_files({Path(options["output"]): prediction.csv(rows.ids)})
    for remark in prediction.remarks:
        session.say(f"{options['measurements']}: {remark.line()}")
    for name in prediction.missing:
        session.say(f"{options['measurements']}: {name} was left out: the rows do not show it")
    session.document(
        {
            "schema": "postproc.prediction/1",
            "rows": len(rows),
            "left_out": list(prediction.missing),
            "rms_mm": round(prediction.rms * 1e3, 6),
            "remarks": [remark.entry() for remark in prediction.remarks],
        }
    )
    text = f"{len(rows)} points; the measured ones lie {prediction.rms * 1e3:.4f} mm off (rms)"
    session.show(text)
    return cli.answer(True)
