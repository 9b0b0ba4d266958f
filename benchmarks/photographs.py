"""Recognition of parts on photographs by a path tracer: ``python benchmarks/photographs.py [kinds images seed]``.

``kinds`` names the scenes (``plain,textured,cluttered``), ``images`` is the number of photographs of each kind.
Mitsuba (the extra ``benchmarks``) renders them: soft shadows of lamps of several sizes, four materials, five table
textures, blur, noise and exposure. In a cluttered scene a plate hides 30 % of the part, and other objects lie beside
it. The parts are the twelve of ``examples/parts`` and eight random ones, always the same. One photograph in ten shows a
part that is not in the catalogue. Printed are: how often the part is right and recognized, how often it is wrong and
sure, how often the region of 95 % holds the pose, the pose error, the number of objects, and the processor time. The
last column is the least area of the region of a part, over that of the part from above
(``EvidenceSettings.least_share``). An image cannot decide if the answer lists another part or pose whose edges outside
of the plate are those of the true one, but for less than one observation of an edge (12 px): twins that differ in a
hidden edge, for example.

``--cache FOLDER`` keeps photographs, ``--keep FILE`` rows.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from scipy.stats import beta, chi2

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign import options, run_cases
from common import Table

from machined_parts import mixed_parts
from rendered import rendered_slab, table_camera
from tanteo import io
from tanteo.catalogue import read_parts
from tanteo.geometry import SE3
from tanteo.parts import Surface
from tanteo.vision import find_edges, prepare_vision, see_table
from tanteo.vision.camera import on_plane, project
from tanteo.vision.edges import chance_hits
from tanteo.vision.regions import find_regions, hull_area, silhouette
from tanteo.vision.rendering import Stage, rendered_part
from tanteo.vision.settings import EVIDENCE
from tanteo.vision.wireframe import see_edges
from vision import pose_errors
from vision_scenes import lying, plate_over

KINDS = "plain,textured,cluttered"
MATERIALS = "diffuse", "plastic", "roughplastic", "roughconductor"
TEXTURES = "grain", "speckles", "weave", "tiles", "stains"
SEED, FIT_SEED, PARTS_SEED = 58, 57, 5701
SIZE, FOCAL = (800, 600), 1000.0
SAMPLES = 24
"""Paths for each pixel; their noise is about that of a camera at two grey levels."""

VARIANT = os.environ.get("MITSUBA_VARIANT", "llvm_ad_rgb")
"""Mitsuba's variant: ``llvm_ad_rgb`` needs LLVM (``DRJIT_LIBLLVM_PATH``); ``scalar_rgb`` takes three times as long."""

HIDDEN, UNKNOWN_SHARE, SURE = 0.3, 0.1, 0.95


@cache
def models():
    """Return the parts of the catalogue, and parts that are not in it, prepared."""
    with tempfile.TemporaryDirectory() as folder:
        known = list(read_parts([Path(__file__).parents[1] / "examples" / "parts"]).parts)
        mixed = mixed_parts(PARTS_SEED, folder)
        others = mixed_parts(PARTS_SEED + 1, folder)
    return [prepare_vision(p) for p in known + mixed[2:10]], [prepare_vision(p) for p in others[::3]]


@dataclass(frozen=True)
class Scene:
    """Objects on a table with a texture, and lamps; the first object is the part."""

    objects: tuple
    materials: tuple
    texture: np.ndarray
    lamps: tuple
    sky: float


def noise_field(rng, shape, grid):
    """Return a smooth random field in [0, 1] with about ``grid`` waves on each axis."""
    import cv2

    field = cv2.resize(rng.normal(size=grid).astype(np.float32), shape[::-1], interpolation=cv2.INTER_CUBIC)
    low, high = np.quantile(field, [0.01, 0.99])
    return np.clip((field - low) / (high - low), 0, 1)


