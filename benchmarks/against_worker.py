"""One side of ``against.py``: it answers scenes, sent as JSON lines, and measures accuracy and processor time.

It runs in the environment of the commit that it measures and uses only the public API of tanteo. NumPy alone judges the
answers: errors of a pose are right perturbations in the part frame, translation first.
"""

from __future__ import annotations

import importlib.util
import inspect
import json
import sys
import tempfile
import time
from functools import cache
from pathlib import Path

import numpy as np
from against_points import at, cast, made_files, pose, turn
from against_scenes import draw

import tanteo

LEVEL = {6: 12.5916, 5: 11.0705, 3: 7.8147}
"""95 % of a chi-square variable are below this, by degrees of freedom."""

ELSEWHERE = 240_000
"""Added to the number of a scene it gives another one of the same part, to warm up with."""


# What two commits may name differently: nothing else here does


def options(scene, folder):
    """Arguments of ``identify`` and ``locate``."""
    known = inspect.signature(tanteo.identify).parameters
    found = {name: 100 for name in ("top", "max_hypotheses") if name in known}
    if scene.tip_sd:
        found["tip_sd"] = scene.tip_sd
    if scene.rig:
        found["rig"] = _rig(scene.rig, folder)
    if scene.prior:
        names = ("posterior", "answers", "measurements", "inference", "matching")  # where priors were, the newest first
        there = (name for name in names if importlib.util.find_spec(f"tanteo.{name}") is not None)
        modules = (importlib.import_module(f"tanteo.{name}") for name in there)
        module = next(one for one in modules if hasattr(one, "Priors"))
        found["priors"] = module.Priors(pose=module.PosePrior(*scene.prior))
    return found


@cache
def _rig(text, folder):
    from tanteo.io import read_rig

    file = folder / "rig.toml"
    file.write_text(text)
    return read_rig(file)


def new_session(scene, parts):
    """Return a session for one place, with a laser."""
    from tanteo.planning import Probe, Sensing, Session, Stop, at_place
    from tanteo.sensors.presets import NoiseLaw

    laser = Probe("laser", NoiseLaw.of(scene.sd), max_range=0.3, standoff=0.1)
    stop = Stop(tolerance=2e-3, max_measurements=max(scene.readings, 1))
    return Session(at_place(parts, *scene.prior), laser, Sensing(sd=scene.sd), stop=stop)


# Answers


def part_reader(examples, demo, bracket, folder):
    """Return a function that reads the part of a key, once."""
    made_files(folder, demo)

    @cache
    def part(key):
        made = folder / f"{key}.stl"
        path = made if made.is_file() else examples / f"{key}.step"
        path = demo / f"{key.removeprefix('demo/')}.stl" if key.startswith("demo/") else path
        path = bracket if key == "bracket" else path
        (found,) = tanteo.read_parts([path], unit="mm" if path.suffix == ".stl" else None).parts
        return found

    return part


def answer_scene(scene, part, folder, rng):
    """Return the answer to a scene and its CPU time [ms]; for a session, the time of one reading."""
    parts = [part(key) for key in scene.among]
    if scene.session == "planned":
        return converse(scene, parts, part(scene.truth), rng)
    readings, more = tanteo.Readings.from_columns(**scene.columns), {} if scene.session else options(scene, folder)
    start = time.process_time()
    if scene.session:
        session = new_session(scene, parts)
        session.tell(readings)
        answer = session.answer(top=100)
    elif len(parts) == 1:
        answer = tanteo.locate(readings, parts[0], **more)
    else:
        answer = tanteo.identify(readings, parts, **more)
    return answer, 1e3 * (time.process_time() - start)


def converse(scene, parts, own, rng):
    """Run a session that plans its readings; the noise depends on the number of the reading only."""
    start = time.process_time()
    session, count, noise = new_session(scene, parts), 0, scene.sd * rng.normal(size=scene.readings)
    to_part = np.linalg.inv(scene.T)
    while hasattr(action := session.ask(), "read"):
        paused = time.process_time()
        distance = cast(own, at(to_part, action.origin[None]), action.direction[None] @ to_part[:3, :3].T)[0][0]
        distance = max(distance + noise[count], 1e-6)
        count, start = count + 1, start + time.process_time() - paused
        session.tell(action.read(distance))
    answer = session.answer(top=100)
    return answer, 1e3 * (time.process_time() - start) / max(count, 1)


# Judging


