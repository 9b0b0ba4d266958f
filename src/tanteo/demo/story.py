"""One part of twelve on a table: what the camera leaves open, what a beam settles, and how many readings that takes."""

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

from tanteo.active import Probe, Start, Stop, around, from_hypotheses, policy_named
from tanteo.answers import Priors, box_corners
from tanteo.catalogue import read_parts
from tanteo.hand import Workspace
from tanteo.inference import PreparedPart, prepare
from tanteo.io import read_camera, read_image, read_marks, write_image
from tanteo.lie import SE3, SO3
from tanteo.parts import Part
from tanteo.sensors import NoiseLaw
from tanteo.session import Action, Sensing, Session
from tanteo.typing import Transforms

if TYPE_CHECKING:
    from tanteo.vision import Sighting

_IMAGE, _NOISE, _TOLERANCE, _MOST = "twins", 3e-4, 5e-4, 25
_LASER = Probe(
    "laser", NoiseLaw.of(_NOISE), max_range=0.3, standoff=0.1, clearance=0.01, approach=np.array([0.0, 0.0, -1.0]),
    cone=np.radians(80.0), workspace=Workspace.above(0.0),
)  # fmt: skip
NEEDED = "readings_needed.csv"
"""Readings that each try of ``benchmarks/demo.py`` needed."""


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """What came out.

    Attributes:
        session: that found it.
        truth: name of the part that lay there.
        off: how far the worst corner is off [m].
        needed: readings in many tries, planned and at random, in words; None without the camera's start.
        picture: the camera's image with what was seen, as a PNG file; None without the camera.
    """

    session: Session
    truth: str
    off: float
    needed: tuple[str, str] | None
    picture: bytes | None = None


def tell(say: Callable[[str], None], seed: int = 0) -> Observation:
    """Run the story and say it line by line.

    Args:
        say: takes one line.
        seed: of the readings' noise.
    """
    with resources.as_file(resources.files("tanteo.demo")) as folder:
        parts = read_parts([folder / "parts"], unit="mm").parts
        name, T = _truth(folder)
        say(f"One of {len(parts)} parts lies on a table. Which one, and where?")
        targets = {part.name: prepare(part) for part in parts}
        seen = bool(find_spec("cv2"))
        start, picture = _seen(folder, parts, targets, say) if seen else (_placed(targets, T, name, say), None)
    say("")
    say("A laser (0.3 mm, from above) is sent where it tells most:")
    session = _session(start, "information", seed)
    _sense(session, targets[name], T, seed, say)
    answer = session.answer()
    say("")
    say(answer.message)
    moved = SE3.inverse(T) @ answer.hypotheses[0].T_world_part
    corners = box_corners(targets[name].part)
    off = np.linalg.norm(SE3.apply(moved, corners) - corners, axis=1).max()
    say(f"It was {name}, and the corner farthest off is {1e3 * off:.2f} mm from the truth.")
    planned, random = needed()
    tries = f" In {planned.tries} tries the plan needed {planned}, random places {random}." if seen else ""
    say(f"Readings: {session.count}.{tries}")
    return Observation(session, name, float(off), (str(planned), str(random)) if seen else None, picture)


@dataclass(frozen=True, slots=True)
class Needed:
    """Readings that the story needed in many tries, with one way to choose them.

    Attributes:
        counts: of each try, sorted; those that did not end have the most that was allowed.
    """

    counts: tuple[int, ...]

    @property
    def tries(self) -> int:
        """How many."""
        return len(self.counts)

    def __str__(self) -> str:
        low, median, high = (self.counts[round(share * (self.tries - 1))] for share in (0.05, 0.5, 0.95))
        most = f"{high} or more" if high == _MOST else f"{high}"
        return f"{median} ({low} to {most} in nine of ten)"


def needed() -> tuple[Needed, Needed]:
    """What ``benchmarks/demo.py`` counted: of planned readings, and of random places."""
    text = resources.files("tanteo.demo").joinpath(NEEDED).read_text(encoding="utf-8")
    rows = list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))
    planned, random = (Needed(tuple(sorted(int(row[k]) for row in rows))) for k in ("planned", "random"))
    return planned, random


def try_it(policy: str, seeds: Sequence[int]) -> list[int]:
    """Readings that the story needs with a policy, by the seed of their noise."""
    with resources.as_file(resources.files("tanteo.demo")) as folder:
        parts = read_parts([folder / "parts"], unit="mm").parts
        name, T = _truth(folder)
        targets = {part.name: prepare(part) for part in parts}
        start, _ = _seen(folder, parts, targets, lambda _: None)
    counts = []
    for seed in seeds:
        session = _session(start, policy, seed)
        _sense(session, targets[name], T, seed, None)
        counts.append(session.count)
    return counts


