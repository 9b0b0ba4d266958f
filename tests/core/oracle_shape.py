"""Shapes of the oracle: flat pieces and their outlines, what of a normal density falls into one, rays, round faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import owens_t
from scipy.stats import norm


def any_across(a):
    """Return the unit vector normal to ``a`` that the core uses, made from the axis with the least component."""
    least = np.eye(3)[np.argmin(np.abs(a))]
    out = np.cross(a, least)
    return out / np.linalg.norm(out)


@dataclass(frozen=True)
class Profile:
    """A line or circle turned about an axis."""

    point: np.ndarray
    axis: np.ndarray
    offset: float
    slope: float
    radius: float
    sign: float
    least_cosine: float

    def distance(self, p):
        """Signed distance, its gradient, and both curvatures with their directions."""
        height = (p - self.point) @ self.axis
        across = p - self.point - height * self.axis
        rho = np.linalg.norm(across)
        out = across / rho
        if self.radius == 0:
            c, s = np.cos(self.slope), np.sin(self.slope)
            far, n, second = (rho - self.offset) * c - height * s, c * out - s * self.axis, 0.0
        else:
            from_tube = (rho - self.offset) * out + height * self.axis
            tube = np.linalg.norm(from_tube)
            far, n, second = tube - self.radius, from_tube / tube, 1 / tube
        n = self.sign * n
        e = np.cross(self.axis, out)
        return self.sign * far, n, [(n @ out / rho, e), (self.sign * second, np.cross(n, e))]


@dataclass(frozen=True, eq=False)
class Flat:
    """Coplanar triangles of one face; the outline runs with the inside on its left, in the frame of u and v."""

    face: int
    normal: np.ndarray
    origin: np.ndarray
    u: np.ndarray
    v: np.ndarray
    outline: np.ndarray
    box: np.ndarray
    area: float
    triangles: list
    middles: np.ndarray
    profile: Profile | None


def flats_of(body):
    """Triangles by face and plane."""
    lengths = np.linalg.norm(body.across, axis=1)
    normals = body.across / lengths[:, None]
    planes = np.column_stack([normals, np.sum(normals * body.vertices[body.triangles[:, 0]], axis=1) / body.diagonal])
    groups, left = [], np.arange(len(lengths))
    while len(left):
        same = np.all(np.abs(planes[left] - planes[left[0]]) < 1e-7, axis=1) & (body.faces[left] == body.faces[left[0]])
        groups.append(list(left[same]))
        left = left[~same]
    return [_flat(body, rows, normals[rows[0]], 0.5 * lengths[rows].sum()) for rows in groups]


def _flat(body, rows, n, area):
    sides = [(a, b) for t in body.triangles[rows] for a, b in zip(t, np.roll(t, -1), strict=True)]
    border = [side for side in sides if side[::-1] not in set(sides)]
    u, origin = any_across(n), body.vertices[body.triangles[rows[0], 0]]
    v = np.cross(n, u)
    outline = (body.vertices[np.array(border)] - origin) @ np.stack([u, v]).T
    corners = body.vertices[body.triangles[rows]]
    box = np.stack([corners.min(axis=(0, 1)), corners.max(axis=(0, 1))])
    row = body.profile_rows[rows[0]]
    profile = None if row < 0 else Profile(body.profiles[row, :3], body.profiles[row, 3:6], *body.profiles[row, 6:])
    return Flat(body.faces[rows[0]], n, origin, u, v, outline, box, area, rows, corners.mean(axis=1), profile)


def tangent_plane(flat, p):
    """Return normal and distance of the tangent plane of the surface at the flat next to a point."""
    if flat.profile is not None:
        frame = np.stack([flat.u, flat.v])
        x = frame @ (p - flat.origin)
        corners = flat.outline.reshape(-1, 2)
        shift = (np.clip(x, corners.min(axis=0), corners.max(axis=0)) - x) @ frame
        distance, n, bends = flat.profile.distance(p + shift)
        if n @ flat.normal >= flat.profile.least_cosine:
            return n, distance - n @ shift, bends
    return flat.normal, flat.normal @ (p - flat.origin), None


def share(outline, mean, spread, seen):
    """Return the mass of a normal density in an outline: winding number minus the mass beyond each edge.

    Beyond an edge, and within the angle that it takes up, are two of Owen's T. Edges whose line, or whose nearer end
    along it, is farther than ``seen`` standard deviations are excluded; ends that are farther do not count as ends.
    """
    widest = np.sqrt(np.linalg.eigvalsh(spread)[-1])
    corners = outline.reshape(-1, 2)
    if np.any(mean < corners.min(axis=0) - seen * widest) or np.any(mean > corners.max(axis=0) + seen * widest):
        return 0.0
    a, b = ((outline[:, k] - mean) @ np.linalg.inv(np.linalg.cholesky(spread)).T for k in (0, 1))
    angles = np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], np.sum(a * b, axis=1))
    d = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    h, t1, t2 = a[:, 0] * d[:, 1] - a[:, 1] * d[:, 0], np.sum(a * d, axis=1), np.sum(b * d, axis=1)
    far = np.abs(h)
    beyond = owens_t(far, t2 / far) - owens_t(far, t1 / far)
    beyond = np.where((t1 < -seen) & (t2 > seen), norm.sf(far), beyond)
    beyond = np.where((far > seen) | (t1 > seen) | (t2 < -seen), 0.0, beyond)
    return np.clip(np.rint(angles.sum() / (2 * np.pi)) - np.sum(np.sign(h) * beyond), 0, 1)


def cast(body, origin, direction):
    """Distance to the first triangle that a ray meets, and which; by planes and sides."""
    a, b, c = body.vertices[body.triangles].transpose(1, 0, 2)
    n = body.across
    along = n @ direction
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.sum(n * (a - origin), axis=1) / along
        p = origin + t[:, None] * direction
        inside = np.ones(len(t), dtype=bool)
        for s, e in ((a, b), (b, c), (c, a)):
            inside &= np.sum(np.cross(e - s, p - s) * n, axis=1) >= -1e-12 * np.sum(n * n, axis=1)
    t = np.where(inside & (t > 0) & (along != 0), t, np.inf)
    return t.min(), int(np.argmin(t))
