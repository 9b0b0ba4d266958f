"""An explanation as a JSON document (schema ``tanteo.explanation/1``); metres and nats."""

from __future__ import annotations

import math
from typing import Any

from tanteo.active import Explanation


def explanation_document(explanation: Explanation) -> dict[str, Any]:
    """What each reading added and what the answer rests on; ``null`` where there is no number."""
    return {
        "schema": "tanteo.explanation/1",
        "part": explanation.part,
        "added": [
            {
                "readings": list(a.ids),
                "met": list(a.met),
                "part": a.part,
                "probability": _number(a.probability),
                "about_part_nats": _number(a.about_part),
                "about_pose_nats": _number(a.about_pose),
                "motion": a.motion,
                "narrowed": _number(a.narrowed),
                "corner_sd_before_m": _number(a.corner_sd_before),
                "corner_sd_m": _number(a.corner_sd),
            }
            for a in explanation.added
        ],
        "directions": [
            {
                "motion": d.motion,
                "corners_move_m": _number(d.moves),
                "shares": {name: _number(share) for name, share in d.shares},
                "prior": _number(d.prior),
            }
            for d in explanation.directions
        ],
    }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
