"""The add-on: FreeCAD's CAM finds the post processor here, and a command posts a job by it."""

# ruff: noqa: ANN001, ANN201, ANN202, ANN205, D102 - names and types are FreeCAD's

import pathlib
import shlex

import FreeCAD

HERE = pathlib.Path(__file__).parent
POST = "postproc_krl"


def register():
    """Let CAM look for post processors in this folder too."""
    try:
        from Path import Preferences
    except ImportError:  # before FreeCAD 1.0
        from PathScripts import PathPreferences as Preferences
    known = Preferences.searchPathsPost
    if getattr(known, "with_postproc", False):
        return

    def search_paths():
        return [*known(), str(HERE)]

    search_paths.with_postproc = True
    Preferences.searchPathsPost = search_paths


def choose_cell(job, cell):
    """Let a job be posted by postproc with a cell; other arguments stay."""
    words = [w for w in shlex.split(job.PostProcessorArgs) if not w.startswith("--cell=")]
    if POST not in job.getEnumerationsOfProperty("PostProcessor"):
        listed = [*job.getEnumerationsOfProperty("PostProcessor"), POST]
        job.PostProcessor = listed
    job.PostProcessor = POST
    job.PostProcessorArgs = shlex.join([f"--cell={cell}", *words])
    if not job.PostProcessorOutputFile:
        job.PostProcessorOutputFile = str(pathlib.Path(cell).parent / "%d.src")


def post(job):
    """Write the programs of a job, as this FreeCAD's own command does."""
    try:
        from Path.Post.Processor import PostProcessorFactory
    except ImportError:
        _post_before_1_0(job)
    else:
        PostProcessorFactory.get_post_processor(job, POST).export()


def _post_before_1_0(job):
    from PathScripts.PathPost import CommandPathPost

    if job.SplitOutput and "%s" not in job.PostProcessorOutputFile:
        raise ValueError("a split job needs %s in its output file: a name for each part")
    own = CommandPathPost()
    for part in own.buildPostList(job):
        own.exportObjectsWith(part, job)


class PostCommand:
    """Asks for the cell, and posts the job that is selected."""

    def GetResources(self):
        return {
            "MenuText": "Post to KUKA KRL",
            "ToolTip": "Choose a cell of postproc and write checked programs of the selected job",
        }

    def IsActive(self):
        return self._job() is not None

    def Activated(self):
        from PySide import QtGui

        job = self._job()
        title, kinds = "Robot cell of postproc", "Cells (*.toml)"
        cell, _ = QtGui.QFileDialog.getOpenFileName(None, title, "", kinds)
        if not cell:
            return
        choose_cell(job, cell)
        try:
            post(job)
        except Exception as refused:  # noqa: BLE001 - said where the user looks
            QtGui.QMessageBox.warning(None, "postproc", str(refused))
            return
        FreeCAD.Console.PrintMessage("postproc: the programs are written\n")

    @staticmethod
    def _job():
        import FreeCADGui

        chosen = FreeCADGui.Selection.getSelection()
        jobs = [item for item in chosen if hasattr(item, "PostProcessorArgs")]
        return jobs[0] if len(jobs) == 1 else None