def table_texture(kind, contrast, rng, pixels=1024):
    """Return the reflectance of a table ``(pixels, pixels, 3)``."""
    shape = pixels, pixels
    y, x = np.mgrid[:pixels, :pixels] / pixels
    if kind == "grain":
        pattern = 0.6 * noise_field(rng, shape, (4, 90)) + 0.4 * noise_field(rng, shape, (16, 300))
    elif kind == "speckles":
        pattern = noise_field(rng, shape, (256, 256)) ** 3
    elif kind == "weave":
        count = rng.uniform(60, 140)
        pattern = 0.5 + 0.25 * (np.sin(2 * np.pi * count * x) + np.sin(2 * np.pi * count * y))
    elif kind == "tiles":
        size = rng.uniform(0.04, 0.1)
        pattern = np.maximum((x / size) % 1 < 0.04, (y / size) % 1 < 0.04).astype(float)
    else:
        pattern = (noise_field(rng, shape, (14, 14)) > 0.6).astype(float)
    base = rng.uniform(0.15, 0.75) * (1 + rng.uniform(-0.15, 0.15, 3))
    return np.clip(base * (1 + contrast * (2 * pattern[..., None] - 1)), 0.02, 0.95).astype(np.float32)


def material(rng, kind):
    """Return a material with a random colour as Mitsuba describes it."""
    colour = {"type": "rgb", "value": rng.uniform(0.08, 0.8, 3).tolist()}
    if rng.uniform() < 0.5:  # grey
        colour = {"type": "rgb", "value": [float(rng.uniform(0.08, 0.8))] * 3}
    if kind == "diffuse":
        return {"type": "diffuse", "reflectance": colour}
    if kind == "roughconductor":
        return {"type": kind, "material": str(rng.choice(["Al", "Cu", "Cr"])), "alpha": float(rng.uniform(0.2, 0.45))}
    extra = {} if kind == "plastic" else {"alpha": float(rng.uniform(0.1, 0.3))}
    return {"type": kind, "diffuse_reflectance": colour, **extra}


def solids_beside(scene_object, rng, count):
    """Return slabs and rods that lie around a part."""
    low, high = scene_object.vertices.min(axis=0)[:2], scene_object.vertices.max(axis=0)[:2]
    middle, radius = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    out = []
    for _ in range(count):
        long, wide, n = rng.uniform(0.01, 0.05), rng.uniform(0.004, 0.03), int(rng.choice([4, 5, 6, 24]))
        turns = 2 * np.pi * (np.arange(n) + 0.5) / n
        outline = np.stack([long * np.cos(turns), wide * np.sin(turns)], axis=1)
        way, yaw = rng.uniform(0, 2 * np.pi, 2)
        place = middle + (radius + max(long, wide) + rng.uniform(0.004, 0.08)) * np.r_[np.cos(way), np.sin(way)]
        T = SE3.from_parts(
            np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]]), np.r_[place, 0.0]
        )
        out.append(rendered_slab(outline, rng.uniform(0.002, 0.03), T, 100.0))
    return out


def random_scene(model, kind, rng):
    """Return a scene of a part, its pose in the world, and a camera directed at it."""
    camera = table_camera(rng.uniform(0.5, 0.65), rng.uniform(5, 40), rng.uniform(-180, 180), SIZE, FOCAL, (0,) * 5)
    K = np.array([[FOCAL, 0, SIZE[0] / 2 - 0.5], [0, FOCAL, SIZE[1] / 2 - 0.5], [0, 0, 1]])
    camera = replace(camera, K=K, edge_sd=0.1)
    _, T = lying(model, rng, 0.06)
    objects = [rendered_part(model.part, T, 100.0)]
    contrast = 0.0 if kind == "plain" else float(rng.choice([0.08, 0.2, 0.4]))
    if kind == "cluttered":
        contrast = float(rng.choice([0.0, 0.08, 0.2]))
        plate = plate_over(Stage(camera, objects), HIDDEN, rng, 100.0)
        objects += [plate, *solids_beside(objects[0], rng, int(rng.integers(2, 7)))]
    return in_light(objects, contrast, rng), T, camera


