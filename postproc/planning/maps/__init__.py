"""What every spin about the tool axis would mean at every tag, for pages and tables."""

from postproc.planning.maps.failing_poses import failing_poses
from postproc.planning.maps.spin_curves import INDICES, SpinCurves, spin_curves, spin_degrees
from postproc.planning.maps.spin_index import SpinIndex, spin_index
from postproc.planning.maps.spinmap import SpinClass, SpinMap, spin_map

__all__ = [
    "INDICES",
    "SpinClass",
    "SpinCurves",
    "SpinIndex",
    "SpinMap",
    "failing_poses",
    "spin_curves",
    "spin_degrees",
    "spin_index",
    "spin_map",
]
