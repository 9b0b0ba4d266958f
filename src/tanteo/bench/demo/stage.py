"""The scene of the story: one part of twelve on a table, what a camera leaves open, and a laser."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from tanteo.catalogue import read_parts
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, Transforms, Vectors
from tanteo.hand import Workspace
from tanteo.hand.simulator import Solid
from tanteo.io import read_camera, read_image, read_marks, write_image
from tanteo.parts import Part
from tanteo.planning import Action, Probe, Sensing, Session, Stop
from tanteo.planning.execution import seen_start
from tanteo.planning.policies import policy_named
from tanteo.planning.start import Start
from tanteo.posterior import Hypothesis, PreparedPart, Priors, prepare
from tanteo.sensors import Readings
from tanteo.sensors.error_states import Drift, Form, Scale
from tanteo.sensors.presets import NoiseLaw

if TYPE_CHECKING:
    from tanteo.vision import Camera, Sighting

_IMAGE, _NOISE = "twins", 3e-4
KEPT = "hypotheses.csv"
"""File of the image's hypotheses."""
MOST = 25
"""Readings at most."""
_EXACT = Scale(1e-9), Drift(1e-9), Form(1e-9)
"""Scale, drift and warp of the simulated arm and part, which has none."""

_LASER = Probe(
    "laser", NoiseLaw.of(_NOISE), max_range=0.3, standoff=0.1, clearance=0.01, approach=np.array([0.0, 0.0, -1.0]),
    cone=np.radians(80.0), workspace=Workspace.above(0.0),
)  # fmt: skip
STOP = Stop(probability=0.99, tolerance=5e-4, confidence=0.95, least_gain=0.0, max_measurements=MOST)
"""The goal of the story."""


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What the camera saw.

    Attributes:
        image: its file.
        likely: the answers that it leaves open, the likeliest first.
        found: the image with what was found in it, as a PNG file.
        likenesses: the image beside what the camera would see of the two likeliest parts, as a PNG file.
        toward: direction from the part to the camera, world.
    """

    image: Path
    likely: tuple[Hypothesis, ...]
    found: bytes
    likenesses: bytes
    toward: Vectors


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """Scene of the demo: candidate parts, the true part and its pose, and the knowledge before the first reading.

    Attributes:
        targets: candidate parts by name.
        truth: name of the true part.
        T_world_part: true pose of the part ``(4, 4)``.
        start: prior poses of each candidate before the first reading.
        seen: answer of the camera; None without a camera.
    """

    targets: dict[str, PreparedPart]
    truth: str
    T_world_part: Transforms
    start: Start
    seen: Seen | None

    @property
    def solid(self) -> Solid:
        """What truly lies there, in the world."""
        part = self.targets[self.truth].part
        return Solid.at(self.truth, part.vertices, part.triangles, self.T_world_part)

    def session(self, policy: str, seed: int, stop: Stop = STOP) -> Session:
        """Return a new session."""
        return Session(self.start, _LASER, Sensing(sd=_NOISE, shared_errors=_EXACT), policy_named(policy), stop, seed)

    def reader(self, seed: int) -> Callable[[Action], Readings]:
        """Return the simulated laser: rays on the true part, with noise from the seed."""
        rng, target = np.random.default_rng((1991, seed)), self.targets[self.truth]

        def read(action: Action) -> Readings:
            distance = range_on(target, self.T_world_part, action)
            return action.read(distance + _NOISE * rng.normal() if np.isfinite(distance) else np.inf)

        return read


def range_on(target: PreparedPart, T_world_part: Transforms, action: Action) -> float:
    """Return the range of a beam to a part at a pose without noise [m]; infinite without a hit."""
    to_part = SE3.inverse(T_world_part)
    start, along = SE3.apply(to_part, action.origin), to_part[:3, :3] @ action.direction
    return float(target.surface.cast(start[None], along[None]).distances[0])


def set_stage() -> Stage:
    """Read parts and image; without OpenCV the hypotheses of the image are read from a file."""
    with resources.as_file(resources.files("tanteo.bench.demo")) as folder:
        parts = read_parts([folder / "parts"], unit="mm").parts
        truth, T = _truth(folder)
        targets = {part.name: prepare(part) for part in parts}
        if not find_spec("cv2"):
            return Stage(targets, truth, T, _kept_start(folder, targets), None)
        start, seen = _image_start(folder, parts, targets)
    return Stage(targets, truth, T, start, seen)


def _truth(folder: Path) -> tuple[str, Transforms]:
    with open(folder / "truth.csv", encoding="utf-8", newline="") as stream:
        row = next(r for r in csv.DictReader(stream) if r["image"] == _IMAGE)
    q = np.array([float(row[k]) for k in ("qw", "qx", "qy", "qz")])
    p = np.array([float(row[k]) for k in ("x_mm", "y_mm", "z_mm")]) / 1e3
    return row["part"], SE3.from_parts(SO3.from_quaternion(q / np.linalg.norm(q)), p)


def _kept_start(folder: Path, targets: dict[str, PreparedPart]) -> Start:
    """Return the hypotheses of the image as prior poses, from the file that ``examples/make_demo.py`` writes."""
    with open(folder / KEPT, encoding="utf-8", newline="") as stream:
        named, *rows = csv.reader(line for line in stream if not line.startswith("#"))
    assert named[0] == "part"
    numbers = np.array([row[1:] for row in rows], dtype=np.float64)
    lower, C = np.tril_indices(6), np.zeros((len(rows), 6, 6))
    C[:, lower[0], lower[1]] = C[:, lower[1], lower[0]] = numbers[:, 13:]
    Ts = SE3.from_parts(numbers[:, 1:10].reshape(-1, 3, 3), numbers[:, 10:13])
    names = list(targets)
    part = np.array([names.index(row[0]) for row in rows], dtype=np.int64)
    return Start(tuple(targets.values()), part, Ts, C, numbers[:, 0], Priors())


def write_hypotheses() -> None:
    """Write the hypotheses of the demo's image for installations without OpenCV."""
    seen = set_stage().seen
    assert seen is not None
    numbers = [f"{kind}{k}" for kind, count in (("r", 9), ("t", 3), ("c", 21)) for k in range(count)]
    lines = [
        "# hypotheses of the image [m, rad]: python examples/make_demo.py",
        ",".join(["part", "probability", *numbers]),
    ]
    for h in seen.likely:
        T, C = h.T_world_part, h.covariance[np.tril_indices(6)]
        values = (h.probability, *T[:3, :3].ravel(), *T[:3, 3], *C)
        lines.append(",".join([h.part, *(f"{v:.12g}" for v in values)]))
    (seen.image.parent / KEPT).write_text("\n".join([*lines, ""]), encoding="utf-8")


