"""Implement ``tanteo probe``: a machine senses a part, one reading at a time, until the part is placed."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from tanteo import io, posterior, render
from tanteo.cli import arguments as args
from tanteo.cli import controller, files, typed
from tanteo.cli.assumed_errors import AssumedErrors
from tanteo.cli.live_page import page_of, stay
from tanteo.cli.machine import MachineOptions, check_record, confirmed
from tanteo.cli.misuse import MisuseError, misuse
from tanteo.cli.printing import complain, emit, layout, leave, print_text, put, warned

if TYPE_CHECKING:
    from tanteo.io.poses import WorkFrame
    from tanteo.machines import Probed, SafeMachine, Turn
    from tanteo.parts import Part
    from tanteo.planning import Session
    from tanteo.planning.start import Start

_TAKES_FRAMES = {"grbl": "grbl:G54", "linuxcnc": "G54"}
"""Controllers that can set a frame, each with an example of ``--wcs``."""
_ABOVE = 0.02
"""Height of a fake's tip at the start over the safe height [m]."""

_NOISE = 6.0
"""Largest noise of a fake's report that its limits accept, in standard deviations."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Options(AssumedErrors):
    """Options of ``probe``."""

    part: args.PartPath
    goal: args.Goal
    confidence: args.Confidence = 0.95
    feature: args.Feature = None
    max_measurements: Annotated[
        int,
        args.option("--max-measurements", None, "Largest number of readings."),
        typed.Words(partial(typed.at_least, "--max-measurements", 1, "Use 30"), int),
    ] = 30
    pose_prior: args.PosePriorAt = None
    sensor: args.Sensor = None
    sd: args.Sd = None
    robot: args.Robot = None
    form_sd: args.FormSd = 0.0
    tip_sd: args.TipSd = None
    bias_sd: args.BiasSd = None
    noise_factor: args.NoiseFactor = None
    units: args.Units = None
    seed: args.Seed = 0
    record: Annotated[
        str | None, args.option("--record", "FILE", "Write the session after every reading (JSON, or .mcap).")
    ] = None
    resume: Annotated[bool, args.option("--resume", None, "Continue the session of --record.")] = False
    pose_as: controller.PoseAs = None
    wcs: controller.Wcs = None
    accept_turn_lost: controller.AcceptTurnLost = False
    write: Annotated[
        bool, args.option("--write", None, "Set the frame of --wcs in the controller, after a confirmation.")
    ] = False
    report: args.Report = None
    live: Annotated[
        bool, args.option("--live", None, "Show the running session in a browser; the page has no controls.")
    ] = False
    no_open: Annotated[bool, args.option("--no-open", None, "Do not open the page in a browser.")] = False
    json: args.Json = False
    verbose: args.Verbose = False

    def __post_init__(self) -> None:
        if self.write and self.wcs is None:
            raise MisuseError("--write: expected with --wcs, got none. Add the frame, as --wcs grbl:G54.")


def probe(options: Options, machine: MachineOptions) -> None:
    """Place a part with a machine that moves a touch probe.

    All motions stay within the given limits.
    """
    words = controller.Words(options.pose_as, _frame(options, machine), False, options.accept_turn_lost)
    files.check_report(options.report)
    files.check_target("--record", options.record)
    files.check_different(("--record", options.record), ("--report", options.report), parts=[options.part])
    files.require_file("--part", options.part)
    check_record(options.record, resume=options.resume, dry=machine.dry_run or not machine.moves)
    _check_frame(words, options, machine)
    machine.print_assumptions()
    part = files.read_all_parts([options.part], options.units, quiet=options.json)[0]
    start = _start(part, options)
    with misuse(always=False):
        session = _session(start, options, machine)
    with page_of(session, live=options.live, show=not options.no_open) as draw:
        with _moved(start, session, options, machine) as safe:
            done = _run(session, safe, options, draw)
            answer = session.answer()
            lines = _print(session, done, safe, words, part, options)
            if options.write and not safe.dry_run:
                _write(words, lines or words.text(answer, [part]), done, safe)
        stay(live=options.live)
    if options.report is not None:
        facts = [("Machine", safe.facts.name), ("Reason for the end", done.end.message)]
        files.report_session(options.report, session, *facts, as_json=options.json)
    refused = bool(words) and not machine.dry_run and words.refused(answer) is not None
    leave(decided=done.end.reached and (machine.dry_run or answer.status == "recognized") and not refused)


def _frame(options: Options, machine: MachineOptions) -> WorkFrame | None:
    """Return the frame of ``--wcs``; one without a controller is that of the machine."""
    wcs, kind = options.wcs, machine.machine.kind
    if wcs is None or wcs.within or wcs.controller != "linuxcnc" or kind not in _TAKES_FRAMES:
        return wcs
    return controller.work_frame(_TAKES_FRAMES[kind].replace("G54", wcs.slot))


def _check_frame(words: controller.Words, options: Options, machine: MachineOptions) -> None:
    """Check before any motion that the machine supports the frame of ``--wcs``."""
    if words.wcs is None:
        return
    if words.wcs.within:
        raise MisuseError(
            f"--wcs: expected a frame in machine coordinates, got one within {words.wcs.within}. A machine reports its "
            f"tip in machine coordinates: use --wcs {words.wcs.slot}."
        )
    kind = machine.machine.kind
    if options.write and kind not in _TAKES_FRAMES:
        raise MisuseError(
            f"--write: expected a controller that can set frames ({', '.join(_TAKES_FRAMES)}), got {kind}. "
            "Drop --write: the lines are printed."
        )
    if options.write and words.wcs.controller != kind:
        raise MisuseError(f"--write: expected --wcs of {kind}, as {_TAKES_FRAMES[kind]}, got another. Correct it.")


def _start(part: Part, options: Options) -> Start:
    """Return the prior pose of the part."""
    from tanteo.planning.start import at_origin, at_pose
    from tanteo.posterior import Priors

    target, priors = posterior.prepare(part), Priors(noise_factor=options.noise_factor)
    if options.pose_prior is not None:
        return at_pose(target, options.pose_prior.T, options.pose_prior.C, priors)
    print_text(
        "No prior pose is given: the part's frame is assumed at the machine's origin +- 5 mm 3 deg (--pose-prior).",
        sys.stderr,
    )
    return at_origin(target, priors=priors)


def _session(start: Start, options: Options, machine: MachineOptions) -> Session:
    """Return a new session, or the session of the record with ``--resume``."""
    from tanteo.machines.address import turns_of
    from tanteo.planning import Sensing, Session, Stop

    if options.resume and options.record is not None:
        return io.read_record(options.record, [target.part for target in start.targets])
    spread = machine.spread(options.sensor, options.sd)
    how: dict[str, Any] = {"sensor": spread} if isinstance(spread, str) else {"sd": spread}
    stop = Stop(
        tolerance=options.goal, confidence=options.confidence, feature=options.feature,
        max_measurements=options.max_measurements,
    )  # fmt: skip
    return Session(
        start, machine.probe(spread, options.robot, options.form_sd, turns=turns_of(machine.machine)),
        Sensing(
            **how, robot=options.robot, shared_errors=(*(options.bias_sd or ()), *options.stated_errors),
            tip_sd=options.tip_sd,
            tolerance=options.form_sd,
        ),
        stop=stop, seed=options.seed,
    )  # fmt: skip


@contextmanager
def _moved(start: Start, session: Session, options: Options, machine: MachineOptions) -> Iterator[SafeMachine]:
    """Open the machine with its limits, and close it at the end of the context."""
    from tanteo.machines import Interrupted, SafeMachine, stop_on_signals
    from tanteo.machines.address import opened

    world, place = _fake(start, session, options, machine) if machine.machine.fake else (None, None)
    with opened(machine.machine, world, place) as driver:
        show = (lambda what: print_text(f"     {what}", sys.stderr)) if options.verbose or machine.dry_run else None
        limits = machine.limits()
        if world is not None:  # a fake draws the noise of its reports, not of the places where the tip rests
            limits = replace(limits, arrival=limits.arrival + _NOISE * world.sd)
        safe = SafeMachine(driver, limits, machine.confirmation(), machine.dry_run, show)
        try:
            with stop_on_signals(safe):
                _check_probe(safe, machine)
                yield safe
        except Interrupted as stop:
            stored = "" if options.record is None else " The readings so far are stored: continue with --resume."
            complain("warning", f"{stop}: a stop was sent and the motion cancelled.{_by_hand(safe)}{stored}")
            sys.exit(128 + stop.number)


def _check_probe(safe: SafeMachine, machine: MachineOptions) -> None:
    """Check the probe before the first motion: by the user's hand, or on a known surface."""
    way = machine.check_of_probe()
    if way == "hand":
        print_text(
            "Check of the probe: push the stylus with a finger for a second, then release it (--check-probe).",
            sys.stderr,
        )
        safe.check_by_hand()
        print_text("The probe reports contacts.", sys.stderr)
    elif not isinstance(way, str):
        safe.check_on_surface(way + machine.radius)


