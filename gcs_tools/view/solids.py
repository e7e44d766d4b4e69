"""Solids as triangles: rings of points joined to a skin, and what is made of such. Pure functions on arrays."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


class Mesh(NamedTuple):
    """vertices (n, 3) in metres, faces (m, 3) of indices, counter-clockwise seen from outside."""

    vertices: Points
    faces: NDArray[np.int64]


def joined(*meshes: Mesh) -> Mesh:
    """Several as one."""
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes)])[:-1]
    faces = [m.faces + offset for m, offset in zip(meshes, offsets, strict=True)]
    return Mesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces))


def mirrored(mesh: Mesh) -> Mesh:
    """The same on the other side of the plane y = 0, still with its outside outward."""
    return Mesh(mesh.vertices * (1.0, -1.0, 1.0), mesh.faces[:, ::-1])


def moved(mesh: Mesh, offset: Sequence[float]) -> Mesh:
    return Mesh(mesh.vertices + np.asarray(offset), mesh.faces)


def loft(rings: Sequence[Points], capped: bool = True) -> Mesh:
    """A skin over rings of k points each, in order; the outside is outward whichever way the rings run.

    The caps have points of their own, so that the edge between skin and cap stays sharp when shaded.
    """
    k, n = len(rings[0]), len(rings)
    vertices = [np.concatenate(rings)]
    faces = []
    for a in range(n - 1):
        for i in range(k):
            j = (i + 1) % k
            p, q, r, s = a * k + i, a * k + j, (a + 1) * k + i, (a + 1) * k + j
            faces += [(p, q, s), (p, s, r)]
    if capped:
        for ring, inward in ((rings[0], True), (rings[-1], False)):
            base = sum(map(len, vertices))
            vertices.append(np.concatenate([ring, ring.mean(axis=0)[None]]))
            fan = [(base + i, base + (i + 1) % k, base + k) for i in range(k)]
            faces += [face[::-1] for face in fan] if inward else fan
    mesh = Mesh(np.concatenate(vertices), np.array(faces))
    return mesh if volume(mesh) >= 0.0 else Mesh(mesh.vertices, mesh.faces[:, ::-1])


def volume(mesh: Mesh) -> float:
    """Enclosed volume [m³]; negative where the faces point inward."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.sum(np.cross(a, b) * c) / 6.0)


def ellipse(x: float, y: float, z: float, half_width: float, half_height: float, points: int = 24) -> Points:
    """A ring across body x, around (y, z)."""
    angle = np.linspace(0.0, 2.0 * math.pi, points, endpoint=False)
    return np.stack(
        [np.full(points, x), y + half_width * np.cos(angle), z + half_height * np.sin(angle)], axis=1
    )  # fmt: skip


def spindle(stations: Sequence[tuple[float, float, float]], y: float = 0.0, z: float = 0.0, points: int = 24) -> Mesh:
    """A body along x of elliptic sections: (x, half width, half height) each."""
    return loft([ellipse(x, y, z, width, height, points) for x, width, height in stations])


def rod(start: Sequence[float], end: Sequence[float], radius: float, points: int = 10) -> Mesh:
    """A round rod between two points."""
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    along = (b - a) / np.linalg.norm(b - a)
    aside = np.cross(along, (0.0, 1.0, 0.0) if abs(along[1]) < 0.9 else (1.0, 0.0, 0.0))
    aside /= np.linalg.norm(aside)
    other = np.cross(along, aside)
    angle = np.linspace(0.0, 2.0 * math.pi, points, endpoint=False)[:, None]
    ring = radius * (np.cos(angle) * aside + np.sin(angle) * other)
    return loft([a + ring, b + ring])


def ball(centre: Sequence[float], radius: float, points: int = 12) -> Mesh:
    """A sphere."""
    turns = np.linspace(0.02, math.pi - 0.02, points // 2 + 1)
    rings = [ellipse(radius * math.cos(t), 0.0, 0.0, r := radius * math.sin(t), r, points) for t in turns]
    return moved(loft(rings), centre)


def aerofoil(thickness: float, first: float = 0.0, last: float = 1.0, points: int = 14) -> Points:
    """A ring (n, 2) of a symmetric section of unit chord: x from the leading edge aft, z down; between two stations.

    The four-digit thickness distribution of NACA Report 460 (1933), with a closed trailing edge.
    """
    x = first + (last - first) * 0.5 * (1.0 - np.cos(np.linspace(0.0, math.pi, points)))
    half = 5.0 * thickness * (0.2969 * np.sqrt(x) - 0.1260 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)
    half = np.maximum(half, 0.004)  # a knife's edge can't be shaded
    return np.concatenate([np.stack([x, -half], axis=1), np.stack([x, half], axis=1)[::-1]])
