"""A laser and two mirrored brackets, and a person who plays: for the tests of the live page."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import tanteo.bench.demo
from tanteo.geometry import SE3, SO3
from tanteo.hand import Workspace
from tanteo.hand.simulator import Scene, Solid, box
from tanteo.parts import read_part
from tanteo.planning import Session, Stop, at_place
from tanteo.planning.policies import policy_named
from tanteo.posterior import prepare
from tanteo.render.live import HELP, YOUR_TURN, laser, probe_show, simulated

PARTS = Path(tanteo.bench.demo.__file__).parent / "parts"
TRUE = SE3.from_parts(SO3.exp(np.array([0.0, 0.0, 0.2])), [-0.02, -0.045, 0.0])
TABLE = box("table", [-0.3, -0.3, -0.05], [0.3, 0.3, 0.0])


def brackets():
    """Return the two prepared brackets."""
    return [prepare(read_part(PARTS / f"bracket_{side}.stl", unit="mm")) for side in ("left", "right")]


def maker(targets, **stop):
    """Return a maker of views in which the first target lies at its pose."""
    part = targets[0].part
    truth = Solid.at("unknown", part.vertices, part.triangles, TRUE)
    place = TRUE @ SE3.from_parts(np.eye(3), part.centroid + np.array([0.004, -0.006, 0.001]))
    start = at_place(targets, place, np.diag(np.repeat([8e-3, 0.06], 3) ** 2))
    surfaces = Scene.of([truth]).surface, Scene.of([TABLE]).surface

    def make(seed, policy):
        probe, sensing = laser(Workspace.above(0.0))
        ends = Stop(**({"probability": 0.99, "max_measurements": 15} | stop))
        session = Session(start, probe, sensing, policy_named(policy), ends, seed)
        return probe_show(session, simulated(*surfaces, seed), (truth,), (TABLE,))

    return make


class Person:
    """A page without a display: it records what it gets, and sends one command whenever the player waits."""

    def __init__(self, *wants):
        self.wants, self.player = list(wants), None
        self.groups, self.words, self.messages = {}, {}, []

    def show(self, group, primitives):
        self.groups[group] = {p.name: p for p in primitives}

    def set_text(self, place, html):
        self.words[place] = html
        if place != "status":
            return
        self.messages.append(html)
        over = self.groups["truth"] and "senses the same scene now" not in html
        if (HELP in html or YOUR_TURN in html or over) and self.player.commands.empty():
            want = self.wants.pop(0)
            want = want(self) if callable(want) else want
            for command in want if isinstance(want, tuple) else (want,):
                self.player.commands.put(command)
