"""Draw ``docs/pictures/from_readings_to_answer.svg`` from ``examples/readings/bracket_left.csv``.

``python docs/pictures/make_pictures.py [folder]``. The touches, the fitted planes, the constraints
and the answer are computed by the program.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

import tanteo
from tanteo.features import relate_all
from tanteo.fitting import fit_labelled
from tanteo.geometry import SE3
from tanteo.sensors import measure

HERE = Path(__file__).resolve().parent
EXAMPLES = HERE.parents[1] / "examples"
INK, GREY, RED, BLUE, GREEN, PAPER = "#22303c", "#5c6873", "#c8372d", "#2467a8", "#2e7d4f", "#ffffff"
COLORS = ("#0072b2", "#e69f00", "#2dae5b", "#7d12d9", "#6ec3ff", "#602404")  # as on the live page
WIDTH, HEIGHT = 1280, 470
"""Default size of a picture [px]."""

PANEL = np.array([408.0, 366.0])
GAP, EDGE = 20, 16
"""Gap between panels, and margin of the page [px]."""

EYE = np.array([1.0, -0.82, 0.72]) / np.linalg.norm([1.0, -0.82, 0.72])
RIGHT = np.cross([0, 0, 1], EYE) / np.linalg.norm(np.cross([0, 0, 1], EYE))
UP = np.cross(EYE, RIGHT)
SCALE = 1.42
"""Pixels per millimetre."""

MAGNIFIED = 150
"""Magnification of the answer's error ellipses, which are drawn at two standard deviations."""


class Drawing:
    """SVG elements, in the order in which they are painted."""

    def __init__(self, width: float = WIDTH, height: float = HEIGHT) -> None:
        self.elements: list[str] = []
        self.width, self.height = width, height

    def add(self, tag: str, content: str = "", **attributes: object) -> None:
        """Add an element; underscores in names of attributes become hyphens."""
        text = " ".join(f'{k.replace("_", "-")}="{v}"' for k, v in attributes.items())
        self.elements.append(f"<{tag} {text}>{content}</{tag}>" if content else f"<{tag} {text}/>")

    def text(self, x: float, y: float, words: str, size: int = 15, fill: str = INK, **attributes: object) -> None:
        """Draw a line of text."""
        words = words.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
        self.add("text", words, x=f"{x:.1f}", y=f"{y:.1f}", font_size=size, fill=fill, **attributes)

    def line(self, a: np.ndarray, b: np.ndarray, stroke: str = INK, width: float = 1.4, **attributes: object) -> None:
        """Draw a line between two points of the page."""
        ends = {"x1": a[0], "y1": a[1], "x2": b[0], "y2": b[1]}
        self.add("line", **{k: f"{v:.1f}" for k, v in ends.items()}, stroke=stroke, stroke_width=width, **attributes)

    def polygon(self, points: np.ndarray, **attributes: object) -> None:
        """Draw a closed outline."""
        self.add("polygon", points=" ".join(f"{x:.1f},{y:.1f}" for x, y in points), **attributes)

    def write(self, path: Path, title: str) -> None:
        """Write the file."""
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self.width:g} {self.height:g}" role="img" '
            f'font-family="DejaVu Sans, Helvetica, Arial, sans-serif">\n<title>{title}</title>'
        )
        path.write_text("\n".join([head, *self.elements, "</svg>\n"]), encoding="utf-8", newline="\n")


