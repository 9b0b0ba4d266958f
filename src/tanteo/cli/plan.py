"""Implement ``tanteo plan``: readings that place a part within a tolerance, or the one that discriminates two parts."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from tanteo import io, posterior, render
from tanteo.cli import arguments as args
from tanteo.cli import files, typed
from tanteo.cli.assumed_errors import AssumedErrors
from tanteo.cli.misuse import misuse, require_errors
from tanteo.cli.printing import complain, emit, layout, leave, put
from tanteo.cli.probing import ProgramOptions
from tanteo.cli.reach_options import ReachOptions
from tanteo.defaults import TIP_SD
from tanteo.errors import InputError
from tanteo.replaced import replaced

if TYPE_CHECKING:
    from tanteo.parts import Part
    from tanteo.planning import Plan, Probe

_CONFIDENCE, _MOST = 0.95, 30
"""Default confidence and largest number of readings of a plan."""


def _feature(name: str) -> str:
    from tanteo.planning.places import check_feature

    check_feature(name)
    return name


@dataclass(frozen=True, slots=True, kw_only=True)
class Options(AssumedErrors):
    """Options of ``plan``."""

    part: Annotated[str | None, args.option("--part", "FILE", "CAD file of the part to place (STEP, STL, ...).")] = None
    discriminate: Annotated[
        list[str] | None,
        args.option("--discriminate", "A B", "CAD files of two parts: plan the one reading that discriminates them."),
    ] = None
    goal: args.Goal = None
    confidence: Annotated[
        float | None,
        args.option("--confidence", None, "Probability that the goal holds; 0.95 if not given."),
        typed.Words(partial(typed.fraction, "--confidence", "number", f"{_CONFIDENCE}"), float | None),
    ] = None
    feature: Annotated[args.Feature, typed.Words(_feature)] = None
    sensor: args.Sensor = None
    sd: args.Sd = None
    form_sd: args.FormSd = 0.0
    tip_sd: args.TipSd = None
    bias_sd: args.BiasSd = None
    robot: args.Robot = None
    pose_prior: args.PosePriorAt = None
    table: args.TableAt = None
    furniture: args.FurniturePaths = None
    max_measurements: Annotated[
        int | None,
        args.option("--max-measurements", None, "Largest number of readings; 30 if not given."),
        typed.Words(partial(typed.at_least, "--max-measurements", 1, f"Drop it for {_MOST}"), int | None),
    ] = None
    units: args.Units = None
    csv: Annotated[str | None, args.option("--csv", "FILE", "Also write the plan as a table.")] = None
    seed: Annotated[
        int,
        args.option("--seed", None, "Seed of the candidate positions: the same seed gives the same plan."),
        args.SEED,
    ] = 0
    report: args.Report = None
    json: args.Json = False

    def __post_init__(self) -> None:
        require_errors(self.sensor, self.sd)

    def probe(self, program: ProgramOptions, reach: ReachOptions) -> Probe:
        """Return the sensor that takes the readings.

        Args:
            program: options of the probing program.
            reach: options of the approach.
        """
        from tanteo.planning import probe_of
        from tanteo.sensors.presets import sensor_preset

        beam = self.sensor is not None and not sensor_preset(self.sensor).is_contact
        where = program.of_probe(beam=beam, turned=reach.tool_tilt != 0)
        where |= reach.where(
            self.table,
            self.furniture,
            self.units,
            ball=program.tip_radius or 0.0,
            above=program.program is not None,
            upright="stylus" in where,
        )
        where["form_sd"] = self.form_sd
        probe = probe_of(self.sensor or self.sd or 0.0, self.robot, **where)
        shared = math.hypot(probe.shared_sd, *(error.spread * error.sd for error in self.bias_sd or ()))
        tip_sd, assumed = program.tip_sd(self.tip_sd)
        if assumed:
            complain(
                "warning",
                f"--tip-sd: not stated. The log will have the pose of the tool, so locate assumes an offset of the tip "
                f"of {1e3 * TIP_SD:g} mm (1 sd), and the plan counts it. State 0,0,0mm for an exact tip.",
            )
        moved = math.hypot(probe.base_sds[0], max(tip_sd))  # of a tool that keeps its attitude
        return replace(probe, shared_sd=shared, base_sds=(moved, probe.base_sds[1]))


def check_plan(typed: Mapping[str, Any]) -> None:
    """Check that the options of a plan are consistent.

    Args:
        typed: typed values by parameter name.

    Raises:
        InputError: options exclude each other, or a required one is missing.
    """
    part, pair = typed["part"], typed["discriminate"] or []
    if (part is None) == (not pair):
        raise InputError(
            f"plan: expected --part FILE, or --discriminate A B, got {'both' if pair else 'neither'}. Give one."
        )
    if pair and len(pair) != 2:
        raise InputError(f"--discriminate: expected two CAD files, got {len(pair)}. Name both.")
    if pair and os.path.realpath(pair[0]) == os.path.realpath(pair[1]):
        raise InputError(
            f"--discriminate: expected two parts, got {pair[0]} twice. Poses of one part are for a "
            "session (tanteo sense part --image)."
        )
    of_plans = ("goal", "confidence", "feature", "pose_prior", "max_measurements", "csv", "program")
    unused = [f"--{name.replace('_', '-')}" for name in of_plans if typed[name] is not None]
    if pair and unused:
        raise InputError(f"{', '.join(unused)}: expected with --part, got it with --discriminate. Drop it.")
    if part is not None and typed["goal"] is None:
        raise InputError("--goal: expected a length for a plan, got none. Add --goal 0.2mm.")


def plan(options: Options, reach: ReachOptions, program: ProgramOptions) -> None:
    """Plan readings of a part before sensing it.

    Finds few readings that place a part within a tolerance, or the one that discriminates two parts.
    """
    with misuse():
        probe = options.probe(program, reach)
    files.check_report(options.report)
    files.check_target("--csv", options.csv)
    paths = options.discriminate or [options.part or ""]
    files.check_different(("--csv", options.csv), ("--report", options.report), parts=paths)
    for path in paths:
        files.require_file("--part" if len(paths) == 1 else "--discriminate", path)
    parts = [files.read_all_parts([path], options.units, quiet=options.json)[0] for path in paths]
    if len(parts) == 2:
        _discriminate(parts, probe, options)
    else:
        _plan(parts[0], probe, options, program)


def _plan(part: Part, probe: Probe, options: Options, program: ProgramOptions) -> None:
    """Compute a plan, print it, and write its files."""
    from tanteo.planning import plan
    from tanteo.planning.start import at_origin, at_pose
    from tanteo.render.html import plan_page

    target = posterior.prepare(part)
    start = at_origin(target)
    if options.pose_prior is not None:
        start = at_pose(target, options.pose_prior.T, options.pose_prior.C)
    tolerance, confidence = options.goal or 0.0, options.confidence or _CONFIDENCE
    with misuse(always=False):
        most = options.max_measurements or _MOST
        found = plan(start, probe, tolerance, confidence, most, options.seed, options.feature, options.stated_errors)
    if options.csv is not None:
        with files.writing("--csv", options.csv), replaced(options.csv) as file:
            file.write_text(io.documents.plan_csv(found), encoding="utf-8", newline="")
    written = program.written(found, part, probe, start.covariances[0])
    if options.json:
        put(io.documents.plan_json(found, tolerance=tolerance, confidence=confidence, program=written))
    else:
        emit(_lines(found, probe, options), None if written is None else sys.stderr)
        put(written or "")
    if options.report is not None:
        page = plan_page(found, part, probe, tolerance, confidence, files.this_run())
        files.write_page(options.report, page, as_json=options.json)
    leave(decided=found.reached)


def _lines(found: Plan, probe: Probe, options: Options) -> list[str]:
    import numpy as np

    from tanteo.planning.start import ORIGIN_SDS

    known = typed.read_known(None, None, options.pose_prior, None)
    spread = f"{1e3 * ORIGIN_SDS[0]:g} mm and {np.degrees(ORIGIN_SDS[1]):g} deg"
    usual = f"with its frame at the world's, to {spread} (--pose-prior states another pose)"
    anywhere = "any side, from below too (use --approach 0,0,-1,60deg if the part lies on a table)"
    before = usual if known is None else render.text.prior_words(known)
    return render.text.plan_lines(found, probe, before, anywhere=anywhere, layout=layout())


def _discriminate(parts: list[Part], probe: Probe, options: Options) -> None:
    """Find the reading that discriminates two parts, print it, and write its report."""
    from tanteo.planning import discriminate
    from tanteo.render.html import distinction_page

    first, second = (posterior.prepare(part) for part in parts)
    found = discriminate(first, second, probe, seed=options.seed)
    put(io.documents.distinction_json(found)) if options.json else emit(
        render.text.distinction_lines(found, layout=layout())
    )
    if options.report is not None:
        files.write_page(options.report, distinction_page(found, parts, probe, files.this_run()), as_json=options.json)
    leave(decided=found.discriminates)
