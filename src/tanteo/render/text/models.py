"""Parts as lines of text: content of the CAD file, and features that can be sensed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tanteo.render.text.layout import PLAIN, Layout, printable

if TYPE_CHECKING:
    from tanteo.parts import Part
    from tanteo.parts.faces import HolePattern

_MOST_ROWS = 20


def part_lines(part: Part, *, verbose: bool = False, layout: Layout = PLAIN) -> list[str]:
    """Return a part as lines of text: faces, edges, vertices, symmetry and repairs.

    Args:
        part: part read from a CAD file.
        verbose: whether to print all rows of every table instead of the first 20.
        layout: width and style of the output.
    """
    sides = " x ".join(f"{1e3 * side:.4g}" for side in part.box[1] - part.box[0])
    low = ", ".join(f"{1e3 * v:.4g}" for v in part.box[0])
    curved = [f for f in part.faces if f.surface != "plane"]
    lines = [
        layout.bold(
            f"{printable(part.name)}: {sides} mm, {len(part.planes)} planes, {len(part.edges)} edges, "
            f"{len(part.corners)} vertices, {len(curved)} curved faces"
        ),
        f"  file      {printable(part.source)} (read in {part.unit})",
        f"  box       from ({low}) mm in the part's frame",
        f"  volume    {_volume(part)}, area {part.area * 1e4:.6g} cm2, {len(part.triangles)} triangles",
        f"  symmetry  {_symmetry(part)}",
        f"  repairs   {printable(' '.join(part.repairs)) or 'none'}",
    ]
    for title, headers, rows in _tables(part):
        if rows:
            shown = rows if verbose else rows[:_MOST_ROWS]
            lines += ["", *layout.table([title, *headers], shown)]
            if len(shown) < len(rows):
                lines.append(f"... and {len(rows) - len(shown)} more (-v shows all)")
    return lines


def _volume(part: Part) -> str:
    return f"{part.volume * 1e6:.6g} cm3" if part.closed else "none (the surface is open)"


def _tables(part: Part) -> list[tuple[str, list[str], list[list[str]]]]:
    planes, edges = part.planes, part.edges
    return [
        (
            "planar face",
            ["area cm2", "normal x", "y", "z", "centre x mm", "y", "z"],
            [
                [part.faces[f].name, f"{area * 1e4:.4g}", *_unit(n), *_mm(c)]
                for f, area, n, c in zip(planes.faces, planes.areas, planes.normals, planes.centroids, strict=True)
            ],
        ),
        (
            "edge",
            ["length mm", "interior deg", "from x mm", "y", "z", "to x mm", "y", "z"],
            [
                [str(i), f"{1e3 * length:.4g}", f"{np.degrees(angle):.1f}", *_mm(ends[0]), *_mm(ends[1])]
                for i, (length, angle, ends) in enumerate(zip(edges.lengths, edges.dihedrals, edges.ends, strict=True))
            ],
        ),
        ("vertex", ["x mm", "y", "z"], [[str(i), *_mm(p)] for i, p in enumerate(part.corners.points)]),
        (
            "curved face",
            ["surface", "area cm2", "radius mm", "half angle deg", "side", "centre x mm", "y", "z"],
            [
                [
                    f.name,
                    f.surface,
                    f"{f.area * 1e4:.4g}",
                    "" if f.radius is None else f"{1e3 * f.radius:.4g}",
                    "" if f.half_angle is None else f"{np.degrees(f.half_angle):.4g}",
                    {True: "outer", False: "inner", None: ""}[f.convex],
                    *([""] * 3 if f.surface == "cylinder" or f.axis_point is None else _mm(f.axis_point)),
                ]
                for f in part.faces
                if f.surface != "plane"
            ],
        ),
        *_holes(part),
    ]


def _holes(part: Part) -> list[tuple[str, list[str], list[list[str]]]]:
    """Return holes, bosses and patterns of holes."""
    from tanteo.parts import round_features
    from tanteo.parts.faces import hole_patterns  # slow to import

    return [
        (
            "hole or boss",
            ["diameter mm", "length mm", "", "axis x", "y", "z", "to x mm", "y", "z", "faces", "residual um"],
            [
                [
                    one.name, " to ".join(dict.fromkeys(f"{2e3 * r:.4g}" for r in one.radii)),
                    f"{1e3 * one.length:.4g}",
                    {True: "through", False: "blind", None: ""}[one.through], *_unit(one.axis), *_mm(one.ends[1]),
                    ", ".join(map(str, one.faces)), f"{round(1e6 * one.residual, 3):.3g}",
                ]
                for one in round_features(part)
            ],
        ),
        (
            "pattern",
            ["holes", "diameter mm", "", "centre x mm", "y", "z"],
            [[p.kind, ", ".join(map(str, p.holes)), f"{2e3 * p.hole_radius:.4g}", _size(p), *_mm(p.centre)]
             for p in hole_patterns(part)],
        ),
    ]  # fmt: skip


def _size(pattern: HolePattern) -> str:
    if pattern.radius is not None:
        return f"circle of {2e3 * pattern.radius:.5g} mm"
    return " x ".join(f"{1e3 * step:.4g}" for step in pattern.steps) + (" mm" if pattern.steps else "")


def _symmetry(part: Part) -> str:
    group = part.symmetry
    if group.spherical:
        return "every rotation about the centre maps it onto itself"
    if group.axis is not None:
        direction = ", ".join(_unit(group.axis[1]))
        return f"solid of revolution about ({direction})" + (", equal ends" if group.order > 1 else "")
    return "none" if group.order == 1 else f"{group.order} rotations map it onto itself"


def _mm(p: np.ndarray) -> list[str]:
    return [f"{1e3 * v:.2f}" for v in p]


def _unit(v: np.ndarray) -> list[str]:
    # adding zero turns -0.000 into 0.000
    return [f"{x + 0.0:.3f}" for x in np.round(v, 3)]
