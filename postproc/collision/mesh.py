"""Solids as triangle meshes: files, boxes and cylinders, with one clear error for a bad file."""

from __future__ import annotations

import io
import re
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from postproc.arrays import FloatArray, IntArray, frozen_floats, frozen_ints, taken
from postproc.bounded import run_bounded
from postproc.cell import MeshPlacement
from postproc.errors import CellError, ReadError, SourceRef
from postproc.files import read_bytes
from postproc.geometry import apply
from postproc.records import dataclass
from postproc.units import MM

CYLINDER_SIDES = 32
"""Sides of the prism that stands for a cylinder; it encloses the true cylinder."""
_STL_HEADER = 84
_STL_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_MOST_BYTES = 400
"""No triangle of a file takes more than so many bytes, in words as numbers."""
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
MOST_TRIANGLES = 1_000_000
"""A mesh with more is no collision solid: it would fill memory and hours."""
STEP_SECONDS = 60
STEP_BYTES = 4 << 30
"""What the tessellation of a STEP file may take."""
_LARGEST = 1e4
"""A coordinate beyond 10 km is a wrong unit or a broken file."""


@dataclass(frozen=True, slots=True)
class Mesh:
    """A triangle mesh: ``vertices`` (v, 3) [m], each place once; ``faces`` (f, 3) indices."""

    vertices: FloatArray
    faces: IntArray

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "vertices", (None, 3))
        frozen_ints(self, "faces", (None, 3))

    @property
    def corners(self) -> FloatArray:
        """(f, 3, 3) corners of the triangles [m]."""
        corners: FloatArray = self.vertices[self.faces]
        return corners

    def moved(self, T_a_b: FloatArray) -> Mesh:
        """Return the mesh of frame b in frame a."""
        return Mesh(apply(T_a_b, self.vertices), self.faces)


def solid(placement: MeshPlacement) -> Mesh:
    """Return a solid of the cell in the frame of its owner.

    Raises:
        CellError: COL001 to COL005 naming the mesh file.
    """
    if placement.file is not None:
        mesh = load_mesh(placement.file, placement.scale)
    elif placement.size is not None:
        mesh = box(placement.size)
    elif placement.radius > 0.0 and placement.length > 0.0:
        mesh = cylinder(placement.radius, placement.length)
    else:
        raise CellError("COL005", f"solid {placement.name!r} has neither file, size nor radius")
    return mesh.moved(placement.T_owner_mesh)


def load_mesh(path: Path, scale: float) -> Mesh:
    """Read a mesh file: STL by ourselves, STEP by OpenCASCADE, any other format by trimesh.

    Args:
        path: the file.
        scale: metres per unit of the file; of a STEP file, which states its unit, per mm.

    Raises:
        CellError: COL001 unreadable as this format, COL002 without triangles, COL003 with a
            coordinate that is not finite, COL004 larger than 10 km, COL009 with too many triangles.
    """
    try:
        raw = read_bytes(path)
    except ReadError as problem:
        raise _error("COL001", path, problem.message) from None
    if not raw:
        raise _error("COL002", path, "the file is empty, expected triangles")
    least = len(raw) // _MOST_BYTES
    if least > MOST_TRIANGLES:
        raise _too_many(path, f"at least {least}")
    reader = {".stl": _stl, ".step": _step, ".stp": _step}.get(path.suffix.lower(), _by_trimesh)
    corners = reader(path, raw)
    if not len(corners):
        raise _error("COL002", path, "no triangle in this file, expected a mesh")
    if len(corners) > MOST_TRIANGLES:
        raise _too_many(path, str(len(corners)))
    finite = np.isfinite(corners).all(axis=(1, 2))
    if not finite.all():
        first = int(np.argmin(finite)) + 1
        raise _error("COL003", path, f"triangle {first} has a coordinate that is not a number")
    corners = corners * scale
    if np.abs(corners).max() > _LARGEST:
        raise _error(
            "COL004",
            path,
            f"reaches {np.abs(corners).max():.3g} m from its origin, expected less than 10 km",
        )
    mesh = welded(corners)
    if not len(mesh.faces):
        raise _error("COL002", path, "every triangle of this file has no area")
    return mesh


def _too_many(path: Path, count: str) -> CellError:
    text = f"{count} triangles, expected at most {MOST_TRIANGLES}"
    return CellError("COL009", text, SourceRef(str(path)), "decimate the mesh for the cell")


def _error(code: str, path: Path, message: str) -> CellError:
    return CellError(code, message, SourceRef(str(path)), "check the file and its scale")


