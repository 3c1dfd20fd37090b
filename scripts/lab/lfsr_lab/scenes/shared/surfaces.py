"""Meshes as plain arrays: NumPy only, unit-sized, centred."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from lfsr_core.base.arrays import Array

Random = np.random.Generator


@dataclasses.dataclass(frozen=True)
class Surface:
    """``vertices`` (V, 3), ``faces`` (F, 4) quads or (F, 3) triangles, ``uv`` (V, 2) or None."""

    vertices: Array
    faces: Array
    uv: Array | None = None
    smooth: bool = True


def join(parts: Sequence[Surface]) -> Surface:
    """One surface of several with faces of equal size."""
    starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    faces = np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)])
    uv = np.concatenate([part.uv if part.uv is not None else np.zeros((len(part.vertices), 2)) for part in parts])
    return Surface(np.concatenate([part.vertices for part in parts]), faces, uv, parts[0].smooth)


def unit_sized(surface: Surface) -> Surface:
    """Centred, with its longest extent 2 (so that it fits a cube from -1 to 1)."""
    low, high = surface.vertices.min(0), surface.vertices.max(0)
    half = max(float((high - low).max()) / 2, 1e-6)
    return dataclasses.replace(surface, vertices=(surface.vertices - (low + high) / 2) / half)


def parametric(place: Callable[[Array, Array], Array], columns: int, rows: int, wrap: bool = False) -> Surface:
    """Quads over (u, v) in [0, 1]²; ``place`` maps two (rows, columns) arrays to (rows, columns, 3).

    ``wrap``: whether the last column meets the first.
    """
    u = np.linspace(0, 1, columns, endpoint=not wrap)
    v = np.linspace(0, 1, rows)
    grid_u, grid_v = np.meshgrid(u, v)
    vertices = place(grid_u, grid_v).reshape(-1, 3)
    faces = _grid_faces(columns, rows, wrap, False)
    return Surface(vertices, faces, np.stack([grid_u.ravel(), grid_v.ravel()], -1))


def _grid_faces(columns: int, rows: int, wrap_u: bool, wrap_v: bool) -> Array:
    column, row = np.meshgrid(np.arange(columns - (not wrap_u)), np.arange(rows - (not wrap_v)))
    right, below = (column + 1) % columns, (row + 1) % rows
    corners = (row * columns + column, row * columns + right, below * columns + right, below * columns + column)
    return np.stack([corner.ravel() for corner in corners], -1)


def tube(path: Array, radius: Array | float, sides: int = 8, closed: bool = False) -> Surface:
    """Tube of ``radius`` (one value or one per point) along a path (N, 3), without end caps."""
    path = np.asarray(path, float)
    tangent = np.roll(path, -1, 0) - np.roll(path, 1, 0) if closed else np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True) + 1e-12
    normal, side = np.empty_like(path), np.eye(3)[np.argmin(np.abs(tangent[0]))]
    for index, along in enumerate(tangent):  # across the path, turning as little as possible
        side = side - along * (side @ along)
        side = side / (np.linalg.norm(side) + 1e-12)
        normal[index] = side
    binormal = np.cross(tangent, normal)
    around = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    reach = np.broadcast_to(np.asarray(radius, float), len(path))[:, None, None]
    ring = normal[:, None] * np.cos(around)[:, None] + binormal[:, None] * np.sin(around)[:, None]
    vertices = (path[:, None] + ring * reach).reshape(-1, 3)
    uv = np.stack(np.meshgrid(around / (2 * np.pi), np.linspace(0, 1, len(path))), -1).reshape(-1, 2)
    return Surface(vertices, _grid_faces(sides, len(path), True, closed), uv)


def strands(paths: Array, radius: Array, sides: int = 3) -> Surface:
    """Many thin, nearly straight tubes at once: paths (N, P, 3), radius per point (P,) or (N, P)."""
    count, points = paths.shape[:2]
    along = paths[:, -1] - paths[:, 0]
    side = np.cross(along, np.roll(along, 1, axis=1) + 0.1)
    side /= np.linalg.norm(side, axis=1, keepdims=True) + 1e-12
    other = np.cross(along / (np.linalg.norm(along, axis=1, keepdims=True) + 1e-12), side)
    around = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = side[:, None] * np.cos(around)[:, None] + other[:, None] * np.sin(around)[:, None]
    reach = np.broadcast_to(radius, (count, points))[:, :, None, None]
    vertices = paths[:, :, None] + ring[:, None] * reach
    faces = _grid_faces(sides, points, True, False) + sides * points * np.arange(count)[:, None, None]
    uv = np.stack(np.meshgrid(around / (2 * np.pi), np.linspace(0, 1, points)), -1).reshape(-1, 2)
    return Surface(vertices.reshape(-1, 3), faces.reshape(-1, 4), np.tile(uv, (count, 1)))


def torus_knot(rng: Random) -> Surface:
    """A (p, q) torus knot of random thickness; p = q - 1 = 0 gives a plain torus."""
    turns, windings = [(2, 3), (3, 2), (2, 5), (3, 4), (1, 0), (3, 5)][rng.integers(6)]
    angle = np.linspace(0, 2 * np.pi, 160, endpoint=False)
    reach = 1 + 0.4 * np.cos(windings * angle) * (windings > 0)
    path = np.stack([reach * np.cos(turns * angle), reach * np.sin(turns * angle), 0.4 * np.sin(windings * angle)], -1)
    return tube(path, rng.uniform(0.05, 0.3), 16, closed=True)


def spring(rng: Random) -> Surface:
    """A helix of a few to many turns."""
    turns, along = rng.uniform(3, 14), np.linspace(0, 1, 240)
    angle = 2 * np.pi * turns * along
    reach = rng.uniform(0.3, 0.6) * (1 + rng.uniform(-0.8, 0.8) * (along - 0.5))
    path = np.stack([reach * np.cos(angle), reach * np.sin(angle), 2 * along - 1], -1)
    return tube(path, rng.uniform(0.01, 0.07), 8)


def wire_tangle(rng: Random, radius: float | None = None) -> Surface:
    """A thin closed wire through space: a random Fourier curve."""
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    orders = np.arange(1, rng.integers(3, 8))
    weights = rng.normal(size=(len(orders), 2, 3)) / orders[:, None, None] ** 0.7
    path = sum(np.outer(np.cos(n * angle), w[0]) + np.outer(np.sin(n * angle), w[1])
               for n, w in zip(orders, weights, strict=True))
    path /= np.abs(path).max()
    return tube(path, radius or rng.uniform(0.006, 0.05), 6, closed=True)


def lathe(rng: Random, steps: int = 48) -> Surface:
    """A vase, bottle, bowl or goblet: a smooth random profile turned about Z."""
    knots = rng.uniform(0.15, 0.9, rng.integers(4, 8))
    place = np.linspace(0, 1, steps) * (len(knots) - 1)
    whole, part = np.floor(place), place % 1
    outer = np.interp(whole + part * part * (3 - 2 * part), np.arange(len(knots)), knots)
    return revolve(outer, np.linspace(-1, 1, steps), thickness=rng.uniform(0.02, 0.06))


def revolve(radius: Array, height: Array, thickness: float, sides: int = 64) -> Surface:
    """Closed solid of a hollow vessel: outside up, over the rim, inside down, with a thick floor."""
    inner = np.maximum(radius - thickness, 0.01)[::-1]
    inner_height = np.maximum(height[::-1], height[0] + thickness)
    reach = np.concatenate([[1e-4], radius, inner, [1e-4]])
    level = np.concatenate([[height[0]], height, inner_height, [height[0] + thickness]])

    def place(u: Array, v: Array) -> Array:
        along = v * (len(reach) - 1)
        r = np.interp(along, np.arange(len(reach)), reach)
        z = np.interp(along, np.arange(len(level)), level)
        return np.stack([r * np.cos(2 * np.pi * u), r * np.sin(2 * np.pi * u), z], -1)

    return parametric(place, sides, len(reach), wrap=True)


def superquadric(rng: Random) -> Surface:
    """Between ball, box, pillow and star: a superellipsoid with random exponents."""
    first, second = rng.uniform(0.2, 2.5, 2)
    power = lambda x, e: np.sign(x) * np.abs(x) ** e  # noqa: E731

    def place(u: Array, v: Array) -> Array:
        a, b = 2 * np.pi * u, np.pi * (v - 0.5) * 0.998
        return np.stack([power(np.cos(b), first) * power(np.cos(a), second),
                         power(np.cos(b), first) * power(np.sin(a), second), power(np.sin(b), first)], -1)

    stretched = parametric(place, 64, 33, wrap=True)
    return dataclasses.replace(stretched, vertices=stretched.vertices * rng.uniform(0.4, 1, 3))


def waves(rng: Random, points: Array, count: int = 12, frequency: float = 2.0) -> Array:
    """Smooth random field over points (N, 3): a sum of sines with falling weights, about -1 to 1."""
    field = np.zeros(len(points))
    for octave in range(count):
        pace = frequency * 1.25 ** octave
        direction = rng.normal(size=3)
        direction *= pace / np.linalg.norm(direction)
        field += np.sin(points @ direction + rng.uniform(0, 2 * np.pi)) / 1.2 ** octave
    return field / np.sqrt(count)


def sphere(columns: int = 96, rows: int = 64) -> Surface:
    """Unit ball by longitude and latitude."""
    def place(u: Array, v: Array) -> Array:
        a, b = 2 * np.pi * u, np.pi * (v - 0.5) * 0.9999
        return np.stack([np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)], -1)
    return parametric(place, columns, rows, wrap=True)


def blob(rng: Random) -> Surface:
    """A ball pushed in and out, twisted and stretched: from a pebble to a coral."""
    ball = sphere()
    depth, pace = rng.choice([0.1, 0.25, 0.45]), rng.uniform(1.2, 4)
    field = waves(rng, ball.vertices, 10, pace)
    if rng.random() < 0.4:
        field = 1 - 2 * np.abs(field)
    points = ball.vertices * np.exp(depth * field)[:, None] * rng.uniform(0.55, 1, 3)
    angle = rng.normal(0, 0.8) * points[:, 2]
    x = points[:, 0] * np.cos(angle) - points[:, 1] * np.sin(angle)
    y = points[:, 0] * np.sin(angle) + points[:, 1] * np.cos(angle)
    return dataclasses.replace(ball, vertices=np.stack([x, y, points[:, 2]], -1))


def cloth(rng: Random) -> Surface:
    """A hanging or crumpled sheet in the XZ plane, wavy along Y."""
    pace, depth = rng.uniform(1, 5), rng.uniform(0.03, 0.25)

    def place(u: Array, v: Array) -> Array:
        flat = np.stack([2 * u - 1, 0 * u, 2 * v - 1], -1)
        points = flat.reshape(-1, 3) * [1, 1, rng.uniform(0.2, 1)]
        lift = depth * waves(rng, points, 8, pace).reshape(u.shape)
        return flat + lift[..., None] * [0.2, 1, 0.1]

    return parametric(place, 96, 96)


def terrain(rng: Random) -> Surface:
    """Rolling or rough ground in the XY plane, heights along Z."""
    pace, depth = rng.uniform(1, 4), rng.uniform(0.02, 0.2)

    def place(u: Array, v: Array) -> Array:
        flat = np.stack([2 * u - 1, 2 * v - 1, 0 * u], -1)
        height = depth * waves(rng, flat.reshape(-1, 3), 14, pace).reshape(u.shape)
        return flat + height[..., None] * [0, 0, 1]

    return parametric(place, 128, 128)


def card(width: float = 1.0, height: float = 1.0) -> Surface:
    corners = np.array([[-width, 0, -height], [width, 0, -height], [width, 0, height], [-width, 0, height]])
    return Surface(corners, np.array([[0, 1, 2, 3]]), np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float), False)


def box(width: float = 1.0, depth: float = 1.0, height: float = 1.0) -> Surface:
    """An axis-aligned box with half-extents, six separate faces so that each has its own texture square."""
    sides = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)
            # Outward winding: glass needs to know inside from outside.
            corner = corner if (sign > 0) == (axis != 1) else corner[::-1]
            points = np.insert(corner, axis, sign, axis=1)
            sides.append(Surface(points * [width, depth, height], np.array([[0, 1, 2, 3]]), (corner + 1) / 2, False))
    return join(sides)


def gear(rng: Random) -> Surface:
    """A toothed wheel or star prism: hard edges all around."""
    teeth, depth = int(rng.integers(5, 24)), rng.uniform(0.1, 0.45)
    angle = np.linspace(0, 2 * np.pi, teeth * 4, endpoint=False)
    reach = np.where(np.arange(teeth * 4) % 4 < 2, 1.0, 1 - depth)
    half, hole = rng.uniform(0.08, 0.4), rng.uniform(0.15, 0.4)
    rim = np.stack([reach * np.cos(angle), reach * np.sin(angle)], -1)
    inner = hole * np.stack([np.cos(angle), np.sin(angle)], -1)
    rings = [(rim, -half), (rim, half), (inner, half), (inner, -half)]
    vertices = np.concatenate([np.column_stack([ring, np.full(len(ring), z)]) for ring, z in rings])
    return Surface(vertices, _grid_faces(len(angle), 4, True, True), None, False)