def _by_hand(safe: SafeMachine) -> str:
    """Return the advice after a stop during a touch: a probe does not retract after a stop."""
    if safe.away is None:
        return ""
    x, y, z = safe.away
    return f" The tip may touch the part: move it by hand along ({x:.3f}, {y:.3f}, {z:.3f}), away from the part."


def _fake(start: Start, session: Session, options: Options, machine: MachineOptions) -> tuple[Any, Any]:
    """Return the world of a fake, with the part at a pose drawn from the prior, and the start of its tip."""
    import numpy as np

    from tanteo.geometry import SE3
    from tanteo.machines import Ways, World
    from tanteo.parts import Surface

    T, part = start.drawn(0, 64)[options.seed % 64], start.targets[0].part
    aligned = ""
    if options.wcs is not None and not options.accept_turn_lost:  # as a clamp aligns it: offsets have no tilt
        T = SE3.from_parts(start.Ts[0][:3, :3], T[:3, 3])
        aligned = ", aligned for --wcs"
    x, y, z = 1e3 * T[:3, 3]
    print_text(
        f"The fake's part is at x {x:.3f} y {y:.3f} z {z:.3f} mm, drawn from the prior (--seed){aligned}.", sys.stderr
    )
    spread = machine.spread(options.sensor, options.sd)
    sd = float(session.probe.law.sigma(np.asarray(session.probe.standoff))) if isinstance(spread, str) else spread
    ways = Ways.from_start(start, session.probe, turns=False)
    ceiling = float(session.probe.workspace.high[2]) - 2 * session.probe.clearance
    height = max(ways.job.safe_height, min(ways.job.safe_height + _ABOVE, ceiling))
    place = np.array([*ways.job.centre[:2], height])
    return World(Surface(part.vertices, part.triangles), T, machine.radius, sd, options.seed), place