def in_light(objects, contrast, rng):
    """Return a scene of objects with random materials, table and lamps; the texture of the table has a contrast."""
    materials = tuple(material(rng, str(rng.choice(MATERIALS))) for _ in objects)
    texture = table_texture(str(rng.choice(TEXTURES)), contrast, rng)
    lamps = []
    for _ in range(int(rng.integers(1, 3))):
        turn, tilt = rng.uniform(0, 2 * np.pi), rng.uniform(0.1, 0.9)
        lamps.append((turn, tilt, rng.uniform(0.03, 0.3), rng.uniform(0.5, 1.0)))
    return Scene(tuple(objects), materials, texture, tuple(lamps), rng.uniform(0.1, 0.8))


def as_mesh(mi, solid, bsdf):
    """Return an object for Mitsuba, smooth inside each of its faces and sharp between them."""
    corners = solid.vertices[solid.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    keys = np.stack([solid.triangles.ravel(), np.repeat(solid.labels, 3)], axis=1)
    unique, index = np.unique(keys, axis=0, return_inverse=True)
    smooth = np.zeros((len(unique), 3))
    np.add.at(smooth, index.ravel(), np.repeat(normals, 3, axis=0))
    smooth /= np.maximum(np.linalg.norm(smooth, axis=1, keepdims=True), 1e-30)
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict({"type": "twosided", "bsdf": bsdf})
    mesh = mi.Mesh("object", len(unique), len(solid.triangles), has_vertex_normals=True, props=properties)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = solid.vertices[unique[:, 0]].ravel().astype(np.float32)
    parameters["vertex_normals"] = smooth.ravel().astype(np.float32)
    parameters["faces"] = index.ravel().astype(np.uint32)
    parameters.update()
    return mesh


def photograph(scene, camera, rng):
    """Return a photograph of a scene ``(rows, columns)`` in grey levels."""
    import cv2
    import mitsuba as mi

    mi.set_variant(VARIANT)
    flip = np.diag([-1.0, -1.0, 1.0, 1.0])
    width, height = camera.size
    described = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 5},
        "sensor": {
            "type": "perspective",
            "fov": float(np.degrees(2 * np.arctan(width / 2 / FOCAL))),
            "to_world": mi.ScalarTransform4f(camera.T_world_camera @ flip),
            "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "gaussian"}},
            "sampler": {"type": "independent", "sample_count": SAMPLES},
        },
        "sky": {"type": "constant", "radiance": scene.sky},
        "table": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().scale([0.8, 0.8, 1.0]),
            "bsdf": {
                "type": "diffuse",
                "reflectance": {"type": "bitmap", "bitmap": mi.Bitmap(scene.texture), "raw": True},
            },
        },
    }
    for k, (turn, tilt, size, power) in enumerate(scene.lamps):
        at = 0.9 * np.array([np.cos(turn) * np.sin(tilt), np.sin(turn) * np.sin(tilt), np.cos(tilt)])
        described[f"lamp{k}"] = {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().look_at(origin=at.tolist(), target=[0, 0, 0], up=[0.123, 1, 0])
            @ mi.ScalarTransform4f().scale([size, size, 1.0]),
            "emitter": {"type": "area", "radiance": float(power * 0.8 / size**2)},
        }
    for k, (solid, bsdf) in enumerate(zip(scene.objects, scene.materials, strict=True)):
        described[f"object{k}"] = as_mesh(mi, solid, bsdf)
    linear = np.array(mi.render(mi.load_dict(described), seed=int(rng.integers(1 << 30))))[..., :3]
    grey = linear @ np.array([0.299, 0.587, 0.114])
    grey = grey / np.quantile(grey, 0.97) * rng.uniform(0.35, 0.95)
    levels = 255 * np.clip(
        np.where(grey < 0.0031308, 12.92 * grey, 1.055 * np.maximum(grey, 1e-9) ** (1 / 2.4) - 0.055), 0, 1
    )
    levels = cv2.GaussianBlur(levels, (0, 0), rng.uniform(0.3, 1.0))
    return np.clip(np.rint(levels + rng.normal(0.0, rng.uniform(0.5, 2.5), levels.shape)), 0, 255)