def _stl(path: Path, raw: bytes) -> FloatArray:
    """Return corners (f, 3, 3) in file units of a binary or an ASCII STL."""
    count = int.from_bytes(raw[80:84], "little") if len(raw) >= _STL_HEADER else 0
    expected = _STL_HEADER + count * _STL_RECORD.itemsize
    looks_ascii = raw[:512].lstrip().lower().startswith(b"solid")
    if len(raw) == expected or (not looks_ascii and _STL_HEADER < expected <= len(raw)):
        records = np.frombuffer(raw, _STL_RECORD, count, _STL_HEADER)
        return np.asarray(records["corners"], dtype=np.float64)
    if not looks_ascii:
        raise _error(
            "COL001",
            path,
            f"not a whole STL file: {len(raw)} bytes for {count} triangles, expected {expected}",
        )
    return _ascii_stl(path, raw)


def _ascii_stl(path: Path, raw: bytes) -> FloatArray:
    numbers = _VERTEX.findall(raw)
    ends = len(re.findall(rb"endfacet", raw, re.IGNORECASE))
    if len(numbers) != 3 * ends or b"endsolid" not in raw[-512:].lower():
        raise _error(
            "COL001",
            path,
            f"not a whole STL file: it ends after {len(numbers)} vertices and {ends} closed facets",
        )
    try:
        return np.array(numbers, dtype=np.bytes_).astype(np.float64).reshape(-1, 3, 3)
    except ValueError:
        raise _error("COL003", path, "a vertex of this file is not a number") from None


def _step(path: Path, raw: bytes) -> FloatArray:
    """Return corners (f, 3, 3) [mm] of a STEP file, triangulated in a process of its own.

    What the file holds is not bounded by its size, and OpenCASCADE writes to stdout.
    """
    import trimesh

    del raw
    if find_spec("cascadio") is None:
        text = 'a STEP file is read by an extra: pip install "postproc[step]"'
        raise CellError("PLG008", text, SourceRef(str(path)), "or export the solid as STL")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "solid.glb"
        tessellate = Path(__file__).with_name("tessellate.py")
        done = run_bounded(tessellate, [str(path), str(target)], STEP_SECONDS, STEP_BYTES)
        if done is None:
            text = f"not tessellated within {STEP_SECONDS} s and {STEP_BYTES >> 30} GB"
            raise _error("COL001", path, text)
        if not target.is_file():
            raise _error("COL001", path, "not a readable STEP file with a solid in it")
        try:
            mesh: Any = trimesh.load(target, force="mesh", process=False)
            return np.asarray(mesh.triangles, dtype=np.float64).reshape(-1, 3, 3) / MM
        except (ValueError, TypeError, AttributeError, LookupError):
            raise _error("COL001", path, "no solid in this STEP file") from None


def _by_trimesh(path: Path, raw: bytes) -> FloatArray:
    """Return corners (f, 3, 3) in file units, all parts of a scene in one mesh."""
    import trimesh

    kind = path.suffix.lower().lstrip(".")
    if kind not in trimesh.available_formats():
        raise _error(
            "COL001",
            path,
            f"unknown mesh format {path.suffix!r}, expected STL, STEP, OBJ, PLY or OFF",
        )
    try:
        mesh: Any = trimesh.load(io.BytesIO(raw), file_type=kind, force="mesh", process=False)
        return np.asarray(mesh.triangles, dtype=np.float64).reshape(-1, 3, 3)
    except Exception as problem:  # noqa: BLE001 - the readers of trimesh raise anything
        reason = str(problem) or type(problem).__name__
        raise _error(
            "COL001", path, f"not a readable {kind.upper()} mesh: {reason[:120]}"
        ) from None


def welded(corners: FloatArray) -> Mesh:
    """Return the mesh of triangles (f, 3, 3) with equal corners merged and slivers of no area gone.

    A face whose corners are not three different places bounds nothing and is left out.
    """
    places, index = _unique_rows(np.ascontiguousarray(corners.reshape(-1, 3)) + 0.0)
    faces = index.reshape(-1, 3)
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    used = np.zeros(len(places), dtype=bool)
    used[faces] = True
    renumber = np.cumsum(used) - 1
    return Mesh(places[used], renumber[faces])


