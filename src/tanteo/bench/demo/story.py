"""Run the demo as text: what an image leaves open, which readings decide, and how many are needed."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np

from tanteo.bench.demo.stage import MOST, STOP, Seen, Stage, range_on, set_stage
from tanteo.geometry import SE3
from tanteo.planning import Action, Session, Step
from tanteo.posterior import box_corners
from tanteo.sensors import Readings
from tanteo.words import percent

NEEDED = "readings_needed.csv"
"""Readings that each try of ``benchmarks/demo.py`` needed."""


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """Result of the demo.

    Attributes:
        session: session of the demo.
        truth: name of the true part.
        off: largest error of a corner [m].
        needed: numbers of readings in many tries as text, planned and at random; None without an image.
        seen: result of the image; None without a camera.
    """

    session: Session
    truth: str
    off: float
    needed: tuple[str, str] | None
    seen: Seen | None = None


def run_demo(emit: Callable[[str], None], seed: int = 0) -> Observation:
    """Run the demo and emit its text line by line.

    Args:
        emit: function that takes one line.
        seed: seed of the readings' noise.
    """
    assert STOP.tolerance is not None
    assert STOP.probability is not None
    stage = set_stage()
    within = f"within {1e3 * STOP.tolerance:.1f} mm at {100 * STOP.confidence:.0f} %"
    emit(f"Goal: the part with {100 * STOP.probability:.0f} %, and every corner of it {within}.")
    emit(f"One of {len(stage.targets)} parts lies on a table. Which one, and where?")
    emit("")
    _emit_image(stage, emit)
    emit("")
    emit("A laser (0.3 mm, from above, on an exact arm) measures where it is most informative:")
    session = stage.session("information", seed)
    _sense(session, stage.reader(seed), emit)
    answer = session.answer()
    emit("")
    emit(answer.message)
    corners = box_corners(stage.targets[stage.truth].part)
    moved = SE3.inverse(stage.T_world_part) @ answer.hypotheses[0].T_world_part
    off = float(np.linalg.norm(SE3.apply(moved, corners) - corners, axis=1).max())
    emit(f"It was {stage.truth}, and the corner farthest off is {1e3 * off:.2f} mm from the truth.")
    planned, random = needed()
    tries = f" In {planned.tries} tries the plan needed {planned}, random places {random}." if stage.seen else ""
    emit(f"Readings: {session.count}.{tries}")
    return Observation(session, stage.truth, off, (str(planned), str(random)) if stage.seen else None, stage.seen)


_SHOWN = 0.005
"""Smallest probability that is not printed as 0 %."""


def _by_part(names: Sequence[str], weights: Iterable[float]) -> str:
    """Return the parts with their probabilities over all of their poses, most probable first."""
    sums: dict[str, float] = {}
    for name, weight in zip(names, weights, strict=True):
        sums[name] = sums.get(name, 0.0) + float(weight)
    return ", ".join(
        f"{name} ({100 * P:.0f} %)" for name, P in sorted(sums.items(), key=lambda one: -one[1]) if P >= _SHOWN
    )


def _emit_image(stage: Stage, emit: Callable[[str], None]) -> None:
    """Emit the hypotheses of the image."""
    seen, start = stage.seen, stage.start
    if seen is None:
        words = _by_part([start.targets[k].part.name for k in start.part], start.weights)
        emit("A camera above it took an image, which was evaluated before (the extra 'vision' is not installed).")
        emit(f"It may be: {words}.")
        return
    file = Path(os.path.relpath(seen.image)) if seen.image.is_relative_to(Path.cwd()) else seen.image
    words = _by_part([h.part for h in seen.likely], [h.probability for h in seen.likely])
    emit(f"A camera above it took {file.as_posix()}.")
    emit(f"It may be: {words}; largest corner sd {1e3 * seen.likely[0].corner_sd:.1f} mm.")


@dataclass(frozen=True, slots=True)
class Needed:
    """Numbers of readings that the demo needed in many tries, with one policy.

    Attributes:
        counts: number of readings of each try, sorted; the maximum for tries that did not end.
    """

    counts: tuple[int, ...]

    @property
    def tries(self) -> int:
        """Number of tries."""
        return len(self.counts)

    def __str__(self) -> str:
        low, median, high = (self.counts[round(share * (self.tries - 1))] for share in (0.05, 0.5, 0.95))
        most = f"{high} or more" if high == MOST else f"{high}"
        return f"{median} ({low} to {most} in nine of ten)"


def needed() -> tuple[Needed, Needed]:
    """Return the counts of ``benchmarks/demo.py`` for planned readings and for random places."""
    text = resources.files("tanteo.bench.demo").joinpath(NEEDED).read_text(encoding="utf-8")
    rows = list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))
    planned, random = (Needed(tuple(sorted(int(row[k]) for row in rows))) for k in ("planned", "random"))
    return planned, random


def try_it(policy: str, seeds: Sequence[int]) -> list[int]:
    """Return the number of readings that the demo needs with a policy, for each seed."""
    stage = set_stage()
    return [_count(stage, policy, seed) for seed in seeds]


def _count(stage: Stage, policy: str, seed: int) -> int:
    session = stage.session(policy, seed)
    _sense(session, stage.reader(seed), None)
    return session.count


def _sense(session: Session, read: Callable[[Action], Readings], emit: Callable[[str], None] | None) -> None:
    """Run a session, and emit each question with its reason and result."""
    while isinstance(action := session.ask(), Action):
        question = f"  {session.count + 1:2d}  {action.aim}: {_why(session, action)}"
        readings = read(action)
        step = session.tell(readings)
        if emit is not None:
            emit(question)
            emit(f"      {_read(readings)}: {_result(session, step)}")


_DIFFER = 1e-3
"""Smallest difference of two expected ranges that is reported [m]: three times the noise."""


def _why(session: Session, action: Action) -> str:
    """Return the expected ranges of the two likeliest parts if they differ, otherwise the expected information."""
    state = session.state
    shares = state.of_parts()
    two = [int(p) for p in np.argsort(-shares, kind="stable")[:2] if shares[p] > 0]
    modes = [int(np.argmax(np.where(state.part == p, state.weights, -1.0))) for p in two]
    ranges = [range_on(state.target(k), state.poses[k], action) for k in modes]
    finite = [r if np.isfinite(r) else 1.0 for r in ranges]
    if len(two) == 2 and abs(finite[0] - finite[1]) > _DIFFER:
        words = (f"of {state.target(k).part.name} {_range(r)}" for k, r in zip(modes, ranges, strict=True))
        return f"it would read {', '.join(words)}"
    return f"it is expected to exclude most, {percent(-np.expm1(-action.gain))} of the possible poses"


def _range(distance: float) -> str:
    return f"{1e3 * distance:.1f} mm" if np.isfinite(distance) else "nothing"


def _read(readings: Readings) -> str:
    return "nothing" if readings.is_free.any() else f"{1e3 * float(readings.ranges[0]):.1f} mm"


def _result(session: Session, step: Step) -> str:
    best = int(np.argmax(step.probabilities))
    name = session.start.targets[best].part.name
    return f"{name} {100 * step.probabilities[best]:.1f} %, largest corner sd {1e3 * step.corner_sd:.2f} mm"
