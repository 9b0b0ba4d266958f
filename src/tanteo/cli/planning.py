"""What ``tanteo plan`` does: read the part, plan, print."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import typer

from tanteo.cli.printing import bold, emit, printable, put, table
from tanteo.cli.prior_options import prior_words, read_pose_prior
from tanteo.cli.running import UNDECIDED, read_all_parts, require_file
from tanteo.cli.targets import check_target, writing
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.active import Distinction, Plan, Probe
    from tanteo.matching import PosePrior
    from tanteo.parts import Part
    from tanteo.typing import Vectors

_ROUGH = 0.005, np.radians(3.0)
"""How well the part's place is taken to be known if nobody says: each axis [m], about each axis [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class PlanOptions:
    """Options of ``plan``, in SI units.

    Attributes:
        parts: one CAD file, or two to tell apart.
        tolerance: of the corners [m]; NaN for telling apart.
        confidence: with which they keep it.
        probe: what senses.
        near: rough pose of the part; None for that of its file, roughly.
        most: readings at most.
        units: of CAD files that carry none.
        csv: file to write, if any.
        seed: of the places that are tried.
    """

    parts: tuple[str, ...]
    tolerance: float
    confidence: float
    probe: Probe
    near: PosePrior | None
    most: int
    units: str | None
    csv: str | None
    seed: int

    @classmethod
    def read(
        cls,
        *,
        part: str | None,
        distinguish: Sequence[str],
        tolerance: str | None,
        confidence: float,
        sensor: str | None,
        sd: str | None,
        robot: str | None,
        near: str | None,
        approach: str | None,
        standoff: str | None,
        clearance: str | None,
        most: int,
        units: str | None,
        csv: str | None,
        seed: int,
    ) -> PlanOptions:
        """The options from what was typed.

        Raises:
            InputError: the first one that cannot be meant, named as on the command line.
        """
        from tanteo.cli.options import read_unit
        from tanteo.io.units import parse_length

        if (part is None) == (not distinguish):
            raise InputError("plan: expected --part FILE, or --distinguish A B, got neither or both. Say one.")
        if distinguish and len(distinguish) != 2:
            raise InputError(f"--distinguish: expected two CAD files, got {len(distinguish)}. Name both.")
        if part is not None and tolerance is None:
            raise InputError("--tolerance: expected a length for a plan, got none. Say --tolerance 0.2mm.")
        if not 0 < confidence < 1:
            raise InputError(f"--confidence: expected a number between 0 and 1, got {confidence:g}. Use 0.95.")
        if most < 1 or seed < 0:
            raise InputError(f"--most, --seed: expected 1 or more, and 0 or more, got {most} and {seed}.")
        length = np.nan if tolerance is None else parse_length(tolerance, "--tolerance")
        if length <= 0:
            raise InputError(f"--tolerance: expected a positive length, got '{tolerance}'. Write it as 0.2mm.")
        return cls(
            parts=tuple(distinguish) if part is None else (part,),
            tolerance=length,
            confidence=confidence,
            probe=_probe(sensor, sd, robot, approach, standoff, clearance),
            near=read_pose_prior(None, None, near, None),
            most=most,
            units=None if units is None else read_unit(units),
            csv=csv,
            seed=seed,
        )


def _probe(
    sensor: str | None, sd: str | None, robot: str | None, approach: str | None, standoff: str | None,
    clearance: str | None,
) -> Probe:  # fmt: skip
    from tanteo.active import Probe, probe_of
    from tanteo.io.units import parse_length
    from tanteo.sensors import robot_preset, sensor_preset
    from tanteo.sensors.law import NoiseLaw

    if (sensor is None) == (sd is None):
        raise InputError("--sensor, --sd: expected one of the two, got neither or both. Say --sensor NAME.")
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


