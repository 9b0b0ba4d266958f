"""Simulate the readings in ``examples/readings``, which a robot would report for the parts in ``examples/parts``.

``python examples/make_readings.py [folder]``. Every file has a fixed seed and is reproducible. The comments at the head
of each file state the true part and pose, so that an answer can be checked.
"""

import sys
from pathlib import Path

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.parts import Surface, read_part

HERE = Path(__file__).parent
MARGIN = 3.0
"""Smallest distance of a touch from the border of its face and from neighbouring walls [mm]."""


class PlacedPart:
    """Part at a pose on the table; lengths in mm."""

    def __init__(self, name, position, yaw_deg):
        part = read_part(HERE / "parts" / f"{name}.step")
        self.name, self.part = name, part
        self.surface = Surface(part.vertices * 1e3, part.triangles)
        self.T = SE3.from_parts(SO3.exp(np.radians([0.0, 0.0, yaw_deg])), np.array(position, dtype=float))
        self.yaw_deg = yaw_deg

    def touches(self, normal, where, n, rng, low=(-1e3, -1e3, -1e3)):
        """Return spread-out points on one face of the part, and its outward normal, world frame.

        Args:
            normal: outward normal of the face, part frame.
            where: point in the plane of the face, part frame [mm].
            n: number of points.
            rng: random number generator.
            low: smallest coordinates of a point, part frame [mm].
        """
        normal = np.array(normal, dtype=float) / np.linalg.norm(normal)
        planes = self.part.planes
        level = abs((planes.centroids * 1e3 - np.array(where)) @ normal) < 0.01
        face = np.flatnonzero(level & (planes.normals @ normal > 0.999999))[0]
        R = SO3.frame_from_axis(normal, 2)
        start, stop = planes.boundary_start[face : face + 2]
        corners = planes.boundary[start:stop] * 1e3 @ R
        tried = rng.uniform(corners.min(axis=0), corners.max(axis=0), (400, 3)) @ R.T
        good = tried[self._clear(tried, R) & (tried >= low).all(axis=1)]
        chosen = [good[0]]
        while len(chosen) < n:  # of a few random points, the one farthest from those chosen
            some = good[rng.integers(len(good), size=8)]
            gaps = np.linalg.norm(some[:, None] - np.array(chosen), axis=-1).min(axis=1)
            chosen.append(some[np.argmax(gaps)])
        return SE3.apply(self.T, np.array(chosen)), self.T[:3, :3] @ normal

    def _clear(self, points, R):
        """Return whether a disc of radius ``MARGIN`` lies flat on the face at each point, with a free rim."""
        turns = np.radians(np.arange(0, 360, 30))
        rim = MARGIN * np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1) @ R.T
        on = points[:, None] + rim
        above = on + MARGIN * R[:, 2]
        flat = self.surface.closest(on).distances.max(axis=1) < 1e-3
        return flat & (self.surface.closest(above).distances.min(axis=1) > MARGIN - 1e-3)


class Sheet:
    """Content of a readings file."""

    def __init__(self, *story):
        self.story, self.rows = story, []

    def add(self, **columns):
        """Add one reading; a vector fills the columns whose names are joined by ``__``."""
        row = {"id": str(len(self.rows) + 1)}
        for names, value in columns.items():
            values = [value] if np.ndim(value) == 0 else value
            keys = names.split("__") if "__" in names else [names]
            row |= {k: v if isinstance(v, str) else _number(k, v) for k, v in zip(keys, values, strict=True)}
        self.rows.append(row)

    def write(self, path):
        """Write comments, header and rows."""
        header = list(self.rows[0])
        lines = [f"# {line}" for line in self.story] + [",".join(header)]
        lines += [",".join(row.get(name, "") for name in header) for row in self.rows]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def _number(column, value):
    """Return a number as text: lengths to a micrometre, others to a millionth, without minus zero."""
    digits = 3 if column.endswith("_mm") else 6
    return f"{round(float(value), digits) + 0.0:.{digits}f}"


POINT, WAY = "x_mm__y_mm__z_mm", "dx__dy__dz"
HAND = "hand_x_mm__hand_y_mm__hand_z_mm__hand_qw__hand_qx__hand_qy__hand_qz"


