"""Run by freecadcmd: a plate with holes, a job with profile and drilling, our post processor."""

import json
import os
import pathlib
import traceback

import FreeCAD
import Part
from PathScripts import PathDrilling, PathJob, PathPostProcessor, PathProfile

HOLES = ((20, 20), (180, 20), (20, 100), (180, 100))


def plate():
    shape = Part.makeBox(200, 120, 20)
    for x, y in HOLES:
        shape = shape.cut(Part.makeCylinder(3, 20, FreeCAD.Vector(x, y, 0)))
    part = FreeCAD.ActiveDocument.addObject("Part::Feature", "Plate")
    part.Shape = shape
    return part


def make_job():
    FreeCAD.newDocument("plate")
    job = PathJob.Create("Job", [plate()], None)
    controller = job.Tools.Group[0]
    controller.HorizFeed = controller.VertFeed = "600 mm/min"
    controller.SpindleSpeed = 3000
    profile = PathProfile.Create("Profile")
    profile.setExpression("StepDown", None)
    profile.StepDown = 10
    model = job.Model.Group[0]
    drilling = PathDrilling.Create("Drilling")
    drilling.Base = [
        (
            model,
            [
                f"Face{i + 1}"
                for i, f in enumerate(model.Shape.Faces)
                if "Cylinder" in str(f.Surface)
            ],
        )
    ]
    drilling.PeckEnabled = True
    FreeCAD.ActiveDocument.recompute()
    return [controller, *job.Operations.Group]


def main():
    preferences = FreeCAD.ParamGet("User parameter:BaseApp/Preferences/Macro")
    preferences.SetString("MacroPath", os.environ["POST_FOLDER"])
    items = make_job()
    post = PathPostProcessor.PostProcessor.load("postproc_krl")
    answer = {"commands": [[c.Name, c.Parameters] for o in items for c in o.Path.Commands]}
    try:
        answer["text"] = post.export(items, os.environ["TARGET"], os.environ["ARGUMENTS"])
    except Exception:  # noqa: BLE001 - handed to the test
        answer["error"] = traceback.format_exc()
    pathlib.Path(os.environ["ANSWER"]).write_text(json.dumps(answer))


main()
