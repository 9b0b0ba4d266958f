"""Random workpieces: right-angled stepped blocks and slanted profiles of continuous sizes, as closed meshes."""

from __future__ import annotations

import numpy as np

from tanteo.parts import read_part


def write_off(path, vertices, triangles):
    """Vertices in millimetres and triangles as an OFF file."""
    lines = ["OFF", f"{len(vertices)} {len(triangles)} 0"]
    lines += [" ".join(f"{c:.9f}" for c in v) for v in vertices]
    lines += [f"3 {a} {b} {c}" for a, b, c in triangles]
    path.write_text("\n".join(lines) + "\n")


def random_part(path, rng, slanted=0.3):
    """Return a workpiece of 30 to 120 mm; with probability ``slanted`` it has slanted faces, else right angles."""
    mesh = slanted_mesh(rng) if rng.uniform() < slanted else stepped_mesh(rng)
    write_off(path, *mesh)
    return read_part(path, unit="mm")


def _breaks(rng, n, size):
    """``n + 1`` increasing coordinates from 0 to ``size``, no two nearer than a twelfth of it."""
    while True:
        inner = np.sort(rng.uniform(0, size, n - 1))
        out = np.r_[0.0, inner, size]
        if np.all(np.diff(out) > size / 12):
            return out


def stepped_mesh(rng):
    """Return a block with steps, slots and pockets: heights on a grid of two or three cells a side."""
    while True:
        nx, ny, nz = rng.integers(2, 4, size=3)
        xs, ys, zs = (
            _breaks(rng, n, s) for n, s in zip((nx, ny, nz), np.sort(rng.uniform(25, 100, 3))[::-1], strict=True)
        )
        heights = rng.integers(1, nz + 1, size=(nx, ny))
        heights[rng.uniform(size=(nx, ny)) < 0.1] = 0
        filled = np.zeros((nx + 2, ny + 2, nz + 2), dtype=bool)
        filled[1:-1, 1:-1, 1:-1] = np.arange(nz) < heights[..., None]
        if heights.max() == nz and (heights < nz).any() and _is_manifold(filled):
            return _boundary(filled, xs, ys, zs)


def _is_manifold(filled):
    """Return whether no two cells touch along an edge only, and all are connected."""
    f = filled
    for a, b, c, d in (
        (f[:-1, :-1], f[1:, 1:], f[1:, :-1], f[:-1, 1:]),
        (f[:-1, :, :-1], f[1:, :, 1:], f[1:, :, :-1], f[:-1, :, 1:]),
        (f[:, :-1, :-1], f[:, 1:, 1:], f[:, 1:, :-1], f[:, :-1, 1:]),
    ):
        if np.any(a & b & ~c & ~d) or np.any(c & d & ~a & ~b):
            return False
    seen, todo = set(), [tuple(np.argwhere(f)[0])]
    while todo:
        cell = todo.pop()
        if cell in seen:
            continue
        seen.add(cell)
        steps = np.r_[np.eye(3, dtype=int), -np.eye(3, dtype=int)]
        todo += [tuple(cell + step) for step in steps if f[tuple(cell + step)]]
    return len(seen) == f.sum()


def _boundary(filled, xs, ys, zs):
    """Triangles between filled and empty cells, outward."""
    index, vertices, triangles = {}, [], []

    def vertex(key):
        if key not in index:
            index[key] = len(vertices)
            vertices.append([xs[key[0]], ys[key[1]], zs[key[2]]])
        return index[key]

    for cell in np.argwhere(filled):
        for axis in range(3):
            for side in (0, 1):
                beyond = cell.copy()
                beyond[axis] += 2 * side - 1
                if filled[tuple(beyond)]:
                    continue
                u, v = (axis + 1) % 3, (axis + 2) % 3
                corners = []
                for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    key = cell - 1
                    key[axis] += side
                    key[u] += du
                    key[v] += dv
                    corners.append(vertex(tuple(key)))
                a, b, c, d = corners if side else corners[::-1]
                triangles += [(a, b, c), (a, c, d)]
    return np.array(vertices), np.array(triangles)


def slanted_mesh(rng):
    """Return a profile with steps and slants over a flat base, with a random thickness."""
    n = int(rng.integers(2, 5))
    length, height, depth = rng.uniform(50, 100), rng.uniform(20, 60), rng.uniform(15, 60)
    xs = _breaks(rng, n, length)
    top = rng.uniform(0.3, 1.0, size=(n, 2)) * height
    flat = rng.uniform(size=n) < 0.5
    flat[rng.integers(n)] = False
    top[flat, 1] = top[flat, 0]
    outline = [(0.0, 0.0), (length, 0.0)]
    for i in range(n - 1, -1, -1):
        outline += [(xs[i + 1], top[i, 1]), (xs[i], top[i, 0])]
    outline = np.array(outline)
    m = len(outline)
    ears = _ears(outline)
    vertices = np.concatenate([np.insert(outline, 1, 0.0, axis=1), np.insert(outline, 1, depth, axis=1)])
    after = (np.arange(m) + 1) % m
    sides = [t for i, j in enumerate(after) for t in ((i, j + m, j), (i, i + m, j + m))]
    caps = [t for a, b, c in ears for t in ((a, b, c), (c + m, b + m, a + m))]
    return vertices, np.array(sides + caps)


def _ears(outline):
    """Triangles of a simple polygon, counter-clockwise."""
    left, out = list(range(len(outline))), []

    def cross(a, b, c):
        (ax, ay), (bx, by), (cx, cy) = outline[a], outline[b], outline[c]
        return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)

    while len(left) > 3:
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            others = [p for p in left if p not in (a, b, c)]
            if cross(a, b, c) > 1e-9 and not any(
                cross(a, b, p) >= -1e-9 and cross(b, c, p) >= -1e-9 and cross(c, a, p) >= -1e-9 for p in others
            ):
                out.append((a, b, c))
                left.pop(k)
                break
        else:
            raise AssertionError("no ear")
    return [*out, tuple(left)]