def probe(placed, faces, per_face, sd, seed, *story, wrong=None):
    """Return touches with a fine probe: surface points, directions of approach, and one label for each face.

    Args:
        placed: part at its pose.
        faces: normal, point and optional smallest coordinates by label, as for ``touches``.
        per_face: number of touches of each face.
        sd: standard deviation of a touch [mm].
        seed: seed of all random numbers.
        story: comment lines.
        wrong: label of the face on which the last touch is 2 mm off; None for no error.
    """
    rng = np.random.default_rng(seed)
    sheet = Sheet(*story, _truth(placed), f"touches with a standard deviation of {sd:g} mm")
    for label, (normal, where, *low) in faces.items():
        points, n = placed.touches(normal, where, per_face, rng, *low)
        for k, point in enumerate(points):
            off = 2.0 if label == wrong and k == per_face - 1 else 0.0
            sensed = point + off * n + sd * rng.normal(size=3)
            sheet.add(**{POINT: sensed, WAY: -n, "sd_mm": sd, "feature": label, "kind": "plane"})
    return sheet


def bare(placed, faces, per_face, sd, seed, *story):
    """Return touches in random order with points and directions of approach, without labels of the faces."""
    rng = np.random.default_rng(seed)
    rows = []
    for normal, where, *low in faces.values():
        points, n = placed.touches(normal, where, per_face, rng, *low)
        rows += [(point + sd * rng.normal(size=3), _looking(-n, rng, tilt_deg=20.0)[:, 2]) for point in points]
    sheet = Sheet(*story, _truth(placed), f"touches with a standard deviation of {sd:g} mm, from slanting directions")
    for k in rng.permutation(len(rows)):
        point, way = rows[k]
        sheet.add(**{POINT: point, WAY: way, "sd_mm": sd})
    return sheet


def _truth(placed):
    at = ", ".join(f"{c:g}" for c in placed.T[:3, 3])
    return f"truth: {placed.name} at ({at}) mm, rotated by {placed.yaw_deg:g} degrees about the vertical"


def ball_tip(placed, faces, per_face, sd, tip, seed, *story):
    """Return touches of a robot with a ball on a stylus: centres of the ball, and poses of the flange.

    The controller assumes that the ball is at ``tip`` in the hand. The true position has a constant offset from that.
    """
    rng = np.random.default_rng(seed)
    radius, tip = 1.5, np.array(tip)
    error = np.array([1.5, 1.5, 0.3]) * rng.normal(size=3)
    sheet = Sheet(*story, _truth(placed), f"ball of {2 * radius:g} mm; touches repeat to {sd:g} mm")
    off = ", ".join(f"{c:.2f}" for c in error)
    sheet.story += (f"offset of the ball from its nominal position: ({off}) mm in the hand's frame",)
    for label, (normal, where, *low) in faces.items():
        points, n = placed.touches(normal, where, per_face, rng, *low)
        R = _looking(-n, rng, tilt_deg=12.0)  # one attitude of the stylus for each face
        for point in points:
            centre = point + radius * n + sd * rng.normal(size=3)
            flange = centre - R @ (tip + error)
            believed = flange + R @ tip
            sheet.add(
                **{POINT: believed, "radius_mm": radius, WAY: -n, "sd_mm": sd, "feature": label, "kind": "plane"},
                **{HAND: [*flange, *SO3.as_quaternion(R)]},
            )
    return sheet


def ranges(placed, faces, per_face, seed, *story):
    """Return ranges of the laser in ``laser_rig.toml``, with the poses of the hand."""
    rng = np.random.default_rng(seed)
    mounted, bias = np.array([40.0, 0.0, 60.0]), 0.025 * rng.normal()
    sheet = Sheet(*story, _truth(placed), f"all ranges are {bias:+.3f} mm off; they repeat to 0.005 mm")
    for label, (normal, where, *low) in faces.items():
        points, n = placed.touches(normal, where, per_face, rng, *low)
        for point in points:
            R = _looking(-n, rng, tilt_deg=8.0)
            hand = point - rng.uniform(24.0, 40.0) * R[:, 2] - R @ mounted
            beam = R @ np.append(np.radians(0.1) / 2 * rng.normal(size=2), 1.0)  # random ray of its cone
            read = n @ (point - hand - R @ mounted) / (n @ beam) + bias + 0.005 * rng.normal()
            pose = [*hand, *SO3.as_quaternion(R)]
            sheet.add(**{"range_mm": read, "sensor": "laser", HAND: pose, "feature": label, "kind": "plane"})
    return sheet


