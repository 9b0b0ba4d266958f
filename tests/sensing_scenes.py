"""A part that is really there, and sessions that sense it by true rays with drawn errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tanteo.active import Probe, Stop, around, corner_distances, policy_named
from tanteo.lie import SE3
from tanteo.sensors.law import NoiseLaw
from tanteo.session import Action, Sensing, Session

LASER = Probe("laser", NoiseLaw.of(3e-4), max_range=0.3, standoff=0.1)
FLIGHT = Probe("time of flight", NoiseLaw.of(3e-3), max_range=0.6, standoff=0.2)
PLACE_SD = 0.015, 0.15
"""How roughly the place of a part is known: each axis [m], about each axis [rad]."""


def rough(targets, sd=PLACE_SD, priors=None):
    """The parts about the world's origin."""
    return around(targets, np.eye(4), np.diag(np.repeat(sd, 3)) ** 2, priors)


def drawn_truth(start, rng, part=None):
    """A part and a pose from what the start assumes."""
    k = int(rng.integers(len(start))) if part is None else int(np.flatnonzero(start.part == part)[0])
    xi = np.linalg.cholesky(start.covariances[k]) @ rng.normal(size=6)
    return int(start.part[k]), start.Ts[k] @ SE3.exp(xi)


def true_range(target, T, action):
    """How far the part is along the action's beam [m]; infinite if it is not met."""
    to_part = SE3.inverse(T)
    origin, along = SE3.apply(to_part, action.origin), to_part[:3, :3] @ action.direction
    return float(target.surface.cast(origin[None], along[None]).distances[0])


def sense(session, target, T, rng, sd=None, each=None):
    """Ask and tell until the session ends; calls ``each`` after every reading."""
    sd = float(session.probe.law.const) if sd is None else sd
    while isinstance(action := session.ask(), Action):
        distance = true_range(target, T, action)
        if np.isfinite(distance):
            distance = max(distance + sd * rng.normal(), 1e-6)
        session.tell(action.read(distance))
        if each is not None:
            each(session)
    return action


def new_session(start, probe=LASER, policy="information", seed=0, **stop):
    """A session whose sensor has the noise of its probe."""
    sensing = Sensing(sd=float(probe.law.const))
    return Session(start, probe, sensing, policy_named(policy), Stop(**stop), seed)


def off(session, part, T):
    """Largest distance of a corner of the part's box from where the best mode has it; infinite for another part."""
    b = session.belief
    if not len(b.weights) or b.part[0] != part:
        return np.inf
    return float(corner_distances(b, 0, T[None])[0])


def with_radius(probe, clearance):
    """The same probe, thicker."""
    return replace(probe, clearance=clearance)