def _run(session: Session, safe: SafeMachine, options: Options, draw: Callable[[str], None]) -> Probed:
    from tanteo.machines import probe_part

    def watch(turn: Turn) -> None:
        leader = session.state.target(0).part.name if len(session.state.weights) else ""
        distance = None if turn.sensed is None else turn.sensed.distance
        print_text(render.text.turn_line(turn.action, distance, turn.step, leader, turn.note), sys.stderr)
        draw(turn.note)

    done = probe_part(session, safe, options.record, watch)
    if done.resumed:
        print_text(f"{done.resumed} stored readings of an earlier run were added to the session.", sys.stderr)
    if done.stopped:
        complain("warning", f"{done.stopped}{_by_hand(safe)} The readings so far are stored: continue with --resume.")
    return done


def _print(
    session: Session, done: Probed, safe: SafeMachine, words: controller.Words, part: Part, options: Options
) -> str:
    """Print the answer as text or JSON; return the lines for the controller if they were printed."""
    answer = session.answer()
    if safe.dry_run:
        moves = sum(turn.step is not None for turn in done.turns)
        others = len(done.turns) - moves
        refused = f"; {others} others were refused by the limits" if others else ""
        print_text(
            f"Dry run: {moves} touches within the limits{refused}; nothing was sent. {done.end.message}", sys.stderr
        )
        return ""
    if options.json:
        sensing = {
            "machine": safe.facts.name, "reached": done.end.reached, "why": done.end.message, "stopped": done.stopped,
            "readings": session.count, "questions": len(done.turns),
        }  # fmt: skip
        more = words.document(answer, [part]) if words else {}
        put(io.documents.document_json({**io.recognition_document(answer), "sensing": sensing, **more}, warned()))
        return ""
    lines = render.text.probed_lines(
        answer, done.end, safe.facts.name, session.count, verbose=options.verbose, layout=layout()
    )
    emit(lines, sys.stderr if words else None)
    if not words:
        return ""
    made = words.text(answer, [part])
    if made and not done.end.reached:
        complain("warning", f"{words.option}: the goal was not reached: these lines use the estimate so far.")
    put(made)
    return made


def _write(words: controller.Words, lines: str, done: Probed, safe: SafeMachine) -> None:
    """Set the frame in the controller after a confirmation."""
    if not lines:
        return
    if not done.end.reached:
        complain("warning", "--write: the goal was not reached: nothing was written.")
        return
    if confirmed(f"Send these lines to {safe.facts.name}"):
        safe.write_frame(lines)
        print_text("The frame was sent, and the controller reports it.", sys.stderr)
    else:
        print_text("Nothing was written.", sys.stderr)