def drawn(kind, image, seed):
    """Return the scene of a case, camera, model, whether it is in the catalogue, its pose, and the generator."""
    known, others = models()
    rng = np.random.default_rng([seed, KINDS.split(",").index(kind), image])
    foreign = bool(rng.uniform() < UNKNOWN_SHARE)
    model = others[int(rng.integers(len(others)))] if foreign else known[int(rng.integers(len(known)))]
    scene, T, camera = random_scene(model, kind, rng)
    return scene, camera, model, not foreign, T, rng


def shot(kind, image, seed, folder=None):
    """Return the photograph of a case, its camera, the model, whether it is in the catalogue, and its pose."""
    scene, camera, model, known, T, rng = drawn(kind, image, seed)
    kept = None if folder is None else Path(folder) / f"{kind}-{seed}-{image}.png"
    if kept is not None and kept.exists():
        return io.read_image(str(kept)), camera, model, known, T
    pixels = photograph(scene, camera, rng)
    if kept is not None:
        kept.parent.mkdir(parents=True, exist_ok=True)
        io.write_image(str(kept), pixels.astype(np.uint8))
    return pixels, camera, model, known, T


def separating(one, other, camera, hidden):
    """Return the length of the edges in the image that one of two parts at poses has and the other lacks [px].

    Args:
        one: a part and its pose ``T_world_part``.
        other: the other part, and its pose.
        camera: camera of the image.
        hidden: pixels that an object over the part covers ``(rows, columns)``.
    """
    shown, T_camera_world = [], SE3.inverse(camera.T_world_camera)
    for model, T in (one, other):
        frame, T_camera_part = model.frame, T_camera_world @ T
        pixels = project(camera, SE3.apply(T_camera_part, frame.points))
        ends = project(camera, SE3.apply(T_camera_part, frame.points + 1e-4 * frame.tangents))
        spans = 1e4 * np.linalg.norm(ends - pixels, axis=1) * frame.lengths
        column, row = np.rint(pixels).astype(int).clip(0, np.array(camera.size) - 1).T
        inside = np.all((pixels >= 0) & (pixels <= np.array(camera.size) - 1.0), axis=1)
        keep = see_edges(frame, T_camera_part).shown.astype(bool) & inside & ~hidden[row, column]
        shown.append((pixels[keep], spans[keep]))
    lacking = 0.0
    for (pixels, spans), (others, further) in (shown, shown[::-1]):
        if len(pixels) and len(others):
            away, nearest = cKDTree(others).query(pixels)
            spans = spans[away > EVIDENCE.reach + further[nearest]]
        lacking += float(spans.sum())
    return lacking


def run_photograph(kind, image, seed, folder):
    """Return the figures of one photograph."""
    pixels, camera, model, known, T = shot(kind, image, seed, folder)
    start = time.process_time()
    sight = see_table(pixels, camera, models()[0], top=20)
    spent = time.process_time() - start
    there = silhouette(model.frame.surface, camera, SE3.inverse(camera.T_world_camera) @ T)
    row = {"kind": kind, "known": known, "objects": len(sight.objects), "spent": spent}
    row["share"] = region_share(pixels, camera, there, SE3.apply(T, model.part.vertices))
    if not sight.objects:
        return row | {"status": "nothing", "right": False, "probability": 0.0, "z": np.nan, "mm": np.nan}
    seen = max(sight.objects, key=lambda one: (covered(one, camera) & there).sum())
    best = seen.answer.hypotheses[0] if seen.answer.hypotheses else None
    right, z, mm, apart = False, np.nan, np.nan, np.nan
    if best is not None and known and best.part == model.part.name:
        z, mm = pose_errors(model, best, T)
        right = mm < 0.05e3 * model.part.diagonal
    if known:
        hidden = np.zeros(pixels.shape, dtype=bool)
        for plate in drawn(kind, image, seed)[0].objects[1 : 2 if kind == "cluttered" else 1]:
            hidden |= silhouette(Surface(plate.vertices, plate.triangles), camera, SE3.inverse(camera.T_world_camera))
        same = EVIDENCE.same_pose * 1e3 * model.part.diagonal
        rivals = [
            (mode.model, one.T_world_part)
            for one, mode in zip(seen.answer.hypotheses, seen.modes, strict=True)
            if one.part != model.part.name or pose_errors(model, one, T)[1] > same
        ]
        apart = min((separating((model, T), rival, camera, hidden) for rival in rivals), default=np.inf)
    probability = 0.0 if best is None else best.probability
    return row | {
        "status": seen.answer.status, "right": right, "probability": probability, "z": z, "mm": mm,
        "named": None if best is None else best.part, "part": model.part.name, "free": bool(best and best.unobserved),
        "apart": apart,
    }  # fmt: skip


