"""Write parts, plans and acquisitions as JSON documents in metres and radians (``docs/formats_json.md``)."""

from __future__ import annotations

import csv
import io
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from tanteo import __version__
from tanteo.io.documents.result_json import covariance_document, document_json, finding_document
from tanteo.words.findings import PlanResult

if TYPE_CHECKING:
    from tanteo.features import Feature
    from tanteo.hand import Predicted
    from tanteo.hand.acquisition import Acquired
    from tanteo.parts import Part
    from tanteo.parts.faces import RoundFeature
    from tanteo.planning import Plan
    from tanteo.planning.discrimination import Discrimination
    from tanteo.planning.following import NextReading
    from tanteo.posterior import Answer
    from tanteo.words import Finding


def part_json(part: Part) -> str:
    """Return the document ``tanteo.part/1``: geometry read from a CAD file, in the part frame.

    Args:
        part: part to write.
    """
    from tanteo.parts import round_features
    from tanteo.parts.faces import hole_patterns  # slow to import

    edges = part.edges
    planes = part.planes
    symmetry = part.symmetry
    faces = zip(planes.faces, planes.areas, planes.normals, planes.centroids, strict=True)
    sides = zip(edges.lengths, edges.ends, edges.dihedrals, strict=True)
    return document_json({
        "schema": "tanteo.part/1", "version": __version__, "part": part.name, "file": part.source,
        "unit_of_file": part.unit, "box_m": part.box, "volume_m3": part.volume, "area_m2": part.area,
        "centroid_m": part.centroid, "triangles": len(part.triangles),
        "symmetry": {
            "order": symmetry.order, "axis": symmetry.axis, "spherical": symmetry.spherical, "motions": symmetry.Ts,
        },
        "planes": [
            {"name": f"face {face}", "area_m2": area, "normal": normal, "centroid_m": centroid}
            for face, area, normal, centroid in faces
        ],
        "edges": [
            {"name": f"edge {i}", "length_m": length, "ends_m": ends, "interior_angle_rad": angle}
            for i, (length, ends, angle) in enumerate(sides)
        ],
        "vertices": [{"name": f"vertex {i}", "point_m": p} for i, p in enumerate(part.corners.points)],
        "curved_faces": [
            {
                "name": f.name, "surface": f.surface, "area_m2": f.area, "radius_m": f.radius, "convex": f.convex,
                "half_angle_rad": f.half_angle, "centre_m": None if f.surface == "cylinder" else f.axis_point,
            }
            for f in part.faces
            if f.surface != "plane"
        ],
        "holes_and_bosses": [_round_json(one) for one in round_features(part)],
        "hole_patterns": [
            {
                "kind": p.kind, "holes": [f"hole {k}" for k in p.holes], "hole_radius_m": p.hole_radius, "axis": p.axis,
                "centre_m": p.centre, "radius_m": p.radius, "steps_m": p.steps,
            }
            for p in hole_patterns(part)
        ],
        "repairs": part.repairs,
    })  # fmt: skip


def _round_json(one: RoundFeature) -> dict[str, Any]:
    """Return a hole or boss in the part frame; the axes of its rims point out of the material."""
    return {
        "name": one.name, "hole": one.hole, "surface": one.surface, "faces": [f"face {k}" for k in one.faces],
        "ends_m": one.ends, "radii_m": one.radii, "through": one.through, "residual_m": one.residual,
        "rims": [
            {
                "centre_m": rim.centre, "axis": rim.axis, "radius_m": rim.radius, "open": rim.open,
                "faces": [f"face {k}" for k in rim.faces],
            }
            for rim in one.rims
        ],
    }  # fmt: skip


def plan_json(plan: Plan, *, tolerance: float, confidence: float, program: str | None = None) -> str:
    """Return the document ``tanteo.plan/1``: positions in the world frame, covariances in the part frame.

    Args:
        plan: plan to write.
        tolerance: required position tolerance [m].
        confidence: required probability of being within the tolerance.
        program: probing program to include; None for none.
    """
    more = {} if program is None else {"program": program}
    last = plan.readings[-1] if plan.readings else None
    assumed = next((one.within_assumed for one in plan.findings if isinstance(one, PlanResult)), None)
    own = {} if plan.feature is None else {"feature_sd_m"}
    rows = [
        {
            "number": n, "origin_m": r.origin, "direction": r.direction, "expected_point_m": r.point, "face": r.face,
            "corner_sd_m": float(r.corner_sd), **{name: float(r.feature_sd) for name in own},
            "within_tolerance": float(r.within), "within_tolerance_if_met": float(r.within_if_hit),
            "meets_face": float(r.meets),
        }
        for n, r in enumerate(plan.readings, 1)
    ]  # fmt: skip
    return document_json({
        "schema": "tanteo.plan/1", "version": __version__, "part": plan.part, "reached": plan.reached,
        "message": plan.message, "tolerance_m": tolerance, "confidence": confidence,
        "pose": {"frame": "world", "matrix": plan.T_world_part}, "feature": plan.feature,
        "feature_sd_before_m" if own else "corner_sd_before_m": float(plan.before), "readings": rows,
        "within_tolerance": None if last is None else float(last.within), "within_tolerance_assumed": assumed,
        "all_meet": float(plan.all_meet),
        "room": float(plan.all_clear), "covariance": None if last is None else covariance_document(last.covariance),
        **more,
    }, indent=1)  # fmt: skip


