"""Run by FreeCAD: a plate with holes, a job with profile and drilling, our post processor."""

import json
import os
import pathlib
import traceback

import FreeCAD
import Part

try:
    from Path.Main import Job as PathJob
    from Path.Op import Drilling as PathDrilling
    from Path.Op import Profile as PathProfile
    from Path.Post.Processor import PostProcessor, PostProcessorFactory
except ImportError:  # before FreeCAD 1.0
    from PathScripts import PathDrilling, PathJob, PathPostProcessor, PathProfile

    PostProcessorFactory = None

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
    return job


def posted(job, target):
    """Return what the post processor gives for the whole job, as this FreeCAD calls it."""
    import postproc_krl_addon

    postproc_krl_addon.choose_cell(job, os.environ["CELL"])
    if PostProcessorFactory is None:
        items = [*job.Tools.Group, *job.Operations.Group]
        post = PathPostProcessor.PostProcessor.load("postproc_krl")
        return {"text": post.export(items, target, job.PostProcessorArgs)}
    job.PostProcessorOutputFile = target
    parts = PostProcessorFactory.get_post_processor(job, "postproc_krl").export()
    answer = {"text": parts[0][1], "exists": PostProcessor.exists("postproc_krl")}
    job.Fixtures, job.SplitOutput, job.OrderOutputBy = ["G54", "G55"], True, "Fixture"
    job.PostProcessorOutputFile = target.replace("plate", "two")
    job.PostProcessorArgs += " --no-convert"
    answer["parts"] = [part for part, _ in by_factory(job)]
    return answer


def by_factory(job):
    return PostProcessorFactory.get_post_processor(job, "postproc_krl").export() or []


def commanded(job):
    """Return what the command of the workbench says of the selected job; files are its own."""
    import FreeCADGui
    from PySide import QtGui

    said = []
    QtGui.QFileDialog.getOpenFileName = staticmethod(lambda *_: (os.environ["CELL"], ""))
    QtGui.QMessageBox.warning = staticmethod(lambda *words: said.append(words[-1]))
    FreeCADGui.activateWorkbench("PostprocKrl")
    FreeCADGui.Selection.clearSelection()
    FreeCADGui.Selection.addSelection(job)
    job.PostProcessorOutputFile = os.environ["TARGET"]
    FreeCADGui.runCommand("Postproc_KRL")
    return {"said": said}


def main():
    answer = {}
    try:
        job = make_job()
        items = [*job.Tools.Group, *job.Operations.Group]
        answer["commands"] = [[c.Name, c.Parameters] for o in items for c in o.Path.Commands]
        answer |= commanded(job) if FreeCAD.GuiUp else posted(job, os.environ["TARGET"])
    except Exception:  # noqa: BLE001 - handed to the test
        answer["error"] = traceback.format_exc()
    pathlib.Path(os.environ["ANSWER"]).write_text(json.dumps(answer))
    if FreeCAD.GuiUp:
        os._exit(0)


if FreeCAD.GuiUp:
    from PySide import QtCore

    QtCore.QTimer.singleShot(2000, main)  # when the window is there
else:
    main()