def region_share(pixels, camera, there, vertices):
    """Return the area of the region that has most of a part, over that of the part from above, both of convex hulls.

    Args:
        pixels: the photograph.
        camera: its camera.
        there: pixels of the part ``(rows, columns)``.
        vertices: vertices of the part in the world.
    """
    points = find_edges(pixels)
    regions = find_regions(pixels, points, chance_hits(points))
    region = max(regions, key=lambda one: (one.mask & there).sum(), default=None)
    if region is None:
        return 0.0
    on_table = on_plane(camera, region.contour, SE3.inverse(camera.T_world_camera))[:, :2]
    return hull_area(on_table) / hull_area(vertices[:, :2])


def covered(seen, camera):
    """Return the pixels of an answer, or of its region."""
    if seen.modes:
        return silhouette(seen.modes[0].model.frame.surface, camera, seen.modes[0].T_camera_part)
    return seen.region.mask


def bounds(count, of):
    """Return a share with its interval of 95 % (Clopper and Pearson 1934)."""
    if not of:
        return "-"
    low = beta.ppf(0.025, count, of - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, of - count) if count < of else 1.0
    return f"{count} of {of}: {100 * count / of:.0f} % ({100 * low:.0f} to {100 * high:.0f})"


def report(rows):
    """Return a table with a row for each kind of scene."""
    table = []
    for kind in dict.fromkeys(row["kind"] for row in rows):
        own = [row for row in rows if row["kind"] == kind]
        known, others = [r for r in own if r["known"]], [r for r in own if not r["known"]]
        sure = [r for r in own if r["status"] == "recognized" and r["probability"] > SURE]
        placed = [r for r in known if r["right"] and r["status"] == "recognized" and not r["free"]]
        decided = [r for r in known if not r.get("apart", np.inf) < EVIDENCE.stretch]
        inside = [r for r in placed if r["z"] < chi2.ppf(0.95, 3)]
        table.append((
            kind, bounds(sum(r["right"] for r in known), len(known)), bounds(len(placed), len(known)),
            bounds(sum(r in decided for r in placed), len(decided)),
            bounds(sum(r["status"] == "recognized" for r in others), len(others)),
            bounds(sum(not r["right"] for r in sure), len(own)), bounds(len(inside), len(placed)),
            f"{np.median([r['mm'] for r in placed] or [np.nan]):.2f}",
            f"{np.mean([r['objects'] for r in own]):.1f}", f"{np.median([r['spent'] for r in own]):.1f}",
            f"{min((r['share'] for r in known), default=np.nan):.2f}",
        ))  # fmt: skip
    head = (
        "scenes", "right part and pose first", "and recognized", "of images that decide", "unknown part recognized",
        "wrong and sure",
        "pose in the 95 % region", "error, median [mm]", "objects", "CPU for an image [s]", "least region of a part",
    )  # fmt: skip
    return Table("Photographs", "", head, table)


def main():
    arguments, keep, processes = options(sys.argv[1:])
    folder = None
    if "--cache" in arguments:
        k = arguments.index("--cache")
        folder, arguments = arguments[k + 1], arguments[:k] + arguments[k + 2 :]
    kinds = arguments[0] if arguments else KINDS
    images = int(arguments[1]) if len(arguments) > 1 else 40
    seed = int(arguments[2]) if len(arguments) > 2 else SEED
    cases = [(kind, image, seed, folder) for image in range(images) for kind in kinds.split(",")]
    print(report(run_cases(run_photograph, cases, keep, processes)).markdown())


if __name__ == "__main__":
    main()
