"""Draw a part as a small picture for notebooks: shaded triangles and visible edges, seen from an upper corner."""

from __future__ import annotations

from html import escape

import numpy as np

from tanteo.geometry.typing import FloatArray
from tanteo.parts.part import Part
from tanteo.parts.readers.topology import mesh_edges
from tanteo.parts.shapes.surface import Surface
from tanteo.values import html_table

_MOST = 4000
"""Largest number of front triangles that are drawn: about 400 kB of SVG."""

_SIZE, _MARGIN = 240.0, 8.0
"""Size and margin of the picture [pixels]."""

_LIGHT = np.array([0.35, -0.45, 0.82])
"""Direction to the light, from above, left of the viewer."""


def part_html(part: Part) -> str:
    """Return the picture of a part and its facts for a notebook."""
    facts = part.summary()
    return part_svg(part) + html_table(part.name, list(facts), [list(facts.values())], part.source)


def part_svg(part: Part) -> str:
    """Return an SVG picture of a part, in a parallel projection along (-1, -1, -0.8) of its frame.

    Returns:
        The picture; empty if more than a few thousand triangles face the viewer.
    """
    back = np.array([1.0, 1.0, 0.8]) / np.linalg.norm([1.0, 1.0, 0.8])
    right = np.cross([0.0, 0.0, 1.0], back) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], back))
    axes = np.stack([right, -np.cross(back, right), back], axis=1)
    surface = Surface(part.vertices, part.triangles)
    seen = part.vertices @ axes
    facing = surface.normals @ back
    front = np.flatnonzero(facing > 0.0)
    if len(front) > _MOST:
        return ""
    low, high = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
    scale = (_SIZE - 2 * _MARGIN) / max(float((high - low).max()), 1e-12)
    flat = _MARGIN + (seen[:, :2] - low) * scale
    width, height = (high - low) * scale + 2 * _MARGIN
    depth = seen[part.triangles[front], 2].mean(axis=1)
    shades = np.clip(0.45 + 0.5 * surface.normals @ _LIGHT, 0.25, 0.95)
    shapes = []
    for triangle in front[np.argsort(depth)]:
        r, g, b = (int(shades[triangle] * full) for full in (196, 212, 228))
        corners = " ".join(f"{x:.1f},{y:.1f}" for x, y in flat[part.triangles[triangle]])
        shapes.append(f'<polygon points="{corners}" fill="rgb({r},{g},{b})" stroke="rgb({r},{g},{b})"/>')
    for start, end in _visible_edges(part, surface, facing, back):
        (x, y), (u, v) = (_MARGIN + ((one @ axes)[:2] - low) * scale for one in (start, end))
        shapes.append(f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{u:.1f}" y2="{v:.1f}" stroke="#22303c"/>')
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.1f} {height:.1f}"><title>{escape(part.name)}</title>{"".join(shapes)}</svg>'
    )


def _visible_edges(part: Part, surface: Surface, facing: FloatArray, back: FloatArray) -> FloatArray:
    """Return the visible pieces ``(E, 2, 3)`` of the outline and of the edges between faces."""
    edges = mesh_edges(part.triangles)
    left, right = edges.left, edges.right
    rims = (left < 0) | (right < 0)
    outline = (facing[left] > 0) != (facing[right] > 0)
    chosen = rims | outline | (part.triangle_face[left] != part.triangle_face[right])
    ends = part.vertices[edges.ends[chosen]]
    share = np.linspace(0.0, 1.0, 13)[:, None, None]
    cuts = ends[:, 0] + share * (ends[:, 1] - ends[:, 0])
    pieces = np.stack([cuts[:-1], cuts[1:]], axis=2).reshape(-1, 2, 3)
    middles = pieces.mean(axis=1) + 1e-4 * part.diagonal * back
    hits = surface.cast(middles, np.broadcast_to(back, middles.shape))
    return pieces[~np.isfinite(hits.distances)]
