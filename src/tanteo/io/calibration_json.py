"""A calibration as a JSON document (schema ``tanteo.calibration/1``)."""

from __future__ import annotations

from typing import Any

from tanteo.calibration import BeamFit, Calibration, PlaneFit


def calibration_document(found: Calibration) -> dict[str, Any]:
    """Beams, noise, planes, coverage and outliers, in metres and radians."""
    return {
        "schema": "tanteo.calibration/1",
        "status": found.status,
        "message": found.message,
        "beams": [_beam(b) for b in found.beams],
        "planes": [_plane(p) for p in found.planes],
        "places": [
            {
                "sensor": found.log.beams[found.log.beam[i]],
                "plane": found.log.planes[found.log.plane[i]],
                "range_m": float(found.ranges[i]),
                "incidence_rad": float(found.incidences[i]),
                "readings": int(found.log.counts[i]),
                "residual_m": float(found.residuals[i]),
                "sd_m": float(found.sds[i]),
                "used": bool(found.good[i]),
            }
            for i in range(len(found.log))
        ],
        "outliers": [
            {
                "readings": list(s.ids),
                "sensor": s.sensor,
                "plane": s.plane,
                "reason": s.reason,
                "range_m": s.reading,
                "expected_m": s.expected,
            }
            for s in found.outliers
        ],
    }


def _beam(beam: BeamFit) -> dict[str, Any]:
    law = beam.repeats.law
    return {
        "sensor": beam.name,
        "frame": "hand",
        "matrix": beam.T_hand_beam.tolist(),
        "scale": beam.scale,
        "slant": beam.slant,
        "covariance": {"order": "x y z rx ry scale slant", "frame": "beam", "matrix": beam.cov.tolist()},
        "noise_of_repeats": {
            "const_m": float(law.const),
            "per_range": float(law.prop),
            "degrees_of_freedom": beam.repeats.dof,
            "covariance_of_squares": beam.repeats.cov.tolist(),
        },
        "noise_of_places": {
            "const_m": float(beam.place_sds[0]),
            "per_range": float(beam.place_sds[1]),
            "across_rad": float(beam.place_sds[2]),
            "covariance_of_squares": beam.place_cov.tolist(),
        },
        "undetermined": list(beam.undetermined),
    }


def _plane(plane: PlaneFit) -> dict[str, Any]:
    return {
        "plane": plane.name,
        "frame": "world",
        "matrix": plane.T_world_plane.tolist(),
        "covariance": {"order": "rx ry z", "frame": "plane", "matrix": plane.cov.tolist()},
        "rms_m": plane.rms,
        "places": plane.stations,
    }
