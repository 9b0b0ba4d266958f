"""``tanteo sense part``: from a rough idea of where some part is to its name and place, by a simulated hand."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import typer

from tanteo.cli.options import misuse_of_options
from tanteo.cli.part_files import read_all_parts
from tanteo.cli.part_live import shown_live
from tanteo.cli.part_record import kept, write
from tanteo.cli.part_start import nothing_seen, start_of
from tanteo.cli.printing import emit, printable, put, warned
from tanteo.cli.running import UNDECIDED
from tanteo.cli.targets import check_different, check_target, parts_read
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.active import Start, Stop
    from tanteo.answers import PosePrior
    from tanteo.cli.image_start import ImageOptions
    from tanteo.execution import Executed, Visit
    from tanteo.io import SceneFile
    from tanteo.motion import Rules
    from tanteo.session import Session
    from tanteo.simulator import SimulatedHand


@dataclass(frozen=True, slots=True)
class PartOptions:
    """Options of ``sense part``, lengths in metres.

    Attributes:
        policy: Name of the policy.
        stop: When to end.
        standoff: Of the sensor from what it reads; None for the scene's.
        seed: Of all simulated errors and of the session; None for the scene's.
        units: Of part files that carry none.
        outlier_rate: Share of readings expected to be off the part; None for the usual one.
        unknown_prior: Probability beforehand of none of the parts, likewise.
    """

    policy: str
    stop: Stop
    standoff: float | None
    seed: int | None
    units: str | None
    outlier_rate: float | None
    unknown_prior: float | None


def read_part_options(
    *,
    policy: str,
    probability: float,
    tolerance: str | None,
    confidence: float,
    feature: str | None,
    max_measurements: int,
    standoff: str | None,
    seed: int | None,
    units: str | None,
    outlier_rate: str | None,
    unknown_prior: str | None,
) -> PartOptions:
    """The options from what was typed.

    Raises:
        InputError: The first one that cannot be meant, named as on the command line.
    """
    from tanteo.active import Stop, policy_named
    from tanteo.cli.options import read_outlier_rate, read_unit, read_unknown_prior
    from tanteo.cli.sensing import read_standoff
    from tanteo.io import parse_length

    policy_named(policy)
    for name, value in (("--probability", probability), ("--confidence", confidence)):
        if not 0 < value < 1:
            raise InputError(f"{name}: expected a probability between 0 and 1, got {value:g}. Use 0.99.")
    if max_measurements < 1:
        raise InputError(f"--max-measurements: expected 1 or more, got {max_measurements}. Use 100.")
    if seed is not None and seed < 0:
        raise InputError(f"--seed: expected 0 or more, got {seed}. Use 0.")
    within = None if tolerance is None else parse_length(tolerance, "--tolerance")
    if within is not None and not within > 0:
        raise InputError(f"--tolerance: expected a positive length, got '{tolerance}'. Write it as 2mm.")
    if feature is not None and within is None:
        raise InputError(f"--feature: expected --tolerance with '{feature}', got none. Say --tolerance 0.5mm.")
    stop = Stop(
        probability=probability,
        tolerance=within,
        confidence=confidence,
        max_measurements=max_measurements,
        feature=feature,
    )
    unit = None if units is None else read_unit(units)
    return PartOptions(
        policy,
        stop,
        read_standoff(standoff),
        seed,
        unit,
        read_outlier_rate(outlier_rate),
        read_unknown_prior(unknown_prior),
    )


def sense_unknown(
    scene_path: str,
    part_paths: Sequence[str],
    options: PartOptions,
    known: PosePrior | None,
    image: ImageOptions | None,
    record: str | None,
    report: str | None,
    *,
    as_json: bool,
    verbose: bool,
) -> None:
    """Sense until it is enough, print the answer; exits with 3 when it is not decided or not reached."""
    import numpy as np

    from tanteo.cli.image_start import view_of
    from tanteo.cli.reporting import check_report
    from tanteo.io import read_scene
    from tanteo.simulator import clearances

    check_report(report)
    check_target("--record", record)
    sources = [("--scene", scene_path), *parts_read(part_paths), *(image.files if image is not None else [])]
    check_different(("--record", record), ("--report", report), inputs=sources)
    scene = read_scene(scene_path)
    scene = replace(scene, standoff=options.standoff or scene.standoff)
    if options.seed is not None:
        scene = replace(scene, seed=options.seed)
    view = None if image is None else view_of(scene, image)
    parts = read_all_parts(part_paths, options.units, quiet=as_json)
    start = start_of(scene, parts, known, view, options)
    if start is None:
        nothing_seen(as_json=as_json)
    with misuse_of_options():
        session, robot, rules = prepare_run(scene, start, options)
    with kept(session, record) as keep, shown_live(verbose=verbose) as show:

        def watch(visit: Visit) -> None:
            keep()
            show(visit)

        done = _executed(scene, session, robot, rules, watch)
    least = float(clearances(scene.scene, scene.hand.body, np.array(robot.truth)).min())
    decided = _answer(session, done, least, as_json=as_json, verbose=verbose)
    write(session, record)
    if report is not None:
        _report(report, session, done, least, as_json=as_json)
    if not (decided and done.end.reached):
        raise typer.Exit(UNDECIDED)


def prepare_run(scene: SceneFile, start: Start, options: PartOptions) -> tuple[Session, SimulatedHand, Rules]:
    """The session, which knows nothing of the truth, and the hand in it."""
    import numpy as np

    from tanteo.active import policy_named
    from tanteo.execution import hand_probe, reachable
    from tanteo.hand import ForbiddenBox, Workspace
    from tanteo.motion import Rules
    from tanteo.session import Sensing, Session
    from tanteo.simulator import SimulatedHand

    occluders = [ForbiddenBox(f"occluder {b.name}", b.low, b.high, b.T_world_box) for b in scene.occluders]
    w = scene.workspace
    rules = Rules(clearance=scene.clearance, workspace=Workspace(w.low, w.high, [*w.forbidden, *occluders]))
    errors = scene.cell.robot
    probe = hand_probe(scene.hand, rules, scene.standoff, errors)
    session = Session(
        start, probe, Sensing(rig=scene.hand.rig, robot=errors), policy_named(options.policy),
        options.stop, scene.seed, reachable(scene.hand, rules, probe.retreat),
    )  # fmt: skip
    rng = np.random.default_rng(scene.seed)
    return session, SimulatedHand(scene.scene, scene.hand, scene.T_world_hand, rng=rng, cell=scene.cell), rules


def _executed(
    scene: SceneFile, session: Session, robot: SimulatedHand, rules: Rules, watch: Callable[[Visit], None]
) -> Executed:
    from tanteo.execution import Furniture, sense_part
    from tanteo.simulator import Scene

    furniture = Furniture(Scene.of(scene.furniture).surface) if scene.furniture else None
    return sense_part(session, robot, rules, furniture=furniture, errors=scene.cell.robot, watch=watch)


def _answer(session: Session, done: Executed, least: float, *, as_json: bool, verbose: bool) -> bool:
    """Print the answer; is it decided?"""
    from tanteo.cli.answer import answer_lines
    from tanteo.io import executed_json

    result = session.answer()
    if as_json:
        put(executed_json(result, done, readings=session.count, clearance=least, warnings=warned()))
    else:
        cost = (
            f"  cost        {session.count} readings, {done.seconds:.1f} s simulated, {done.travel:.2f} m of travel, "
            f"clearance {1e3 * least:.1f} mm at least"
        )
        headline, *rest = answer_lines(result, verbose=verbose)
        emit([headline, cost, *rest, printable(done.end.why)])
    if as_json and not done.end.reached:
        emit([printable(done.end.why)], sys.stderr)
    return result.status == "recognized"


def _report(path: str, session: Session, done: Executed, least: float, *, as_json: bool) -> None:
    """The session as a page, with what the hand did for it."""
    from tanteo.cli.reporting import report_session

    asked = len(done.visits)
    facts = [
        ("Why it ended", done.end.why),
        ("Questions, readings", f"{asked}, {session.count}"),
        ("Time and way of the hand, simulated", f"{done.seconds:.1f} s, {done.travel:.2f} m"),
        ("Least clearance", f"{1e3 * least:.1f} mm"),
    ]
    report_session(path, session, *facts, as_json=as_json)