def _truth(folder: Path) -> tuple[str, Transforms]:
    with open(folder / "truth.csv", encoding="utf-8", newline="") as stream:
        row = next(r for r in csv.DictReader(stream) if r["image"] == _IMAGE)
    q = np.array([float(row[k]) for k in ("qw", "qx", "qy", "qz")])
    p = np.array([float(row[k]) for k in ("x_mm", "y_mm", "z_mm")]) / 1e3
    return row["part"], SE3.from_parts(SO3.from_quaternion(q / np.linalg.norm(q)), p)


def _seen(
    folder: Path, parts: tuple[Part, ...], targets: dict[str, PreparedPart], say: Callable[[str], None]
) -> tuple[Start, bytes]:
    """What the camera leaves open, and its image with what was seen."""
    from tanteo.vision import draw_sight, fit_camera, prepare_vision, see_table

    camera = read_camera(folder / "camera.yaml")
    placed = fit_camera(camera, *read_marks(folder / "marks.csv"))
    camera = replace(camera, T_world_camera=placed.T_world_camera, covariance=placed.covariance)
    image = read_image(folder / f"{_IMAGE}.png")
    sight = see_table(image, camera, [prepare_vision(part) for part in parts])
    answer = sight.objects[0].answer
    likely = [h for h in answer.hypotheses if h.probability > 1e-3]
    words = ", ".join(f"{h.part} ({100 * h.probability:.0f} %)" for h in likely)
    say(f"The camera above it: {words}; largest corner sd {1e3 * likely[0].corner_sd:.1f} mm.")
    names = list(dict.fromkeys(h.part for h in answer.hypotheses))
    start = from_hypotheses(answer.hypotheses, [targets[n] for n in names], Priors())
    return start, _as_png(_cut(draw_sight(image, camera, sight), sight.objects[0]))


_ENLARGED = 2
"""Times that :func:`tanteo.vision.draw_sight` draws an image enlarged."""


def _cut(picture: np.ndarray, seen: Sighting) -> np.ndarray:
    """The picture about what was seen in it, with its name."""
    if seen.region is None:
        return picture
    low, high = _ENLARGED * seen.region.contour.min(axis=0), _ENLARGED * seen.region.contour.max(axis=0)
    middle, half = (low + high) / 2, float((high - low).max())
    (left, top), (right, bottom) = np.maximum(middle - half, 0).astype(int), (middle + half).astype(int)
    return picture[top:bottom, left:right]


def _as_png(picture: np.ndarray) -> bytes:
    with TemporaryDirectory() as folder:
        write_image(path := Path(folder) / "seen.png", picture)
        return path.read_bytes()


def _placed(targets: dict[str, PreparedPart], T: Transforms, name: str, say: Callable[[str], None]) -> Start:
    """Without OpenCV: a feeder that puts parts down to some millimetres and degrees."""
    say("No camera (the extra 'vision' is not installed): a feeder puts parts here, to 5 mm and 6 degrees.")
    place = T @ SE3.from_parts(np.eye(3), targets[name].part.centroid)
    return around(list(targets.values()), place, np.diag(np.repeat([5e-3, 0.1], 3) ** 2))


def _session(start: Start, policy: str, seed: int) -> Session:
    stop = Stop(probability=0.99, tolerance=_TOLERANCE, confidence=0.95, least_gain=0.0, max_measurements=_MOST)
    return Session(start, _LASER, Sensing(sd=_NOISE), policy_named(policy), stop, seed)


def _sense(session: Session, target: PreparedPart, T: Transforms, seed: int, say: Callable[[str], None] | None) -> None:
    """Ask and tell, with ranges by rays on the part that is truly there."""
    rng, to_part = np.random.default_rng((1991, seed)), SE3.inverse(T)
    while isinstance(action := session.ask(), Action):
        start, along = SE3.apply(to_part, action.origin), to_part[:3, :3] @ action.direction
        distance = float(target.surface.cast(start[None], along[None]).distances[0])
        step = session.tell(action.read(distance + _NOISE * rng.normal() if np.isfinite(distance) else np.inf))
        if say is not None:
            best = int(np.argmax(step.probabilities))
            read = f"{1e3 * distance:6.1f} mm" if np.isfinite(distance) else "  nothing"
            say(
                f"  {session.count:2d}  {action.part} {action.face:8} {read}   {session.start.targets[best].part.name} "
                f"{100 * step.probabilities[best]:5.1f} %, largest corner sd {1e3 * step.corner_sd:.2f} mm"
            )
