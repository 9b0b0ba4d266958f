"""What ``tanteo plan`` does: read the part, plan, print."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import typer

from tanteo.cli.options import misuse_of_options
from tanteo.cli.part_files import read_all_parts
from tanteo.cli.plan_options import PlanOptions
from tanteo.cli.printing import bold, emit, printable, put, table
from tanteo.cli.prior_options import prior_words
from tanteo.cli.running import UNDECIDED, require_file
from tanteo.cli.targets import check_different, check_target, parts_read, writing
from tanteo.replaced import replaced

if TYPE_CHECKING:
    from tanteo.active import Discrimination, Plan, Probe
    from tanteo.answers import PosePrior
    from tanteo.parts import Part
    from tanteo.typing import Vectors

_ROUGH = 0.005, np.radians(3.0)
"""How well the part's place is taken to be known if nobody says: each axis [m], about each axis [rad]."""


def run_plan(options: PlanOptions, report: str | None, *, as_json: bool) -> None:
    """Plan, print, write the report; exits with 3 when there is no such plan."""
    from tanteo.cli.reporting import check_report

    check_report(report)
    check_target("--csv", options.csv)
    check_different(("--csv", options.csv), ("--report", report), inputs=parts_read(options.parts))
    for path in options.parts:
        require_file("--part" if len(options.parts) == 1 else "--discriminate", path)
    parts = [read_all_parts([path], options.units, quiet=as_json)[0] for path in options.parts]
    if len(parts) == 2:
        _tell_apart(parts, options, report, as_json=as_json)
        return
    from tanteo.active import at_pose, plan
    from tanteo.inference import prepare
    from tanteo.io import plan_csv, plan_json

    T, C = _rough(parts[0], options.pose_prior)
    with misuse_of_options():
        found = plan(
            at_pose(prepare(parts[0]), T, C), options.probe, options.tolerance, options.confidence,
            options.max_measurements,
            options.seed, options.feature,
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


def _rough(part: Part, pose_prior: PosePrior | None) -> tuple[np.ndarray, np.ndarray]:
    if pose_prior is not None:
        assert pose_prior.T_world_part is not None
        assert pose_prior.covariance is not None
        return pose_prior.T_world_part, pose_prior.covariance
    from tanteo.lie import SE3

    J = SE3.adjoint(SE3.from_parts(np.eye(3), part.centroid))  # known at the centroid
    return np.eye(4), J @ np.diag(np.repeat(_ROUGH, 3) ** 2) @ J.T


def _write(path: str, text: str) -> None:
    with writing("--csv", path), replaced(path) as file:
        file.write_text(text, encoding="utf-8", newline="")


def plan_lines(plan: Plan, options: PlanOptions) -> list[str]:
    """The lines for a person."""
    worst = plan.feature or "largest corner sd"
    if options.pose_prior is None:
        spread = f"{1e3 * _ROUGH[0]:g} mm and {np.degrees(_ROUGH[1]):g} deg"
        before = f"with its frame at the world's, to {spread} (say --pose-prior for another pose)"
    else:
        before = prior_words(options.pose_prior)
    lines = [
        bold(printable(plan.message)),
        f"  sensor      {options.probe.name}",
        f"  from        {_allowed(options.probe)}",
        f"  part        {printable(plan.part)}, {before}: {worst} {1e3 * plan.before:.3g} mm, 1 sd",
        "",
    ]
    rows = [
        (
            str(n),
            _three(1e3 * r.origin, 1),
            _three(r.direction, 3),
            _three(1e3 * r.point, 1),
            r.face,
            f"{1e3 * r.sd:.3g}",
            f"{r.within:.3f}",
            f"{r.within_if_met:.3f}",
            f"{r.meets:.0%}",
        )
        for n, r in enumerate(plan.readings, 1)
    ]
    headers = ("", "from (mm)", "along", "meets (mm)", "face", f"{worst} sd (mm)", "P(within)", "if met", "meets")
    notes = [
        "Frame: world. Each row is after its reading. 'P(within)' is over all placements that the part may have,",
        "'meets' the share of them at which the reading meets its face; sd and 'if met' are where all so far do.",
    ]
    return [*lines, *table(headers, rows, left=(4,)), "", *notes] if rows else lines


def _allowed(probe: Probe) -> str:
    """From where it may look or move."""
    if probe.approach is None:
        return "any side, from below too (say --approach 0,0,-1,60deg if the part lies on a table)"
    return f"within {np.degrees(probe.cone):g} deg of the direction ({_three(probe.approach, 3).replace(' ', ', ')})"


def _three(values: Vectors, digits: int) -> str:
    """Three numbers; never minus zero."""
    return " ".join(f"{v:.{digits}f}" for v in np.round(values, digits) + 0.0)


def _tell_apart(parts: Sequence[Part], options: PlanOptions, report: str | None, *, as_json: bool) -> None:
    from tanteo.active import discriminate
    from tanteo.inference import prepare
    from tanteo.io import distinction_json

    first, second = (prepare(part) for part in parts)
    found = discriminate(first, second, options.probe, seed=options.seed)
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


def distinction_lines(found: Discrimination) -> list[str]:
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
