"""Run by FreeCAD at its start, with the folder of this add-on among its paths."""

import postproc_krl_addon

postproc_krl_addon.register()
