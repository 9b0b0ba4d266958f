"""Image, then hand, against the hand alone: ``python benchmarks/whole_paper.py [scenes a part] [parts] [seen]``.

Twenty parts (the twelve of ``examples/parts`` and eight random workpieces), each in so many scenes: it lies in one of
its stable poses on a table beside a clamp, turned anyhow. The same hand senses it twice until one part has 99 % and all
corners are within 2 mm with 95 %, or until 60 readings: once *blind*, from a prior pose (middle to 15, 15 and 5 mm,
attitude to 2, 2 and 8 degrees, one standard deviation; how it lies is known) and once *seen*, from that and a rendered
image of the scene (shading, shadows, blur, noise). Truth and errors of the sensors are the same. With ``seen`` that
alone. ``--processes`` and ``--keep`` as in ``campaign.py``.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases
from common import Table

from random_parts import random_part
from rendered import table_camera
from tanteo.catalogue import read_parts
from tanteo.geometry import SE3
from tanteo.hand.simulator import Scene
from tanteo.planning import sense_part
from tanteo.planning.execution import HYPOTHESES, part_seen, seen_start
from tanteo.posterior import prepare
from tanteo.vision import prepare_vision, render, see_table
from tanteo.vision.regions import silhouette
from tanteo.vision.rendering import RenderedObject, Stage, rendered_part
from unknown_scenes import off, unknown_scene, unknown_session
from vision_scenes import random_rendering

SEED, TOLERANCE = 1991, 2e-3
FOLDER = Path(__file__).parents[1] / "examples" / "parts"


@cache
def prepared(count):
    """Return the example parts, then random ones, prepared for the hand and for the camera."""
    rng, parts = np.random.default_rng(SEED), list(read_parts([FOLDER]).parts)[:count]
    with tempfile.TemporaryDirectory() as folder:
        parts += [random_part(Path(folder, f"random{k}.off"), rng) for k in range(count - len(parts))]
        return [prepare(part) for part in parts], [prepare_vision(part) for part in parts]


def scene_of(targets, models, number, scene):
    """Return the same scene on every call, once to be sensed blind, once to be sensed after an image."""
    rng = np.random.default_rng((SEED, number, scene))
    rests = models[number].rests
    k = int(rng.choice(len(rests), p=[rest.probability for rest in rests]))
    return unknown_scene(targets, number, rng, rest=rests[k].T_table_part[:3, :3]), rng


def view(unknown, models, number, rng):
    """Return what an image of the scene shows of the part, and the processor time of the image analysis."""
    camera = table_camera(rng.uniform(0.5, 0.7), rng.uniform(5, 35), rng.uniform(-180, 180))
    middle = SE3.apply(unknown.T_world_part, models[number].part.centroid) * [1, 1, 0]
    at = np.array(camera.T_world_camera)
    at[:3, 3] += middle
    camera = replace(camera, T_world_camera=at)
    clamp = next(s for s in unknown.scene.solids if s.name == "clamp")
    objects = [rendered_part(models[number].part, unknown.T_world_part, rng.uniform(70, 150))]
    objects.append(RenderedObject.of_mesh(clamp.vertices, clamp.triangles, rng.uniform(70, 150)))
    image, _ = render(Stage(camera, objects, random_rendering(rng)), rng)
    start = time.process_time()
    known = silhouette(Scene.of([clamp]).surface, camera, SE3.inverse(at))
    seen = part_seen(see_table(image, camera, models, top=HYPOTHESES, ignore=known), unknown.start)
    return seen, time.process_time() - start


def sensed(unknown, start, number, seed):
    """Return the result of one run of the hand, and its true error."""
    begin = time.process_time()
    session = unknown_session(replace(unknown, start=start), seed=seed, tolerance=TOLERANCE, max_measurements=60)
    done = sense_part(session, unknown.robot, unknown.rules, furniture=unknown.furniture)
    P = session.state.of_parts()
    return {
        "right": bool(len(P) and np.argmax(P) == number), "reached": done.end.reached,
        "off": off(session, number, unknown.T_world_part), "readings": session.count,
        "stops": sum(v.step is not None for v in done.visits), "seconds": done.seconds, "travel": done.travel,
        "clear": unknown.clear, "cpu": time.process_time() - begin,
    }  # fmt: skip


def run_one(count, number, scene, way):
    """Return the result of one scene of one of the parts, blind or after an image."""
    targets, models = prepared(count)
    unknown, rng = scene_of(targets, models, number, scene)
    if way == "blind":
        return sensed(unknown, unknown.start, number, scene)
    sight, cpu = view(unknown, models, number, rng)
    seen = sensed(unknown, seen_start(sight, targets, unknown.start), number, scene)
    first = sight.answer.hypotheses[0] if sight is not None else None
    return seen | {"cpu": seen["cpu"] + cpu, "named": first is not None and first.part == targets[number].part.name}


def row(name, rows):
    """Return one row of the table."""
    ended = [r for r in rows if r["reached"]]

    def spread(key, unit=1.0, digits=0):
        values = unit * np.array([r[key] for r in rows])
        return f"{np.median(values):.{digits}f} ({np.percentile(values, 90):.{digits}f})"

    return (
        name, f"{len(rows)}", f"{len(ended)}", f"{sum(r['right'] for r in ended)}",
        f"{sum(r['off'] <= TOLERANCE for r in ended)}", spread("readings"), spread("stops"), spread("seconds"),
        spread("travel", 1.0, 1), f"{1e3 * min(r['clear'] for r in rows):.1f} mm",
        f"{sum(r['clear'] <= 0 for r in rows)}", spread("cpu"),
    )  # fmt: skip


def main() -> None:
    arguments, keep, processes = options(sys.argv[1:])
    scenes = int(arguments[0]) if arguments else 2
    count = int(arguments[1]) if len(arguments) > 1 else 20
    ways = ["seen"] if "seen" in arguments[2:] else ["blind", "seen"]
    cases = [(count, number, scene, way) for scene in range(scenes) for number in range(count) for way in ways]
    rows = run_cases(run_one, cases, keep, processes)
    of = {way: [row for case, row in zip(cases, rows, strict=True) if case[3] == way] for way in ways}
    named = np.mean([r["named"] for r in of["seen"]])
    text = f"Median (90th percentile). The image alone names the part in {100 * named:.0f} %. "
    if len(ways) > 1:
        medians = [np.median([r["readings"] for r in of[way]]) for way in ways]
        text += f"With it the median number of readings falls by {100 * (1 - medians[1] / medians[0]):.0f} %. "
    text += f"Load of the machine {os.getloadavg()[0]:.1f}."
    columns = (
        "", "scenes", "goal reached", "of these right", "of these within 2 mm", "readings", "stops of the hand",
        "seconds", "travel, m", "least clearance", "contacts", "processor seconds",
    )  # fmt: skip
    print(Table("Image, then hand", text, columns, [row(way, of[way]) for way in ways]).markdown())


if __name__ == "__main__":
    main()