def plane_log(seed, *story):
    """Return ranges of a time-of-flight sensor to a table and a wall from many poses, for ``tanteo sensor fit``.

    Its mounting differs from ``tof_rig.toml``. It reads too far by a constant and a fraction of the range, and it
    saturates at 450 mm.
    """
    rng = np.random.default_rng(seed)
    place, beam, bias, scale = np.array([1.4, 38.2, 61.7]), np.array([0.021, -0.015, 1.0]), 2.6, 0.012
    sheet = Sheet(
        *story,
        "truth: beam from (1.4, 38.2, 61.7) mm along (0.021, -0.015, 1), reads 1.012 times the range and 2.6 mm more",
        "standard deviations: 0.8 mm for each place, 1.2 mm for each reading; ranges saturate at 450 mm",
    )
    beam /= np.linalg.norm(beam)
    for label, n, level in (("table", (0.0, 0.0, 1.0), 0.0), ("wall", (0.0, -1.0, 0.0), -600.0)):
        n = np.array(n)
        for _ in range(24):
            R = _looking(-n, rng, tilt_deg=32.0)
            middle = np.array([400.0, 100.0, 250.0])
            spot = middle + rng.uniform(-150, 150, 3)
            spot += (level - spot @ n) * n
            hand = spot - R @ (place + rng.uniform(90, 480) * beam)
            d = n @ (spot - hand - R @ place) / (n @ R @ beam)
            read = (1 + scale) * d + bias + 0.8 * rng.normal() + 1.2 * rng.normal(size=6)
            pose = [*hand, *SO3.as_quaternion(R)]
            for r in np.minimum(read, 450.0):
                sheet.add(**{"range_mm": round(r), "sensor": "eye", HAND: pose, "feature": label, "kind": "plane"})
    return sheet


def _looking(direction, rng, tilt_deg):
    """Return a rotation with a random angle about z, whose z axis is the direction with a random tilt."""
    tilt = np.append(rng.normal(scale=np.radians(tilt_deg) / 2, size=2), rng.uniform(-np.pi, np.pi))
    return SO3.frame_from_axis(direction, 2) @ SO3.exp([0, 0, tilt[2]]) @ SO3.exp([tilt[0], tilt[1], 0])


class Slab:
    """Part without a CAD file: a prism over a polygon [mm], touched on its sides and its top."""

    name, yaw_deg = "a five-sided slab without a CAD file", 25.0

    def __init__(self, outline, height):
        self.outline, self.height = np.array(outline, dtype=float), height
        self.T = SE3.from_parts(SO3.exp(np.radians([0.0, 0.0, self.yaw_deg])), np.array([310.0, 80.0, 0.0]))

    def touches(self, normal, side, n, rng):
        """Return points on side number ``side`` of the polygon, or on the top for -1; ``normal`` is not used."""
        if side < 0:
            weights = rng.dirichlet(np.full(len(self.outline), 0.6), size=n)
            points = np.column_stack([weights @ self.outline, np.full(n, self.height)])
            normal = np.array([0.0, 0.0, 1.0])
        else:
            a, b = self.outline[side], self.outline[(side + 1) % len(self.outline)]
            along = a + rng.uniform(0.1, 0.9, (n, 1)) * (b - a)
            points = np.column_stack([along, rng.uniform(4, self.height - 4, n)])
            normal = np.array([b[1] - a[1], a[0] - b[0], 0.0]) / np.linalg.norm(b - a)
        return SE3.apply(self.T, points), self.T[:3, :3] @ normal