def corner(panel: int) -> np.ndarray:
    """Return the upper left corner of one of the four panels [px]."""
    return EDGE + np.array([panel % 2, panel // 2]) * (PANEL + GAP)


def page(points: np.ndarray, panel: int) -> np.ndarray:
    """Return points of the part [m] projected to one of the four panels [px]."""
    centred = (np.asarray(points) * 1e3 - [54, 40, 36]) * SCALE
    origin = corner(panel) + np.array([PANEL[0] / 2, 178])
    return origin + np.stack([centred @ RIGHT, -(centred @ UP)], axis=-1)


def draw_part(out: Drawing, part: tanteo.Part, panel: int, pale: float = 0.0) -> None:
    """Draw the faces toward the viewer, far ones first; ``pale`` from 0 to 1."""
    normals, faces = part.planes.normals, part.planes.faces
    facing = [k for k in range(len(faces)) if normals[k] @ EYE > 1e-6]
    ends = page(part.edges.ends, panel)
    for k in sorted(facing, key=lambda k: float(part.planes.centroids[k] @ EYE)):
        light = 0.80 + 0.18 * float(normals[k] @ np.array([0.25, -0.35, 0.90]))
        shade = blend([232 * light, 238 * light, 244 * light], pale)
        for triangle in part.vertices[part.triangles[part.triangle_face == faces[k]]]:
            out.polygon(page(triangle, panel), fill=shade, stroke=shade, stroke_width=0.8)
        for e in np.flatnonzero((part.edges.faces == faces[k]).any(axis=1)):
            out.line(ends[e, 0], ends[e, 1], stroke=blend([91, 104, 115], pale), width=1.1)


def blend(rgb: list[float], pale: float) -> str:
    """Return a colour mixed with the white of the panel."""
    return "#" + "".join(f"{int(c + pale * (252 - c)):02x}" for c in rgb)


def draw_readings(
    out: Drawing, points: np.ndarray, features: list[str], ids: list[str], wrong: tuple[str, ...]
) -> None:
    """Draw touches in the colour of their label, outliers as crosses."""
    hue = dict(zip(dict.fromkeys(features), COLORS, strict=True))
    for p, label, name in zip(page(points, 0), features, ids, strict=True):
        if name in wrong:
            for slant in (1, -1):
                arm = np.array([6, 6 * slant])
                out.line(p - arm, p + arm, stroke=RED, width=2.6)
        else:
            hidden = label == "upright outside"
            fill = PAPER if hidden else hue[label]
            out.add("circle", cx=f"{p[0]:.1f}", cy=f"{p[1]:.1f}", r=4, fill=fill, stroke=hue[label], stroke_width=1.6)


def draw_planes(out: Drawing, features: list[tanteo.features.Feature], T_part_world: np.ndarray) -> None:
    """Draw each sensed plane as a patch over its points, with its normal."""
    order = sorted(
        range(len(features)), key=lambda k: float(SE3.apply(T_part_world, features[k].support).mean(0) @ EYE)
    )
    for k in order:
        f, hue = features[k], COLORS[k]
        T = T_part_world @ f.T_world_feature
        local = SE3.apply(SE3.inverse(T), SE3.apply(T_part_world, f.support))
        low, high = local[:, :2].min(axis=0) - 3e-3, local[:, :2].max(axis=0) + 3e-3
        corners = np.array([[low[0], low[1], 0], [high[0], low[1], 0], [high[0], high[1], 0], [low[0], high[1], 0]])
        out.polygon(page(SE3.apply(T, corners), 1), fill=hue, fill_opacity=0.22, stroke=hue, stroke_width=1.3)
        foot, tip = page(SE3.apply(T, np.array([[0, 0, 0], [0, 0, 0.024]])), 1)
        arrow(out, foot, tip, hue)


def arrow(out: Drawing, a: np.ndarray, b: np.ndarray, stroke: str, width: float = 2.0) -> None:
    """Draw a line with an arrowhead."""
    along = (b - a) / np.linalg.norm(b - a)
    across = np.array([-along[1], along[0]])
    out.line(a, b - 5 * along, stroke=stroke, width=width)
    out.polygon(np.array([b, b - 9 * along + 4 * across, b - 9 * along - 4 * across]), fill=stroke)


def draw_pairs(out: Drawing, features: list[tanteo.features.Feature], hypotheses: list[tuple[str, str, bool]]) -> None:
    """Draw some constraints with their standard deviations, and the result of the search for each candidate."""
    x, y0 = corner(2)
    table = {c.labels: c for c in relate_all(features) if c.kind.name in ("plane_angle", "plane_offset")}
    chosen = [
        ("upright inside", "upright outside"), ("upright inside", "rib slope"), ("base top", "front"),
        ("upright inside", "bevel"),
    ]  # fmt: skip
    out.text(x + 14, y0 + 82, "pairs of features, with one sd", 15, GREY)
    for row, labels in enumerate(chosen):
        c = table[labels]
        length = c.kind.units == ("m",)
        value, sd = (1e3 * c.value[0], 1e3 * c.covariance[0, 0] ** 0.5) if length else np.degrees(
            [c.value[0], c.covariance[0, 0] ** 0.5]
        )  # fmt: skip
        words = f"{abs(value):.2f} ± {sd:.2f} {'mm' if length else '°'}"
        y = y0 + 106 + 22 * row
        for k, label in enumerate(labels):
            hue = COLORS[[f.label for f in features].index(label)]
            out.add("rect", x=x + 14 + 22 * k, y=y - 11, width=17, height=12, fill=hue, fill_opacity=0.35, stroke=hue)
        out.text(x + 70, y, words, 15)
        out.text(x + 220, y, "distance" if length else "angle", 15, GREY)
    out.text(x + 14, y0 + 204, "every part, in every pose", 15, GREY)
    root = np.array([x + 24.0, y0 + 276])
    for row, (name, words, possible) in enumerate(hypotheses):
        y = y0 + 228 + 24 * row
        colour = GREEN if possible else RED
        out.line(root, np.array([x + 58.0, y]), stroke=GREY, width=1.3)
        out.text(x + 64, y + 5, "✓" if possible else "✗", 17, colour, font_weight="bold")
        out.text(x + 88, y + 5, name, 15, INK if possible else GREY)
        out.text(x + 220, y + 5, words, 15, GREY)
    out.add("circle", cx=root[0], cy=root[1], r=5, fill=INK)


def draw_answer(out: Drawing, part: tanteo.Part, covariance: np.ndarray) -> None:
    """Draw the part at its pose, with the error ellipses of its corners."""
    draw_part(out, part, 3)
    R = np.stack([RIGHT, -UP])
    corners = part.corners.points
    far = corners[
        [np.argmin(np.linalg.norm(corners * 1e3 - c, axis=1)) for c in ([0, 0, 90], [120, 0, 0], [90, 80, 12])]
    ]
    for p in far:
        J = np.hstack([np.eye(3), -np.cross(np.eye(3), p)])
        J[:, 3:] = np.array([[0, p[2], -p[1]], [-p[2], 0, p[0]], [p[1], -p[0], 0]])
        values, vectors = np.linalg.eigh(R @ J @ covariance @ J.T @ R.T)
        rx, ry = 2 * MAGNIFIED * SCALE * 1e3 * np.sqrt(values[::-1])
        turn = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
        cx, cy = page(p, 3)
        place = f"translate({cx:.1f} {cy:.1f}) rotate({turn:.1f})"
        out.add("ellipse", rx=f"{rx:.1f}", ry=f"{ry:.1f}", transform=place, fill=RED, fill_opacity=0.28, stroke=RED)
    origin = page(np.zeros(3), 3)
    for axis, name in zip(np.eye(3) * 0.042, "xyz", strict=True):
        end = page(axis, 3)
        arrow(out, origin, end, BLUE, 2.6)
        out.text(
            *(end + 6 * (end - origin) / np.linalg.norm(end - origin) + [-4, 4]), name, 14, BLUE, font_weight="bold"
        )


def frame(out: Drawing) -> None:
    """Draw panels, titles and the arrows between them."""
    out.add("rect", width=out.width, height=out.height, fill=PAPER, rx=10)
    titles = [
        ("1  Readings", "from the robot: points, noise, labels"),
        ("2  Features", "planes with covariance, fitted to the points"),
        ("3  Constraints, parts", "joint test of every part and pose"),
        ("4  Answer", "part, pose, covariance, probability"),
    ]
    for k, (title, words) in enumerate(titles):
        x, y = corner(k)
        width, height = PANEL
        out.add("rect", x=x, y=y, width=width, height=height, rx=8, fill="#fbfcfd", stroke="#d5dbe0")
        out.text(x + 14, y + 29, title, 20, font_weight="bold")
        out.text(x + 14, y + 52, words, 15, GREY)
    for left in (0, 2):
        start = corner(left) + np.array([PANEL[0] - 3, 24])
        arrow(out, start, start + np.array([GAP + 6, 0]), INK, 2.4)
    middle = corner(2)[1] - GAP / 2  # back to the next row
    x1, x2 = corner(1)[0] + 80, corner(2)[0] + PANEL[0] / 2
    turns = [np.array(p) for p in ((x1, middle - GAP / 2 - 3), (x1, middle), (x2, middle))]
    for a, b in pairwise(turns):
        out.line(a, b, stroke=INK, width=2.4)
    arrow(out, turns[-1], np.array([x2, middle + GAP / 2 + 3]), INK, 2.4)


def make(path: Path) -> None:
    """Compute and draw the picture."""
    parts = tanteo.read_parts(EXAMPLES / "parts").parts
    readings = tanteo.read_readings(EXAMPLES / "readings" / "bracket_left.csv")
    answer = tanteo.identify(readings, parts)
    best = answer.hypotheses[0]
    part = next(p for p in parts if p.name == best.part)
    measured = measure(readings)
    labelled = fit_labelled(measured)
    features = [f for f in labelled.features if isinstance(f, tanteo.features.Feature)]
    T_part_world = SE3.inverse(best.T_world_part)
    out = Drawing(*(2 * EDGE + 2 * PANEL + GAP))
    frame(out)
    draw_part(out, part, 0, pale=0.35)
    draw_part(out, part, 1, pale=0.8)
    points = SE3.apply(T_part_world, measured.points)
    draw_readings(out, points, list(measured.features), list(measured.ids), labelled.rejected)
    draw_planes(out, features, T_part_world)
    draw_pairs(
        out,
        features,
        [
            ("bracket_left", "fits", True),
            ("bracket_right", "mirror image", False),
            ("step_15mm", "no such angle", False),
            ("9 more", "", False),
            ("unknown object", "", False),
        ],
    )
    draw_answer(out, part, best.covariance)
    captions = {0: [], 1: [], 3: []}  # lines at the foot of a panel: words, colour, weight
    captions[0] += [("hollow: on the far side", GREY), (f"{len(readings)} touches of 6 faces, sd 0.05 mm", INK)]
    captions[0].append((f"✗ reading {', '.join(labelled.rejected)} is 2 mm off: found, excluded", RED))
    height = 1e3 * np.sqrt(features[0].P[0, 0])
    tilt = 1e3 * np.sqrt(features[0].P[1, 1])
    captions[1] += [("one plane per label, outward normal", INK)]
    captions[1] += [(f"e.g. height ± {height:.3f} mm, tilt ± {tilt:.1f} mrad (1 sd)", INK)]
    at = " ".join(f"{c:.2f}" for c in 1e3 * best.T_world_part[:3, 3])
    sure = "more than 99.9 %" if best.probability > 0.999 else f"{100 * best.probability:.1f} %"
    captions[3] += [
        (f"{best.part}, {sure}, at {at} mm", GREEN),
        (f"largest corner sd {1e3 * best.corner_sd:.3f} mm", INK),
    ]
    captions[3] += [(f"red: 2 sd of corners, enlarged {MAGNIFIED} times", GREY)]
    for k, lines in captions.items():
        x, y = corner(k) + np.array([14, PANEL[1] - 14 - 22 * (len(lines) - 1)])
        for row, (words, colour) in enumerate(lines):
            out.text(x, y + 22 * row, words, 15, colour)
    out.write(path, "From touches of a bracket to the part, its pose and the covariance of the pose")


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE
    folder.mkdir(parents=True, exist_ok=True)
    make(folder / "from_readings_to_answer.svg")