def log(T):
    """Twist of a pose, translation first."""
    R = T[:3, :3]
    K = np.zeros((4, 4))
    K[:3, :3] = R + R.T - np.trace(R) * np.eye(3)
    K[3, :3] = K[:3, 3] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    K[3, 3] = np.trace(R)
    *v, c = np.linalg.eigh(K)[1][:, -1]  # the quaternion, for any angle
    v = np.array(v) * (1 if c >= 0 else -1)
    s, c = np.linalg.norm(v), abs(c)
    angle = 2 * np.arctan2(s, c)
    w = v * (angle / s if s > 1e-12 else 2.0)
    W = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    b = 1 / 12 if angle < 1e-4 else (1 - angle * c / (2 * s)) / angle**2
    return np.concatenate([(np.eye(3) - W / 2 + b * W @ W) @ T[:3, 3], w])


def without_symmetric_rotation(gap, axis):
    """Return a relative pose without its rotation about a part's axis of symmetry ``(2, 3)``."""
    if axis is None:
        return gap
    w = log(gap)[3:]
    angle = np.linalg.norm(w)
    spin = -2 * np.arctan2(np.sin(angle / 2) * (w @ axis[1]), max(angle, 1e-300) * np.cos(angle / 2)) * axis[1]
    return gap @ pose(turn(spin), axis[0] - turn(spin) @ axis[0])


def errors(h, truth, part):
    """Return the error of a hypothesis modulo symmetry: distance of the centroid [m], angle [rad], NEES and its dof."""
    T, back = h.T_world_part, np.linalg.inv(h.T_world_part)
    images = [np.eye(4), *(back @ image for image in h.symmetry_poses)]
    axis = None if h.symmetry_axis is None else at(back, h.symmetry_axis)
    if axis is not None:
        axis[1] = T[:3, :3].T @ h.symmetry_axis[1]
    xi = [log(without_symmetric_rotation(back @ truth @ image, axis)) for image in images]
    information = np.linalg.pinv(h.covariance, rcond=1e-12)
    gaps = [without_symmetric_rotation(np.linalg.inv(truth) @ T @ image, axis) for image in images]
    off = [(np.linalg.norm(at(g, part.centroid) - part.centroid), np.linalg.norm(log(g)[3:])) for g in gaps]
    moved, angle = min(off, key=lambda each: each[0] / part.diagonal + each[1])
    return moved, angle, min(x @ information @ x for x in xi), 6 if axis is None else 5


def is_right(h, scene, part):
    """Return whether a hypothesis has the true part at its pose."""
    if h.part != part.name:
        return False
    moved, angle, nees, dof = errors(h, scene.T, part)
    return bool(moved < scene.close[0] and angle < scene.close[1]) or (not scene.strict and bool(nees < 100 + dof))


def judge(answer, scene, part):
    """Return the figures of an answer; "unknown" is right if the part is not among the candidates."""
    found, own = answer.hypotheses, part(scene.truth)
    row = {
        "status": answer.status, "P": float(found[0].probability) if found else 0.0, "poses": len(found),
        "unknown": float(answer.unknown_probability), "absent": scene.truth not in scene.among,
        "among": None, "nees": None, "dof": 6, "inside": None,
    }  # fmt: skip
    if row["absent"]:
        return row | {"right": answer.status == "unknown"}
    right = [is_right(h, scene, own) for h in found]
    row |= {"right": any(right[:1]), "among": any(right)}
    if found and found[0].part == own.name:
        *_, nees, row["dof"] = errors(found[0], scene.T, own)
        row |= {"nees": float(nees), "inside": bool(nees <= LEVEL[row["dof"]])}
    return row


def checksum(scene):
    """Return a number that is equal for two sides exactly if they got the same scene."""
    columns = [np.asarray(v) for v in (scene.T, *scene.columns.values())]
    return float(sum(np.nansum(a.ravel() * np.cos(np.arange(a.size))) for a in columns if a.dtype.kind == "f"))


def main():
    """Print where tanteo is installed, then answer until the input ends; all other output goes to the error stream."""
    out, sys.stdout = sys.stdout, sys.stderr
    warm = set()
    with tempfile.TemporaryDirectory() as name:
        part = part_reader(*map(Path, sys.argv[1:4]), Path(name))
        print(json.dumps(tanteo.__file__), file=out, flush=True)
        for line in sys.stdin:
            row, number, seed = json.loads(line)
            scene = draw(row, number, seed, part)
            rng = np.random.default_rng((seed, number, 1))
            if not (fresh := {(row, key) for key in scene.among}) <= warm:  # preparing a part is not timed
                answer_scene(draw(row, number + ELSEWHERE, seed, part), part, Path(name), np.random.default_rng(0))
                warm |= fresh
            answer, ms = answer_scene(scene, part, Path(name), rng)
            judged = judge(answer, scene, part) | {"ms": ms, "check": checksum(scene)}
            print(json.dumps(judged), file=out, flush=True)


if __name__ == "__main__":
    main()
