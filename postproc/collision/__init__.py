"""The only user of coal and trimesh: solids, pairs, the pair that hit, motions in between."""

from postproc.collision.bodies import Body
from postproc.collision.mesh import load_mesh, solid
from postproc.collision.outlines import is_measured
from postproc.collision.pairs import OUTLINE_SHARES
from postproc.collision.scene import Scene
from postproc.collision.surface import nearest_outside
