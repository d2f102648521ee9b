"""Run by FreeCAD's user interface at its start: a workbench with the one command."""

# ruff: noqa: D102, F821 - FreeCAD defines Workbench, and the names of its methods


class PostprocKrl(Workbench):
    """Posting to KUKA KRL."""

    MenuText = "postproc KRL"
    ToolTip = "CAM jobs to checked KUKA KRL programs"

    def Initialize(self) -> None:
        import FreeCADGui
        import postproc_krl_addon

        postproc_krl_addon.register()
        FreeCADGui.addCommand("Postproc_KRL", postproc_krl_addon.PostCommand())
        self.appendToolbar("postproc", ["Postproc_KRL"])
        self.appendMenu("postproc", ["Postproc_KRL"])

    def GetClassName(self) -> str:
        return "Gui::PythonWorkbench"


FreeCADGui.addWorkbench(PostprocKrl())
