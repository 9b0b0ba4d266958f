"""What a question and an answer cost in a session, without and with an uncertain tip, early and after 300 readings."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from common import Table

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from sensing_scenes import LASER, located, true_range
from tanteo.geometry import SE3
from tanteo.parts import read_part
from tanteo.planning import Action, Sensing, Session, Stop, begin
from tanteo.planning.candidates import Candidates, propose
from tanteo.planning.start import Start
from tanteo.posterior import PreparedPart, Priors, prepare
from tanteo.sensors import Readings
from tanteo.words.findings import Stated

PART = Path(__file__).parents[1] / "examples" / "parts" / "bracket_left.step"
HYPOTHESES, CANDIDATES = 10, 500
TIP_SD = 1e-3, 1e-3, 3e-4
READINGS, EARLY, LATE, ABOUT = 306, 40, 300, 6
"""Readings given one by one; the two updates that are compared; the number of neighbours of each in its median."""

REPEATS = 9
PLAN_TARGET, UPDATE_TARGET, RATIO_TARGET = 15.0, 5.0, 1.3

TEXT = f"""\
One bracket at {HYPOTHESES} places of 1 mm each, laser of 0.3 mm, {CANDIDATES} candidates (a session's own number);
process time. "First": the first plan of a new session and the update after it, median of {REPEATS}. "Then": plans 2
to {READINGS // 10} of a session and the updates after them, median / worst. {EARLY} and {LATE}: {READINGS} readings
at candidates, given one by one without plans; the median of the {2 * ABOUT + 1} updates about each. The tip's offset is
one draw for the run, {1e3 * TIP_SD[0]:g} x {1e3 * TIP_SD[1]:g} x {1e3 * TIP_SD[2]:g} mm. Targets: plan
{PLAN_TARGET:g} ms, update {UPDATE_TARGET:g} ms ({PLAN_TARGET:g} ms with a tip), ratio {RATIO_TARGET:g}."""

COLUMNS = (
    "", "first plan [ms]", "first update [ms]", "then plan [ms]", "then update [ms]", f"update {EARLY} [ms]",
    f"update {LATE} [ms]", "ratio",
)  # fmt: skip


def measure() -> Table:
    target = prepare(read_part(PART))
    start = several(target)
    rows = []
    for name, tip_sd in (("without a tip", None), ("with a tip", TIP_SD)):
        sensing = Sensing(sd=float(LASER.law.const), tip_sd=tip_sd)
        first = np.median([_first(start, target, sensing) for _ in range(REPEATS + 1)][1:], axis=0)
        plans, updates = _then(start, target, sensing)
        early, late = _late(start, target, sensing)
        rows.append((
            name, *(f"{1e3 * value:.1f}" for value in first), *(_usual(values) for values in (plans, updates)),
            f"{1e3 * early:.1f}", f"{1e3 * late:.1f}", f"{late / early:.2f}",
        ))  # fmt: skip
    return Table("Plans and updates of a session", TEXT, COLUMNS, rows)


def several(target: PreparedPart) -> Start:
    """Return a start with one part at ``HYPOTHESES`` poses."""
    xi = 0.05 * np.random.default_rng(1).normal(size=(HYPOTHESES - 1, 6))
    Ts, C = SE3.exp(np.r_[[np.zeros(6)], xi]), np.tile(located(target, 1e-3), (HYPOTHESES, 1, 1))
    return Start((target,), np.zeros(HYPOTHESES, dtype=int), Ts, C, np.ones(HYPOTHESES), Priors())


def _session(start: Start, sensing: Sensing) -> Session:
    return Session(start, LASER, sensing, stop=Stop(None, 1e-6, 1 - 1e-9, 0.0, 10**6))


def _read(target: PreparedPart, T: np.ndarray, action: Action, rng: np.random.Generator) -> Readings:
    distance = true_range(target, T, action)
    if np.isfinite(distance):
        distance = max(distance + float(LASER.law.const) * rng.normal(), 1e-6)
    return action.read(distance, T_world_hand=action.T_world_probe)


def _first(start: Start, target: PreparedPart, sensing: Sensing) -> tuple[float, float]:
    session = _session(start, sensing)
    planning, action = _timed(session.ask)
    reading = _read(target, start.Ts[0], action, np.random.default_rng(0))
    return planning, _timed(lambda: session.tell(reading))[0]


def _then(start: Start, target: PreparedPart, sensing: Sensing) -> tuple[list[float], list[float]]:
    """Return the times of plans and updates of one longer session."""
    session, rng, plans, updates = _session(start, sensing), np.random.default_rng(0), [], []
    while session.count < READINGS // 10:
        planning, action = _timed(session.ask)
        if not isinstance(action, Action):
            break
        reading = _read(target, start.Ts[0], action, rng)
        updating, _ = _timed(lambda r=reading: session.tell(r))
        plans.append(planning)
        updates.append(updating)
    return plans[1:], updates[1:]


def _late(start: Start, target: PreparedPart, sensing: Sensing) -> tuple[float, float]:
    """Return the median times of the updates about the ``EARLY``th and the ``LATE``th reading."""
    session, rng = _session(start, sensing), np.random.default_rng(0)
    alone = Start((target,), np.zeros(1, dtype=int), start.Ts[:1], start.covariances[:1], np.ones(1), Priors())
    aimed = propose(begin(alone), LASER, 2 * READINGS)
    spent = []
    for k in range(READINGS):
        reading = _read(target, start.Ts[0], _towards(aimed, k % len(aimed), k + 1), rng)
        spent.append(_timed(lambda r=reading: session.tell(r))[0])
    early, late = (np.median(spent[n - 1 - ABOUT : n + ABOUT]) for n in (EARLY, LATE))
    return float(early), float(late)


def _towards(aimed: Candidates, k: int, number: int) -> Action:
    beam = aimed.origins[k], aimed.directions[k], LASER.max_range, float(aimed.ranges[k])
    return Action(number, *beam, "bracket_left", "", 0.0, Stated(""))


def _usual(values: list[float]) -> str:
    return f"{1e3 * np.median(values):.1f} / {1e3 * max(values):.1f}" if values else "-"


def _timed(work: Callable[[], object]):
    begun = time.process_time()
    out = work()
    return time.process_time() - begun, out
