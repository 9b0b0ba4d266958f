"""The document ``tanteo.sensed/1``: what an acquisition gave, as strict JSON (``docs/formats.md``)."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from tanteo import __version__
from tanteo.acquisition import Acquired, Predicted
from tanteo.features import Feature, feature_covariance

SCHEMA = "tanteo.sensed/1"


def sensed_document(got: Acquired, *, seed: int, clearance: float, expected: Predicted | None = None) -> dict[str, Any]:
    """The result as plain dictionaries, lists, strings and numbers; metres, radians, world.

    Args:
        got: What was acquired.
        seed: Of the simulation.
        clearance: Least true distance of the hand from everything [m].
        expected: What an image said of it; left out without one.
    """
    return {
        "schema": SCHEMA,
        "version": __version__,
        "seed": seed,
        "kind": got.kind,
        "status": got.status,
        "message": got.message,
        "feature": None if got.feature is None else _feature(got.feature),
        "others": [_feature(f) for f in got.others],
        **({} if expected is None else {"expected": _expected(expected)}),
        "readings": 0 if got.readings is None else len(got.readings),
        "seconds": got.seconds,
        "least_clearance_m": clearance,
        "motions": [
            {"name": m.name, "status": m.status, "message": m.message, "seconds": m.seconds} for m in got.motions
        ],
    }


def sensed_json(got: Acquired, *, seed: int, clearance: float, expected: Predicted | None = None) -> str:
    """The result as one JSON document, indented, ending in a newline."""
    document = sensed_document(got, seed=seed, clearance=clearance, expected=expected)
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def _expected(expected: Predicted) -> dict[str, Any]:
    guess, plain = expected.guess, ("sd", "turn_sd")
    places = {name: getattr(guess, name).tolist() for name in type(guess).__slots__ if name not in plain}
    return {"name": expected.name, **places, "sd_m": guess.sd, "turn_sd_rad": guess.turn_sd}


def _feature(feature: Feature) -> dict[str, Any]:
    return {
        "label": feature.label,
        "kind": feature.kind.name,
        "frame": feature.kind.frame,
        "T_world_feature": np.asarray(feature.T_world_feature).tolist(),
        "covariance": {
            "order": "x y z rx ry rz",
            "frame": "feature",
            "perturbation": "right",
            "units": "m rad",
            "matrix": feature_covariance(feature).tolist(),
            "matrix_same_sensors": (feature.kind.B.T @ feature.P @ feature.kind.B).tolist(),
        },
        "readings": list(feature.readings),
    }