def run_plan(options: PlanOptions, report: str | None, *, as_json: bool) -> None:
    """Plan, print, write the report; exits with 3 when there is no such plan."""
    from tanteo.cli.reporting import check_report

    check_report(report)
    check_target("--csv", options.csv)
    for path in options.parts:
        require_file("--part" if len(options.parts) == 1 else "--distinguish", path)
    parts = [read_all_parts([path], options.units, quiet=as_json)[0] for path in options.parts]
    if len(parts) == 2:
        _tell_apart(parts, options, report, as_json=as_json)
        return
    from tanteo.active import at_pose, plan
    from tanteo.io.plan_out import plan_csv, plan_json
    from tanteo.surface_search import prepare_target

    T, C = _rough(parts[0], options.near)
    found = plan(
        at_pose(prepare_target(parts[0]), T, C), options.probe, options.tolerance, options.confidence, options.most,
        options.seed,
    )  # fmt: skip
    if options.csv is not None:
        _write(options.csv, plan_csv(found))
    if as_json:
        put(plan_json(found, tolerance=options.tolerance, confidence=options.confidence))
    else:
        emit(plan_lines(found, options))
    if report is not None:
        from tanteo.cli.reporting import this_run, write_page
        from tanteo.report import plan_page

        page = plan_page(found, parts[0], options.probe, options.tolerance, options.confidence, this_run())
        write_page(report, page, as_json=as_json)
    if not found.reached:
        raise typer.Exit(UNDECIDED)


def _rough(part: Part, near: PosePrior | None) -> tuple[np.ndarray, np.ndarray]:
    if near is not None:
        assert near.T_world_part is not None
        assert near.covariance is not None
        return near.T_world_part, near.covariance
    from tanteo.lie import SE3

    J = SE3.adjoint(SE3.from_parts(np.eye(3), part.centroid))  # known at the centroid
    return np.eye(4), J @ np.diag(np.repeat(_ROUGH, 3) ** 2) @ J.T


def _write(path: str, text: str) -> None:
    with writing("--csv", path), open(path, "w", encoding="utf-8", newline="") as stream:
        stream.write(text)


def plan_lines(plan: Plan, options: PlanOptions) -> list[str]:
    """The lines for a person."""
    if options.near is None:
        spread = f"{1e3 * _ROUGH[0]:g} mm and {np.degrees(_ROUGH[1]):g} deg"
        before = f"with its frame at the world's, to {spread} (say --near for another pose)"
    else:
        before = prior_words(options.near)
    lines = [
        bold(printable(plan.message)),
        f"  sensor      {options.probe.name}",
        f"  part        {printable(plan.part)}, {before}: worst corner {1e3 * plan.before:.3g} mm, 1 sd",
        "",
    ]
    rows = [
        (
            str(n),
            _three(1e3 * r.origin, 1),
            _three(r.direction, 3),
            _three(1e3 * r.point, 1),
            r.face,
            f"{1e3 * r.worst_corner_sd:.3g}",
            f"{r.within:.3f}",
        )
        for n, r in enumerate(plan.readings, 1)
    ]
    headers = ("", "from (mm)", "along", "meets (mm)", "face", "worst corner sd (mm)", "P(within)")
    return (
        [*lines, *table(headers, rows, left=(4,)), "", "Frame: world. Each row is after its reading."]
        if rows
        else lines
    )


def _three(values: Vectors, digits: int) -> str:
    """Three numbers; never minus zero."""
    return " ".join(f"{v:.{digits}f}" for v in np.round(values, digits) + 0.0)


def _tell_apart(parts: Sequence[Part], options: PlanOptions, report: str | None, *, as_json: bool) -> None:
    from tanteo.active import distinguish
    from tanteo.io.plan_out import distinction_json
    from tanteo.surface_search import prepare_target

    first, second = (prepare_target(part) for part in parts)
    found = distinguish(first, second, options.probe, seed=options.seed)
    if as_json:
        put(distinction_json(found))
    else:
        emit(distinction_lines(found))
    if report is not None:
        from tanteo.cli.reporting import this_run, write_page
        from tanteo.report import distinction_page

        write_page(report, distinction_page(found, parts, options.probe, this_run()), as_json=as_json)
    if not found.tells:
        raise typer.Exit(UNDECIDED)


def distinction_lines(found: Distinction) -> list[str]:
    """The lines for a person."""
    lines = [bold(printable(found.message))]
    if np.isfinite(found.origin).all():
        start, way = (_three(v, d).replace(" ", ", ") for v, d in ((1e3 * found.origin, 1), (found.direction, 3)))
        lines += [
            f"  from        ({start}) mm along ({way}), in the frame of {printable(found.parts[0])}, to which the "
            "other was fitted",
            *(
                f"  {printable(name):11} {'nothing' if np.isinf(r) else f'{1e3 * r:.2f} mm, sd {1e3 * s:.2f} mm'}"
                for name, r, s in zip(found.parts, found.ranges, found.sds, strict=True)
            ),
            f"  tells       {found.information / np.log(2):.0%} of all there is to tell about which it is",
        ]
    return lines
