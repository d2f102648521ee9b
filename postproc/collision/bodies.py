"""The solids of a cell, each named as the user knows it."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.cell import Cell, MeshPlacement, Tool, UrdfGeometry
from postproc.collision.arm import Arm
from postproc.collision.links import default_links
from postproc.collision.mesh import Mesh, decimated, joined, solid
from postproc.collision.setups import absent_bases
from postproc.collision.urdf_solids import urdf_links
from postproc.errors import Finding, Severity
from postproc.geometry import inverse, transform
from postproc.records import dataclass

WORLD = -1
"""Stands for a link where a body does not move."""
LAST_LINK = 6


@dataclass(frozen=True, slots=True)
class Body:
    """One solid.

    Args:
        name: as the user knows it: ``link 4``, ``tool spindle.stl``, ``obstacle fixture``.
        kind: ``link``, ``tool``, ``cutting``, ``workpiece`` or ``obstacle``.
        link: 0..6, the link that carries it and in whose frame the mesh is given, or ``WORLD``:
            the mesh is given in the world.
        mesh: its surface [m].
        is_outline: it is a generated outline of a link, which lies outside of the real one.
        base: of a workpiece, the place of its setup in the cell; -1 of all others.
    """

    name: str
    kind: str
    link: int
    mesh: Mesh
    is_outline: bool = False
    base: int = -1

    @property
    def vertices(self) -> FloatArray:
        """(v, 3) [m] in the frame of the link or of the world."""
        return self.mesh.vertices

    @property
    def faces(self) -> IntArray:
        """(f, 3) indices of vertices, outward counter-clockwise."""
        return self.mesh.faces

    def coarse(self, max_faces: int) -> Body:
        """Return the body with at most ``max_faces`` triangles, for display."""
        return replace(self, mesh=decimated(self.mesh, max_faces))


def bodies_of(cell: Cell, arm: Arm) -> tuple[tuple[Body, ...], tuple[Finding, ...]]:
    """Return the solids of a cell in fixed order, and what the user should know about them.

    Links 0..6, tool, workpieces, obstacles, tools on their stands; within each in the order of the
    cell file. Workpieces that cannot stand there with the one in work are left out.

    Raises:
        CellError: COL001 to COL005 naming the mesh file that cannot be used.
    """
    T_world_robroot = np.asarray(cell.robot.T_world_robroot)
    zero = np.zeros(6)
    T_link6_flange = inverse(arm.link_frames(zero)[LAST_LINK]) @ arm.fk(zero)
    links, findings = _links(cell, arm)
    bodies = [
        *links,
        *(
            _placed(s, "tool", LAST_LINK, T_link6_flange, "cutting" if s.cutting else "tool")
            for s in cell.tool.meshes
        ),
        *(
            replace(
                _placed(s, "workpiece", WORLD, T_world_robroot @ base.T_robroot_base), base=index
            )
            for index, base in enumerate(cell.bases)
            for s in base.meshes
        ),
        *(_placed(s, "obstacle", WORLD, np.eye(4)) for s in cell.obstacles),
        *(
            replace(body, name=f"{body.name} of {tool.name} on its stand")
            for tool, T_world_stand in _on_stands(cell)
            for body in (_placed(s, "tool", WORLD, T_world_stand, "obstacle") for s in tool.meshes)
        ),
    ]
    if not cell.tool.meshes:
        text = "the tool has no solids: collisions of the tool are not checked"
        findings.append(Finding(Severity.WARNING, "COL101", text))
    findings += _not_seen(cell)
    absent = absent_bases(cell)
    if absent:
        gone = ", ".join(str(cell.bases[index].number) for index in absent)
        text = f"solids of base {gone} overlap those of base {cell.workpiece.number}: not there"
        findings.append(Finding(Severity.NOTE, "COL106", f"{text} while it is in work"))
    there = (body for body in _told_apart(bodies) if body.base not in absent)
    return tuple(there), tuple(findings)


def _on_stands(cell: Cell) -> list[tuple[Tool, FloatArray]]:
    """Return the tools that are not mounted, as far as it is known where they are."""
    others = (tool for index, tool in enumerate(cell.tools) if index != cell.tool_index)
    return [(tool, tool.T_world_stand) for tool in others if tool.T_world_stand is not None]


def _not_seen(cell: Cell) -> list[Finding]:
    """Return a note of the tools whose solids are nowhere while others are mounted."""
    lost = [tool for tool in cell.tools if tool.meshes and tool.T_world_stand is None]
    if len(cell.tools) < 2 or not lost:
        return []
    numbers = ", ".join(str(tool.number) for tool in lost)
    text = f"no stand for tool {numbers} while another is mounted: it is not checked for collisions"
    return [Finding(Severity.NOTE, "COL107", text, hint="give [[tools]] stand = { xyz_mm = .. }")]


CONTACT_SLACK = 0.05e-3
"""A cutter goes this much deeper [m] than its contact depth before it is too deep.

