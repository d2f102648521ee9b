"""The only user of fcl and trimesh: solids, pairs, the pair that hit, motions in between."""

from postproc.collision.check import Hits
from postproc.collision.scene import Scene

__all__ = [
    "Hits",
    "Scene",
]