def plan_csv(plan: Plan) -> str:
    """Return the planned readings as CSV in the world frame in millimetres: start, direction, expected point.

    The columns differ from those of a readings file, so that expected points cannot be read as measured ones.

    Args:
        plan: plan to write.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    out.write(f"# {plan.message}\n# x y z: expected surface point; start: start of the beam or motion; world frame\n")
    own = [] if plan.feature is None else ["feature_sd_mm"]
    writer.writerow([
        "number", "start_x_mm", "start_y_mm", "start_z_mm", "dx", "dy", "dz", "x_mm", "y_mm", "z_mm", "face",
        "corner_sd_mm", *own, "within_tolerance", "within_tolerance_if_met", "meets_face",
    ])  # fmt: skip
    for n, r in enumerate(plan.readings, 1):
        mm = [f"{1e3 * v:.4f}" for v in (*r.origin, *r.point)]
        d = [f"{v:.6f}" for v in r.direction]
        sds = [f"{1e3 * v:.4f}" for v in (r.corner_sd, r.feature_sd)[: 1 + len(own)]]
        chances = [f"{v:.4f}" for v in (r.within, r.within_if_hit, r.meets)]
        writer.writerow([n, *mm[:3], *d, *mm[3:], r.face, *sds, *chances])
    return out.getvalue()


def distinction_json(found: Discrimination) -> str:
    """Return the document ``tanteo.discrimination/1`` in the frame of the first part, with null for beams without hit.

    Args:
        found: most discriminating reading.
    """
    return document_json({
        "schema": "tanteo.discrimination/1", "version": __version__, "parts": found.parts, "message": found.message,
        "frame": found.parts[0], "T_first_second": found.T_first_second, "origin_m": found.origin,
        "direction": found.direction, "expected_range_m": np.asarray(found.ranges),
        "expected_range_sd_m": np.asarray(found.sds), "information_nats": float(found.information),
    }, indent=1)  # fmt: skip


def sensed_json(got: Acquired, *, seed: int, clearance: float, expected: Predicted | None = None) -> str:
    """Return the document ``tanteo.sensed/1``: the result of an acquisition, in the world frame.

    Args:
        got: result of the acquisition.
        seed: seed of the simulation.
        clearance: smallest true distance between hand and obstacles [m].
        expected: prediction from an image; None to omit it.
    """
    motions = [{"name": m.name, "status": m.status, "message": m.message, "seconds": m.seconds} for m in got.motions]
    return document_json({
        "schema": "tanteo.sensed/1", "version": __version__, "seed": seed, "kind": got.kind, "status": got.status,
        "message": got.message, "feature": None if got.feature is None else _feature(got.feature),
        "others": [_feature(f) for f in got.others], **({} if expected is None else {"expected": _expected(expected)}),
        "readings": 0 if got.readings is None else len(got.readings), "seconds": got.seconds,
        "least_clearance_m": clearance, "motions": motions,
    })  # fmt: skip


def _expected(expected: Predicted) -> dict[str, Any]:
    guess, plain = expected.guess, ("sd", "turn_sd")
    places = {name: getattr(guess, name) for name in type(guess).__slots__ if name not in plain}
    return {"name": expected.name, **places, "sd_m": guess.sd, "turn_sd_rad": guess.turn_sd}


def _feature(feature: Feature) -> dict[str, Any]:
    from tanteo.features import feature_covariance

    kind = feature.kind
    C = covariance_document(feature_covariance(feature))
    covariance = C | {"frame": "feature", "matrix_same_sensors": kind.B.T @ feature.P @ kind.B}
    return {
        "label": feature.label, "kind": kind.name, "frame": kind.frame, "T_world_feature": feature.T_world_feature,
        "covariance": covariance, "readings": feature.readings, **_size(feature),
    }  # fmt: skip


def _size(feature: Feature) -> dict[str, Any]:
    """Return the radius or half angle of a round feature, its standard deviation, and the side of the material."""
    size = feature.size
    if size is None:
        return {}
    from tanteo.features import relate_size

    name = feature.kind.size_name.replace(" ", "_")
    unit = "m" if feature.kind.size_name == "radius" else "rad"
    sd = math.sqrt(float(relate_size(feature).covariance[0, 0]))
    return {f"{name}_{unit}": size.value, f"{name}_sd_{unit}": sd, "convex": size.convex}


def next_document(answer: Answer, found: NextReading | Finding | None, program: str | None) -> dict[str, Any]:
    """Return the next reading after an answer as a dictionary (``tanteo.next/1``).

    Args:
        answer: the answer.
        found: result of :func:`tanteo.planning.following.next_reading`.
        program: probing program of the reading; None if none was requested.
    """
    from tanteo.planning.following import NextReading  # slow to import

    document: dict[str, Any] = {
        "schema": "tanteo.next/1", "version": __version__, "status": answer.status, "message": answer.message,
        "next": None, "reason": None,
    }  # fmt: skip
    if isinstance(found, NextReading):
        one = found.finding
        document["next"] = {
            "part": one.part, "face": one.face, "start_m": one.start, "point_m": one.point,
            "direction": one.direction, "radius_m": found.action.radius, "expected_m": found.action.expected,
            "max_range_m": found.action.max_range, "gain_nats": one.gain, "clear": one.clear,
            "hypotheses": [
                {"part": e.part, "probability": e.probability, "face": e.face or None, "distance_m": e.distance,
                 "sd_m": e.sd}
                for e in one.expected
            ],
        }  # fmt: skip
    elif found is not None:
        document["reason"] = finding_document(found)
    return document if program is None else document | {"program": program}
