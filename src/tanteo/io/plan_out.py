"""Plans as JSON and as CSV. The CSV is no readings file, so that nobody takes for measured what is only expected."""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING, Any

import tanteo
from tanteo.io.result_json import covariance_document, numbers

if TYPE_CHECKING:
    from tanteo.active import Discrimination, Plan


def plan_json(plan: Plan, *, tolerance: float, confidence: float) -> str:
    """One document, schema ``tanteo.plan/1``; metres, world frame, covariances in the part frame."""
    rows = [
        {
            "number": n,
            "origin_m": numbers(r.origin),
            "direction": numbers(r.direction),
            "expected_point_m": numbers(r.point),
            "face": r.face,
            "corner_sd_m": float(r.corner_sd),
            **({} if plan.feature is None else {"feature_sd_m": float(r.feature_sd)}),
            "within_tolerance": float(r.within),
            "within_tolerance_if_met": float(r.within_if_met),
            "meets_face": float(r.meets),
        }
        for n, r in enumerate(plan.readings, 1)
    ]
    covariance = plan.readings[-1].covariance if plan.readings else None
    before = "corner_sd_before_m" if plan.feature is None else "feature_sd_before_m"
    return _dumped({
        "schema": "tanteo.plan/1", "version": tanteo.__version__, "part": plan.part, "reached": plan.reached,
        "message": plan.message, "tolerance_m": tolerance, "confidence": confidence,
        "pose": {"frame": "world", "matrix": numbers(plan.T_world_part)},
        "feature": plan.feature, before: float(plan.before), "readings": rows,
        "within_tolerance": float(plan.readings[-1].within) if plan.readings else None,
        "all_meet": float(plan.all_meet), "room": float(plan.room),
        "covariance": None if covariance is None else covariance_document(covariance),
    })  # fmt: skip


def plan_csv(plan: Plan) -> str:
    """The planned readings: where to start, which way, what to expect; world frame, millimetres."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    out.write(f"# {plan.message}\n# x y z: expected surface point; start: from where; world frame\n")
    own = [] if plan.feature is None else ["feature_sd_mm"]
    writer.writerow([
        "number", "start_x_mm", "start_y_mm", "start_z_mm", "dx", "dy", "dz", "x_mm", "y_mm", "z_mm", "face",
        "corner_sd_mm", *own, "within_tolerance", "within_tolerance_if_met", "meets_face",
    ])  # fmt: skip
    for n, r in enumerate(plan.readings, 1):
        mm = [f"{1e3 * v:.4f}" for v in (*r.origin, *r.point)]
        d = [f"{v:.6f}" for v in r.direction]
        sds = [f"{1e3 * v:.4f}" for v in (r.corner_sd, r.feature_sd)[: 1 + len(own)]]
        writer.writerow(
            [n, *mm[:3], *d, *mm[3:], r.face, *sds, *(f"{v:.4f}" for v in (r.within, r.within_if_met, r.meets))]
        )
    return out.getvalue()


def distinction_json(found: Discrimination) -> str:
    """One document, schema ``tanteo.discrimination/1``; metres, frame of the first part; null where nothing is met."""
    return _dumped({
        "schema": "tanteo.discrimination/1", "version": tanteo.__version__, "parts": list(found.parts),
        "message": found.message, "frame": found.parts[0], "T_first_second": numbers(found.T_first_second),
        "origin_m": numbers(found.origin),
        "direction": numbers(found.direction), "expected_range_m": numbers(found.ranges),
        "expected_range_sd_m": numbers(found.sds), "information_nats": float(found.information),
    })  # fmt: skip


def _dumped(document: dict[str, Any]) -> str:
    return json.dumps(document, indent=1, allow_nan=False) + "\n"
