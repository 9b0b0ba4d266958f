"""Golden answers of seeded scenes: ``python benchmarks/golden.py record|messages|compare [FILE] [--only NAME ...]``.

``record`` answers every scene and writes status, part, probability, pose, covariance and message;
with ``--only`` it keeps the other recorded scenes, with another ``--seed`` it adds to them. ``messages`` replaces the
messages of the recorded answers whose numbers agree within the tolerances below, and names the others. ``compare``
answers them again and prints the differences beyond the tolerances below, grouped and counted; it exits with 1 if there
are any. ``compare`` reports a changed message on its own line, as words may change where numbers do not.
"""

from __future__ import annotations

import os

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
import gzip
import json
import re
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import against_worker
from against_scenes import draw

import tanteo
from tanteo.geometry import SE3

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / "tests" / "golden" / "answers.json.gz"
EXAMPLES, DEMO = ROOT / "examples" / "parts", ROOT / "src" / "tanteo" / "bench" / "demo" / "parts"
SEED = 1991

ROWS = {
    "parts12_known": 12, "parts12_stranger": 4, "touch": 32, "laser": 24, "flight": 16, "labelled": 16,
    "labelled_bare": 12, "tip_shared": 12, "prior": 18, "far_origin": 8, "thin_sheet": 8, "free_rays": 12, "twins": 12,
    "hard_bar_side": 4, "hard_bar_long": 4, "hard_normals": 12, "hard_tip": 8, "hard_at_once": 6, "hard_prior_3": 8,
    "hard_prior_4": 8, "hard_prior_6": 8, "hard_bias": 6, "hard_mount": 6, "hard_walls": 6, "hard_thin_beams": 6,
}  # fmt: skip
"""Number of scenes per row of ``against_scenes.py``. Rows that need files outside of the repository are excluded."""

HOLES, CONES, FEATURES, IMAGES = 14, 14, 14, 12
"""Number of scenes with centres of holes, with balls and cones, with fitted features, and of rendered images."""

TOLERANCE = {"P": 0.02, "unknown": 0.02, "log_det": 0.2, "log_corner_sd": 0.05, "pose": 0.2}
"""Accepted differences beyond the range of the recorded answers, widened by half of that range: of two probabilities,
of the log determinant of the covariance, of the log of the largest corner sd; and the motion of a corner in such sds.

Another order of random draws is like another seed of the search, so each scene is recorded with several seeds.
"""

Outcome = tuple[Any, Any]
"""An answer and its parts by name."""


def scenes(folder: Path) -> dict[str, Callable[[int], Outcome]]:
    """Return all scenes by name; each answers with a seed of the search."""
    part = against_worker.part_reader(EXAMPLES, DEMO, folder / "bracket.stl", folder)
    out: dict[str, Callable[[int], Outcome]] = {}
    for row, count in ROWS.items():
        for k in range(count):
            out[f"{row}/{k}"] = lambda seed, row=row, k=k: posed(draw(row, k, SEED, part), part, folder, seed)
    for k in range(HOLES):
        out[f"holes/{k}"] = lambda seed, k=k: holes(k, folder, seed)
    for k in range(CONES):
        out[f"cones/{k}"] = lambda seed, k=k: cones(k, folder, seed)
    for k in range(FEATURES):
        out[f"features/{k}"] = lambda seed, k=k: features(k, seed)
    for name in ("bracket_bare", "bracket_left", "bracket_right", "square_post", "step_15mm", "step_not_felt",
                 "too_few", "unknown_part"):  # fmt: skip
        out[f"example/{name}"] = lambda seed, name=name: example(name, seed)
    for name in ("half_hidden", "three_parts", "twins"):
        out[f"image/{name}"] = lambda seed, name=name: image(name)
    for k in range(IMAGES):
        out[f"rendered/{k}"] = lambda seed, k=k: rendered(k)
    return out


def posed(scene: Any, part: Callable, folder: Path, seed: int) -> Outcome:
    """Answer a scene of ``against_scenes.py``."""
    parts = [part(key) for key in scene.among]
    if scene.session:
        answer, _ = against_worker.answer_scene(scene, part, folder, np.random.default_rng(SEED))
    else:
        more = against_worker.options(scene, folder)
        answer = tanteo.identify(tanteo.Readings.from_columns(**scene.columns), parts, seed=seed, **more)
    return answer, {p.name: p for p in parts}