def _image_start(folder: Path, parts: Sequence[Part], targets: dict[str, PreparedPart]) -> tuple[Start, Seen]:
    """Return the prior that the camera gives, with pictures."""
    from tanteo.render import draw_sight
    from tanteo.vision import prepare_vision, see_table
    from tanteo.vision.table import fit_camera

    camera = read_camera(folder / "camera.yaml")
    placed = fit_camera(camera, *read_marks(folder / "marks.csv"))
    camera = replace(camera, T_world_camera=placed.T_world_camera, covariance=placed.covariance)
    image = read_image(folder / f"{_IMAGE}.png")
    sight = see_table(image, camera, [prepare_vision(part) for part in parts])
    hypotheses = sight.objects[0].answer.hypotheses
    names = list(dict.fromkeys(h.part for h in hypotheses))
    best = [next(h for h in hypotheses if h.part == name) for name in names[:2]]
    window = _window(sight.objects[0], image.shape)
    found = _as_png(draw_sight(image, camera, sight)[_enlarged(window[0]), _enlarged(window[1])])
    likenesses = _as_png(_likenesses(image, camera, [(targets[h.part].part, h.T_world_part) for h in best], window))
    start = seen_start(sight.objects[0], list(targets.values()))
    likely = tuple(h for h in hypotheses if h.probability > _LIKELY)
    toward = placed.T_world_camera[:3, 3] - SE3.apply(best[0].T_world_part, targets[best[0].part].part.centroid)
    return start, Seen(folder / f"{_IMAGE}.png", likely, found, likenesses, toward / np.linalg.norm(toward))


_LIKELY, _ENLARGED, _DIFFERS, _TINT = 1e-3, 2, 6.0, (230, 110, 0)
"""Least reported probability; enlargement of pictures; difference of grey levels, and its colour."""


def _window(seen: Sighting, shape: tuple[int, ...]) -> tuple[slice, slice]:
    """Return the rows and columns of the image about the found object."""
    if seen.region is None:
        return slice(0, shape[0]), slice(0, shape[1])
    low, high = seen.region.contour.min(axis=0), seen.region.contour.max(axis=0)
    middle, half = (low + high) / 2, 0.75 * float((high - low).max())
    (left, top) = np.maximum(middle - half, 0).astype(int)
    (right, bottom) = np.minimum(middle + half, shape[::-1]).astype(int)
    return slice(top, bottom), slice(left, right)


def _enlarged(span: slice) -> slice:
    return slice(_ENLARGED * span.start, _ENLARGED * span.stop)


def _likenesses(
    image: FloatArray, camera: Camera, parts: Sequence[tuple[Part, Transforms]], window: tuple[slice, slice]
) -> np.ndarray:
    """Return the image beside renderings of each part; differences are tinted in the last one."""
    from tanteo.vision import render
    from tanteo.vision.rendering import Appearance, rendered_part
    from tanteo.vision.rendering import Stage as Table

    rows, columns = window
    K = camera.K.copy()
    K[:2, 2] -= columns.start, rows.start
    near = replace(camera, K=K, size=(columns.stop - columns.start, rows.stop - rows.start))
    appearance = Appearance(noise=0.0)
    shown = [
        render(Table(near, [rendered_part(part, T)], appearance), np.random.default_rng(0))[0] for part, T in parts
    ]
    pictures = [np.repeat(np.asarray(p)[..., None], 3, axis=2) for p in (image[rows, columns], *shown)]
    if len(shown) > 1:
        pictures[-1][np.abs(shown[0] - shown[1]) > _DIFFERS] = _TINT
    large = [np.kron(p, np.ones((_ENLARGED, _ENLARGED, 1))) for p in pictures]
    gap = np.full((len(large[0]), 2 * _ENLARGED, 3), 255.0)
    return np.concatenate([piece for p in large for piece in (p, gap)][:-1], axis=1)


def _as_png(picture: np.ndarray) -> bytes:
    with TemporaryDirectory() as folder:
        write_image(path := Path(folder) / "seen.png", picture)
        return path.read_bytes()