RIGHT, BACK, UP, LEFT, FRONT = (1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0)
ORIGIN = (0, 0, 0)
BRACKET = {
    "base top": (UP, (0, 0, 12)), "upright inside": (RIGHT, (12, 0, 0)), "upright outside": (LEFT, ORIGIN),
    "front": (FRONT, ORIGIN), "rib slope": ((54, 0, 60), (72, 0, 12)), "bevel": ((1, 1, 0), (120, 50, 0)),
}  # fmt: skip
MIRRORED = {label: ((-n[0], n[1], n[2]), (-p[0], p[1], p[2])) for label, (n, p) in BRACKET.items()}
STEPS = {
    "top": (UP, (0, 0, 45)), "second step": (UP, (0, 0, 30)), "riser": (LEFT, (40, 0, 0), (-9, -9, 18)),
    "front": (FRONT, ORIGIN, (40, -9, 18)), "right": (RIGHT, (100, 0, 0)), "back": (BACK, (0, 60, 0), (40, -9, 18)),
}  # fmt: skip
POST = {
    "foot top": (UP, (0, 0, 20)), "top": (UP, (0, 0, 110)), "post east": (RIGHT, (25, 0, 0)),
    "post north": (BACK, (0, 25, 0)), "post south": (FRONT, (0, -25, 0)), "foot west": (LEFT, (-45, 0, 0)),
}  # fmt: skip
RAIL = {"top": (UP, (0, 0, 50)), "front": (FRONT, ORIGIN), "back": (BACK, (0, 60, 0))}
CLAMP = {
    "top": (UP, (0, 0, 60)), "front": (FRONT, ORIGIN), "back": (BACK, (0, 50, 0)), "end": (RIGHT, (130, 0, 0)),
    "nose": ((11, 0, 26), (105, 0, 61)), "throat": (RIGHT, (45, 0, 0)), "notch": (LEFT, (20, 0, 0)),
}  # fmt: skip
WEDGE = {
    "ramp": ((45, 0, 110), (140, 0, 15)), "top": (UP, (0, 0, 60)), "front": (FRONT, ORIGIN),
    "end": (RIGHT, (140, 0, 0)), "back": (BACK, (0, 50, 0)),
}  # fmt: skip
SLAB = {"top": (UP, -1), **{f"side {k}": (UP, k) for k in range(5)}}


def make():
    """Return the content of all files by name."""
    left, right = PlacedPart("bracket_left", (420, -130, 35), 33), PlacedPart("bracket_right", (455, 60, 35), -118)
    step, post = PlacedPart("step_15mm", (380, 140, 20), -28), PlacedPart("square_post", (300, -60, 20), 71)
    rail, clamp = PlacedPart("t_slot", (350, 0, 20), 12), PlacedPart("clamp", (520, -40, 15), 140)
    wedge = PlacedPart("wedge", (410, -90, 0), 57)
    slab = Slab([(0, 0), (83, 0), (97, 41), (52, 74), (0, 58)], 37.0)
    return {
        "bracket_left": probe(left, BRACKET, 5, 0.05, 1, "six faces of an angle bracket; reading 20 is wrong by 2 mm",
                              wrong="front"),
        "bracket_right": probe(right, MIRRORED, 5, 0.05, 2, "the mirror image of the bracket"),
        "step_15mm": probe(step, STEPS | {"first step": (UP, (0, 0, 15))}, 4, 0.05, 3,
                           "stairs whose first step discriminates them from the variant"),
        "step_not_felt": probe(step, STEPS, 4, 0.05, 4, "the same stairs; the step that differs was not touched"),
        "square_post": probe(post, POST, 4, 0.05, 5, "a post with a four-fold axis of symmetry"),
        "unknown_part": probe(slab, SLAB, 4, 0.05, 6, "a part without a CAD file"),
        "too_few": probe(rail, RAIL, 4, 0.05, 7, "three faces of a rail, whose position along its length is open"),
        "clamp_ball_tip": ball_tip(clamp, CLAMP, 5, 0.1, (0.0, 0.0, 150.0), 8, "a cobot with a ball on a stylus"),
        "bracket_bare": bare(left, BRACKET, 2, 0.05, 10, "twelve touches of the bracket, without labels of the faces"),
        "wedge_ranges": ranges(wedge, WEDGE, 5, 9, "a laser on the wrist; see laser_rig.toml"),
        "plane_log": plane_log(11, "ranges of a table and a wall from 48 poses; see tof_rig.toml"),
    }  # fmt: skip


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "readings"
    folder.mkdir(parents=True, exist_ok=True)
    sheets = make()
    for name, sheet in sheets.items():
        sheet.write(folder / f"{name}.csv")
    print(f"{len(sheets)} files of readings in {folder}", file=sys.stderr)