At just that depth its tip and the surface lie in one plane: whether they meet there is chance.
"""


def pulled_back(body: Body, cell: Cell, arm: Arm) -> Body:
    """Return a cutting solid pulled back along the tool axis by the cell's contact depth."""
    zero = np.zeros(6)
    R_link6_flange = inverse(arm.link_frames(zero)[LAST_LINK])[:3, :3] @ arm.fk(zero)[:3, :3]
    axis = R_link6_flange @ cell.tool.T_flange_tcp[:3, :3] @ cell.tool.axis
    shift = transform(np.eye(3), -(cell.limits.contact_depth + CONTACT_SLACK) * axis)
    return Body(body.name, body.kind, body.link, body.mesh.moved(shift))


FOOT = 10e-3
"""Height [m] of the foot of an arm: so far its bed, plates and bolts may reach up around it."""


def above_foot(body: Body, floor: float) -> Body:
    """Return a solid of link 0 without what is less than ``FOOT`` above ``floor``, its bed."""
    vertices = np.array(body.mesh.vertices)
    vertices[:, 2] = np.maximum(vertices[:, 2], floor + FOOT)
    return replace(body, mesh=Mesh(vertices, body.mesh.faces))


THINNER = (0.8, 0.6, 0.4, 0.2)
"""Shares of its size to which a link of the wrist is thinned until the tool is free of it."""


def thinner(body: Body, share: float) -> Body:
    """Return a solid shrunk about the middle of its box."""
    vertices = body.mesh.vertices
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    mesh = Mesh(middle + share * (vertices - middle), body.mesh.faces)
    return Body(body.name, body.kind, body.link, mesh)


def _links(cell: Cell, arm: Arm) -> tuple[list[Body], list[Finding]]:
    own = cell.robot.link_meshes
    if own:
        counts = np.bincount([link for link, _ in own], minlength=LAST_LINK + 1)
        return [
            Body(_link_name(link, placement, int(counts[link])), "link", link, solid(placement))
            for link, placement in sorted(own, key=lambda entry: entry[0])
        ], []
    meshes = default_links(cell.robot, arm)
    findings: list[Finding] = []
    is_built_in = True
    if isinstance(cell.robot.geometry, UrdfGeometry):
        is_built_in = False
        found, findings = urdf_links(cell.robot.geometry)
        meshes = tuple(joined(found[i]) if found[i] else mesh for i, mesh in enumerate(meshes))
    bodies = [Body(f"link {i}", "link", i, mesh, is_built_in) for i, mesh in enumerate(meshes)]
    return bodies, findings


def _link_name(link: int, placement: MeshPlacement, count: int) -> str:
    is_named = re.fullmatch(r"link( \d+)?", placement.name) is None
    if count == 1 and not is_named:
        return f"link {link}"
    return f"link {link} {_own_name(placement, 'link')}".rstrip()


def _placed(
    placement: MeshPlacement, owner: str, link: int, T_link_owner: FloatArray, kind: str = ""
) -> Body:
    name = f"{owner} {_own_name(placement, owner)}".rstrip()
    return Body(name, kind or owner, link, solid(placement).moved(T_link_owner))


def _own_name(placement: MeshPlacement, owner: str) -> str:
    """Return the name the user gave, else the file's, else the number in the cell file."""
    numbered = re.fullmatch(rf"{owner}( \d+)?", placement.name)
    if numbered is None:
        return placement.name
    if placement.file is not None:
        return placement.file.name
    return (numbered[1] or "").strip()


def _told_apart(bodies: list[Body]) -> tuple[Body, ...]:
    """Return the bodies with a number behind names that appear twice."""
    seen: dict[str, int] = {}
    result = []
    for body in bodies:
        count = seen[body.name] = seen.get(body.name, 0) + 1
        name = body.name if count == 1 else f"{body.name} ({count})"
        result.append(replace(body, name=name))
    return tuple(result)
