"""Options of ``tanteo plan`` from what was typed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tanteo.cli.prior_options import read_pose_prior
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.active import Probe
    from tanteo.answers import PosePrior


_CONFIDENCE, _MOST = 0.95, 30
"""What holds for a plan where nobody says."""


@dataclass(frozen=True, slots=True, eq=False)
class PlanOptions:
    """Options of ``plan``, in SI units.

    Attributes:
        parts: one CAD file, or two to discriminate.
        tolerance: of the corners, or of the feature [m]; NaN for discriminating.
        confidence: with which they keep it.
        feature: name of the one to place instead of the corners, if any.
        probe: what senses.
        pose_prior: prior pose of the part; None for that of its file, roughly.
        max_measurements: readings at most.
        units: of CAD files that carry none.
        csv: file to write, if any.
        seed: of the places that are tried.
    """

    parts: tuple[str, ...]
    tolerance: float
    confidence: float
    feature: str | None
    probe: Probe
    pose_prior: PosePrior | None
    max_measurements: int
    units: str | None
    csv: str | None
    seed: int

    @classmethod
    def read(
        cls,
        *,
        part: str | None,
        discriminate: Sequence[str],
        tolerance: str | None,
        confidence: float | None,
        feature: str | None,
        sensor: str | None,
        sd: str | None,
        robot: str | None,
        pose_prior: str | None,
        approach: str | None,
        standoff: str | None,
        clearance: str | None,
        max_measurements: int | None,
        units: str | None,
        csv: str | None,
        seed: int,
    ) -> PlanOptions:
        """The options from what was typed.

        Raises:
            InputError: the first one that cannot be meant, named as on the command line.
        """
        from tanteo.active import check_feature
        from tanteo.cli.options import read_unit
        from tanteo.io import parse_length

        if (part is None) == (not discriminate):
            got = "both" if discriminate else "neither"
            raise InputError(f"plan: expected --part FILE, or --discriminate A B, got {got}. Say one.")
        if discriminate and len(discriminate) != 2:
            raise InputError(f"--discriminate: expected two CAD files, got {len(discriminate)}. Name both.")
        if discriminate and Path(discriminate[0]).resolve() == Path(discriminate[1]).resolve():
            raise InputError(
                f"--discriminate: expected two parts, got {discriminate[0]} twice. Poses of one part are for a "
                "session (tanteo sense part --image)."
            )
        of_plans = {
            "tolerance": tolerance, "confidence": confidence, "feature": feature, "pose_prior": pose_prior,
            "max_measurements": max_measurements,
            "csv": csv,
        }  # fmt: skip
        unused = [f"--{name.replace('_', '-')}" for name, value in of_plans.items() if value is not None]
        if discriminate and unused:
            raise InputError(f"{', '.join(unused)}: expected with --part, got it with --discriminate. Leave it out.")
        if part is not None and tolerance is None:
            raise InputError("--tolerance: expected a length for a plan, got none. Say --tolerance 0.2mm.")
        confidence, max_measurements = (
            _CONFIDENCE if confidence is None else confidence,
            _MOST if max_measurements is None else max_measurements,
        )
        if not 0 < confidence < 1:
            raise InputError(f"--confidence: expected a number between 0 and 1, got {confidence:g}. Use 0.95.")
        if max_measurements < 1:
            raise InputError(
                f"--max-measurements: expected 1 or more, got {max_measurements}. Leave it out for {_MOST}."
            )
        if seed < 0:
            raise InputError(f"--seed: expected 0 or more, got {seed}. Use 0.")
        length = np.nan if tolerance is None else parse_length(tolerance, "--tolerance")
        if length <= 0:
            raise InputError(f"--tolerance: expected a positive length, got '{tolerance}'. Write it as 0.2mm.")
        if feature is not None:
            check_feature(feature)
        return cls(
            parts=tuple(discriminate) if part is None else (part,),
            tolerance=length,
            confidence=confidence,
            feature=feature,
            probe=_probe(sensor, sd, robot, approach, standoff, clearance),
            pose_prior=read_pose_prior(None, None, pose_prior, None),
            max_measurements=max_measurements,
            units=None if units is None else read_unit(units),
            csv=csv,
            seed=seed,
        )


def _probe(
    sensor: str | None, sd: str | None, robot: str | None, approach: str | None, standoff: str | None,
    clearance: str | None,
) -> Probe:  # fmt: skip
    from tanteo.active import Probe, probe_of
    from tanteo.io import parse_length
    from tanteo.sensors import NoiseLaw, robot_preset, sensor_preset

    if (sensor is None) == (sd is None):
        got = "neither" if sd is None else "both"
        raise InputError(f"--sensor, --sd: expected one of the two, got {got}. Say --sensor NAME.")
    where: dict[str, object] = {}
    for name, text in (("standoff", standoff), ("clearance", clearance)):
        if text is not None:
            where[name] = parse_length(text, f"--{name}")
    if approach is not None:
        where["approach"], where["cone"] = _approach(approach)
    errors = None if robot is None else robot_preset(robot)
    if sensor is not None:
        return probe_of(sensor_preset(sensor), errors, **where)
    assert sd is not None
    spread = parse_length(sd, "--sd")
    if spread <= 0:
        raise InputError(f"--sd: expected a positive length, got '{sd}'. Write it as 0.1mm.")
    if errors is not None:
        where |= {"repeat_sd": errors.pos_repeat_std, "base_sds": (errors.pos_abs_std, errors.rot_abs_std)}
    return Probe(f"sd {1e3 * spread:g} mm", NoiseLaw.of(spread), **where)  # type: ignore[arg-type]


def _approach(text: str) -> tuple[np.ndarray, float]:
    words = text.replace(" ", "").split(",")
    try:
        values = [float(w.removesuffix("deg")) for w in words]
    except ValueError:
        values = []
    if len(values) != 4 or not words[-1].endswith("deg") or not 0 <= values[3] <= 180 or not any(values[:3]):
        raise InputError(
            f"--approach: expected a direction in the world and the largest angle to it, got '{text}'. Write it as "
            "0,0,-1,60deg."
        )
    return np.array(values[:3]), float(np.radians(values[3]))