def holes(k: int, folder: Path, seed: int) -> Outcome:
    """Answer a plate that its holes identify, every other one among near twins."""
    import holes as made

    rng = np.random.default_rng((SEED, 1, k))
    specs, parts = plates("twins" if k % 2 else "plates", folder)
    which, T = int(rng.integers(len(parts))), made.box_centred_pose(rng)
    most = 100 if k % 2 else 1 + k % 6
    readings = made.sensed_holes(parts[which], specs[which], T, rng, sized=bool(k // 2 % 2), most=most)
    return tanteo.identify(readings, parts, seed=seed), {p.name: p for p in parts}


def cones(k: int, folder: Path, seed: int) -> Outcome:
    """Answer a plate that its balls and countersinks identify."""
    import balls_and_cones as made

    rng = np.random.default_rng((SEED, 2, k))
    specs, parts = plates("cones", folder)
    which, T = int(rng.integers(len(parts))), made.box_centred_pose(rng)
    readings = made.sensed(specs[which], T, rng, sized=bool(k % 2))
    return tanteo.identify(readings, parts, seed=seed), {p.name: p for p in parts}


@cache
def plates(kind: str, folder: Path) -> tuple[list, list]:
    """Return four made parts of a kind with their specifications."""
    import balls_and_cones
    import holes as made
    from OCP.Message import Message

    for printer in list(Message.DefaultMessenger_s().Printers()):
        Message.DefaultMessenger_s().RemovePrinter(printer)
    rng = np.random.default_rng((SEED, 3, len(kind)))
    module = balls_and_cones if kind == "cones" else made
    specs = made.twins(rng, 4) if kind == "twins" else [module.plate(rng) for _ in range(4)]
    return specs, [module.part_of(spec, f"{kind}_{k}", folder) for k, spec in enumerate(specs)]


@cache
def examples() -> list:
    """Return the example parts, one after the other: on a busy machine a reader in parallel may run out of time."""
    return [tanteo.read_part(path) for path in sorted(EXAMPLES.glob("*.step"))]


def features(k: int, seed: int) -> Outcome:
    """Answer fitted planes and, in every other scene, an edge or a corner; every fifth with clutter."""
    from scenes import clutter_touch, random_pose, sensed_edge, sensed_planes, sensed_vertex
    from tanteo.posterior import identify_features

    rng, part = np.random.default_rng((SEED, 4, k)), examples()[k % len(examples())]
    T, usable = random_pose(rng), np.flatnonzero(part.planes.gyration[:, 1] > 1e-3)
    found = list(sensed_planes(part, T, rng.permutation(usable)[: 3 + k % 4], 1e-4, rng))
    if k % 2 and len(part.edges.lengths):
        found.append(sensed_edge(part, T, int(np.argmax(part.edges.lengths)), 1e-4, rng, label="edge"))
    if k % 4 == 2:
        found.append(sensed_vertex(part, T, 0, 1e-4, rng, label="corner"))
    if k % 5 == 4:
        found.append(clutter_touch(0.5, rng, label="clutter"))
    return identify_features(found, examples()), {p.name: p for p in examples()}


def example(name: str, seed: int) -> Outcome:
    """Answer a file of example readings."""
    readings = tanteo.read_readings(ROOT / "examples" / "readings" / f"{name}.csv")
    return tanteo.identify(readings, examples(), seed=seed), {p.name: p for p in examples()}


def image(name: str) -> Outcome:
    """Answer an example image, its camera placed by the marks."""
    from tanteo import io
    from tanteo.vision import see_table

    folder = ROOT / "examples" / "images"
    pixels = io.read_image(str(folder / f"{name}.png"))
    camera, _ = io.scenes.place_camera(
        io.read_camera(str(folder / "camera.yaml"), shape=pixels.shape), str(folder / "marks.csv")
    )
    return see_table(pixels, camera, examples()), {p.name: p for p in examples()}


def rendered(k: int) -> Outcome:
    """Answer a rendered image of one example part; every third is partly hidden."""
    from tanteo.vision import see_table
    from vision_scenes import random_shot

    shot = random_shot(vision_models(), np.random.default_rng((SEED, 5, k)), hidden=0.3 if k % 3 == 2 else 0.0)
    return see_table(shot.image, shot.camera, examples()), {p.name: p for p in examples()}


@cache
def vision_models() -> list:
    """Return the example parts prepared for images."""
    from tanteo.vision import prepare_vision

    return [prepare_vision(part) for part in examples()]


def summary(answer: Any, parts: dict) -> dict:
    """Return the recorded numbers of an answer: of each object of an image, or of the one answer."""
    if hasattr(answer, "objects"):
        each = sorted((summary(seen.answer, parts) for seen in answer.objects), key=lambda s: s["T"] or [])
        return {
            "objects": len(each),
            **{f"object {k} {key}": value for k, s in enumerate(each) for key, value in s.items()},
        }
    best = answer.hypotheses[0] if answer.hypotheses else None
    out = {"status": answer.status, "part": None, "P": 0.0, "T": None, "log_det": None, "corner_sd": None,
           "unknown": round(float(answer.unknown_probability), 5), "message": answer.message}  # fmt: skip
    if best is not None:
        P = 0.5 * (best.covariance + best.covariance.T)
        out |= {
            "part": best.part, "P": round(float(best.probability), 5), "corner_sd": float(f"{best.corner_sd:.4g}"),
            "T": [float(f"{x:.9g}") for x in best.T_world_part[:3].ravel()],
            "log_det": round(float(np.log(np.maximum(np.linalg.eigvalsh(P), 1e-30)).sum()), 3),
        }  # fmt: skip
    return out


def differences(known: list[dict], new: dict, answer: Any, parts: dict) -> Iterator[tuple[str, str]]:
    """Yield name and text of each difference from all recorded answers of a scene, beyond its tolerance."""
    if "objects" in new:
        known = [old for old in known if old["objects"] == new["objects"]]
        if not known:
            yield "objects", f"now {new['objects']}"
        for k in range(new["objects"] if known else 0):
            *olds, own = (
                {n.removeprefix(f"object {k} "): v for n, v in s.items() if n.startswith(f"object {k} ")}
                for s in (*known, new)
            )
            yield from differences(olds, own, None, parts)
        return
    for name in ("status", "part"):
        if new[name] not in [old[name] for old in known]:
            yield name, f"{known[0][name]} -> {new[name]}"
    if words(new) not in [words(old) for old in known]:
        yield "message", f"{known[0]['message']} -> {new['message']}"
    for name in ("P", "unknown"):
        yield from outside(name, [old[name] for old in known], new[name])
    same = [old for old in known if old["part"] is not None and old["part"] == new["part"]]
    if not same:
        return
    yield from outside("log_det", [old["log_det"] for old in same], new["log_det"])
    yield from outside("log_corner_sd", [np.log(old["corner_sd"]) for old in same], np.log(new["corner_sd"]))
    moved = [motion(old, new, answer, parts[new["part"]]) / old["corner_sd"] for old in same]
    if not min(moved) <= TOLERANCE["pose"]:
        yield "pose", f"{min(moved):.2f} of the largest corner sd"


def reworded(known: list[dict], new: dict, answer: Any, parts: dict) -> bool:
    """Replace the messages of recorded summaries that agree with the new one, and return if there are any.

    Summaries with the same numbers get the new messages. Without any, the first one with the same result does, if the
    numbers of all agree within the tolerances.
    """
    texts = {key for key in new if key.endswith("message")}
    same = [old for old in known if all(old.get(key) == value for key, value in new.items() if key not in texts)]
    if not same and all(name == "message" for name, _ in differences(known, new, answer, parts)):
        results = ("status", "part", "objects", *(key for key in new if key.endswith((" status", " part"))))
        same = [old for old in known if all(old.get(key) == new.get(key) for key in results)][:1]
    for old in same:
        old.update({key: new[key] for key in texts})
    return bool(same)


def words(one: dict) -> str:
    """Return a message without its numbers, which other rows judge."""
    return re.sub(r"\d[\d,]*(?:\.\d+)?(?:e-?\d+)?", "#", one["message"])


def outside(name: str, known: list[float], new: float) -> Iterator[tuple[str, str]]:
    """Yield a difference if a number is beyond the range of the recorded ones, widened by half of it and tolerance."""
    low, high = min(known), max(known)
    allowed = TOLERANCE[name] + 0.5 * (high - low)
    if not low - allowed <= new <= high + allowed:
        yield name, f"{low:.3f} to {high:.3f} -> {new:.3f}"


def motion(old: dict, new: dict, answer: Any, part: Any) -> float:
    """Return the largest motion of a corner of the box [m], the least over poses that symmetry makes equivalent."""
    first, T = (np.vstack([np.reshape(s["T"], (3, 4)), [0, 0, 0, 1]]) for s in (old, new))
    corners = np.array(np.meshgrid(*part.box.T)).reshape(3, -1).T
    images = T @ part.symmetry.Ts
    best = answer.hypotheses[0] if answer is not None else None
    if best is not None and best.symmetry_axis is not None:  # every turn about the axis is equivalent
        corners = corners.mean(axis=0) + np.outer([-1, 1], 0.5 * part.diagonal * (T[:3, :3].T @ best.symmetry_axis[1]))
    return float(
        np.linalg.norm(SE3.apply(images[:, None], corners) - SE3.apply(first, corners), axis=-1).max(axis=-1).min()
    )


def answered(only: list[str], seed: int = 0) -> Iterator[tuple[str, dict, Any, dict]]:
    """Yield name, summary, answer and parts of each scene whose name is chosen or begins with a chosen one."""
    with tempfile.TemporaryDirectory() as name:
        for scene, run in scenes(Path(name)).items():
            if not only or scene in only or scene.split("/")[0] in only:
                answer, parts = run(seed)
                yield scene, summary(answer, parts), answer, parts


def compared(known: dict[str, list[dict]], only: list[str], seed: int = 0) -> Iterator[tuple[str, str, str]]:
    """Yield scene, name and text of each difference from known answers."""
    for scene, new, answer, parts in answered(only, seed):
        if scene not in known:
            yield scene, "scene", "not recorded"
            continue
        for name, text in differences(known[scene], new, answer, parts):
            yield scene, name, text


def read(file: Path = FILE) -> dict[str, list[dict]]:
    """Return the recorded summaries of each scene."""
    return json.loads(gzip.decompress(file.read_bytes()))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("what", choices=("record", "messages", "compare"))
    parser.add_argument("file", nargs="?", type=Path, default=FILE)
    parser.add_argument("--only", nargs="+", default=[], help="scenes, or groups of scenes: touch, holes/3")
    parser.add_argument("--seed", type=int, default=0, help="of the search")
    options = parser.parse_args()
    if options.what == "record":
        found = read(options.file) if options.file.exists() and (options.only or options.seed) else {}
        start = time.process_time()
        for scene, new, _, _ in answered(options.only, options.seed):
            before = found.get(scene, []) if options.seed else []
            found[scene] = before + [new] * (new not in before)
            print(f"{scene}: {time.process_time() - start:.2f} s", file=sys.stderr, flush=True)
            start = time.process_time()
        options.file.parent.mkdir(parents=True, exist_ok=True)
        text = json.dumps(found, indent=0)
        options.file.write_bytes(gzip.compress(text.encode(), mtime=0))
        print(f"{options.file}: {len(found)} scenes, {options.file.stat().st_size} bytes")
        return 0
    if options.what == "messages":
        found = read(options.file)
        left = [
            scene
            for scene, new, answer, parts in answered(options.only, options.seed)
            if not reworded(found[scene], new, answer, parts)
        ]
        options.file.write_bytes(gzip.compress(json.dumps(found, indent=0).encode(), mtime=0))
        print(f"Messages not replaced, as numbers differ: {', '.join(left) or 'none'}.")
        return bool(left)
    counts, groups, different = Counter(), Counter(), set()
    for scene, name, text in compared(read(options.file), options.only, options.seed):
        print(f"{scene}: {name}: {text}", flush=True)
        counts[name] += 1
        groups[scene.split("/")[0]] += 1
        different.add(scene)
    print(f"\n{len(different)} scenes differ." if different else "No differences.")
    for title, count in (("Differences by quantity", counts), ("by kind of scene", groups)):
        if count:
            print(f"{title}: " + ", ".join(f"{name} {n}" for name, n in count.most_common()) + ".")
    return bool(different)


if __name__ == "__main__":
    sys.exit(main())