def _unique_rows(rows: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the distinct rows in order of appearance and for each row its number.

    Rows are told apart by a hash of their bits and then compared; if two different rows ever
    share a hash, the slower exact way is taken.
    """
    bits = rows.view(np.uint64)
    mixed = bits * np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
    mixed ^= mixed >> np.uint64(29)
    mixed *= np.uint64(0xBF58476D1CE4E5B9)
    key = mixed[:, 0] ^ (mixed[:, 1] << np.uint64(1)) ^ (mixed[:, 2] >> np.uint64(1))
    _, first, number = np.unique(key, return_index=True, return_inverse=True)
    if not np.array_equal(taken(taken(rows, first), number), rows):
        _, first, number = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return rows[first[order]], rank[number.ravel()].astype(np.int32)


def normals_of(corners: FloatArray) -> FloatArray:
    """Return normals (f, 3) of twice the area of each triangle [m^2]."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def box(size: FloatArray) -> Mesh:
    """Return a box of edges ``size`` (3,) [m], centred, faces outward."""
    half_x, half_y, half_z = 0.5 * np.asarray(size, dtype=np.float64)
    section = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [half_x, half_y]
    return loft([section, section], [-half_z, half_z])


def cylinder(radius: float, length: float) -> Mesh:
    """Return a prism along z, centred, that encloses the cylinder, less than 0.5 % wider."""
    section = ring(radius, CYLINDER_SIDES) / np.cos(np.pi / CYLINDER_SIDES)
    return loft([section, section], [-0.5 * length, 0.5 * length])


def ring(radius: float, sides: int) -> FloatArray:
    """Return corners (sides, 2) [m] of a regular polygon, counter-clockwise."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def loft(sections: list[FloatArray], heights: list[float]) -> Mesh:
    """Return the closed body through polygons (n, 2) [m] lying at growing heights z [m].

    All sections have the same number of corners, counter-clockwise seen from +z; the ends are
    closed by fans, so the first and last section must be convex.
    """
    n = len(sections[0])
    vertices = np.vstack(
        [np.column_stack([s, np.full(n, z)]) for s, z in zip(sections, heights, strict=True)]
    )
    i, j = np.arange(n), np.roll(np.arange(n), -1)
    faces = []
    for level in range(len(sections) - 1):
        low, high = level * n, (level + 1) * n
        faces += [
            np.stack([low + i, low + j, high + j], 1),
            np.stack([low + i, high + j, high + i], 1),
        ]
    fan = np.arange(1, n - 1)
    top = (len(sections) - 1) * n
    faces += [
        np.stack([np.zeros_like(fan), fan + 1, fan], 1),
        np.stack([np.full_like(fan, top), top + fan, top + fan + 1], 1),
    ]
    return Mesh(vertices, np.vstack(faces).astype(np.int32))


def convex_hull(points: FloatArray) -> Mesh:
    """Return the smallest convex solid around points (n, 3) [m]."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    corners = points[hull.simplices]
    inwards = np.einsum("fi,fi->f", normals_of(corners), hull.equations[:, :3]) < 0.0
    corners[inwards] = corners[inwards, ::-1]
    return welded(corners)


class ByContent:
    """A mesh as a cache key."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self._hash = hash((mesh.vertices.tobytes(), mesh.faces.tobytes()))

    def __hash__(self) -> int:
        """Return what was worked out once."""
        return self._hash

    def __eq__(self, other: object) -> bool:
        """Return whether the other is the same mesh to the bit."""
        return (
            isinstance(other, ByContent)
            and np.array_equal(self.mesh.vertices, other.mesh.vertices)
            and np.array_equal(self.mesh.faces, other.mesh.faces)
        )


def joined(meshes: list[Mesh]) -> Mesh:
    """Return several meshes as one body."""
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    return Mesh(
        np.vstack([mesh.vertices for mesh in meshes]),
        np.vstack([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]),
    )


def decimated(mesh: Mesh, max_faces: int) -> Mesh:
    """Return a coarser mesh for display, of at most ``max_faces`` triangles.

    Vertices are merged in a grid that is made coarser until the faces are few enough.
    """
    if len(mesh.faces) <= max_faces:
        return mesh
    faces, vertices = mesh.faces, mesh.vertices
    span = float(np.ptp(vertices, axis=0).max())
    cells = max(4.0, np.sqrt(max_faces) * 2.0)
    while len(faces) > max_faces and cells >= 1.0:
        cell = np.floor((mesh.vertices - mesh.vertices.min(axis=0)) / (span / cells)).astype(
            np.int64
        )
        _, number = np.unique(cell, axis=0, return_inverse=True)
        number = number.ravel()
        count = np.bincount(number)
        vertices = np.stack([np.bincount(number, mesh.vertices[:, k]) / count for k in range(3)], 1)
        a, b, c = number[mesh.faces].T
        kept = (a != b) & (b != c) & (c != a)
        faces = np.stack([a, b, c], axis=1)[kept].astype(np.int32)
        cells *= 0.8
    return Mesh(vertices, faces)
