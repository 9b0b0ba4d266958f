"""Implement ``tanteo ros``: a ROS 2 node that subscribes to readings and publishes poses."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

from tanteo import io, posterior, render
from tanteo.cli import arguments as args
from tanteo.cli import files, typed
from tanteo.cli.misuse import MisuseError, misuse, require_errors
from tanteo.cli.printing import complain, emit, layout, leave, print_text, put, warned
from tanteo.cli.readings import parse_direction, parse_latency, parse_radius, parse_time
from tanteo.cli.ros_arguments import ROS_ARGS, typed_value

if TYPE_CHECKING:
    from tanteo.io.readings import Direction
    from tanteo.parts import Part
    from tanteo.planning import Probe
    from tanteo.ros import Intake, RosNode
    from tanteo.ros.estimators import Estimator
    from tanteo.ros.network import Settings
else:  # the parser resolves annotations; this name avoids a slow import
    Direction = Any

_topics = partial(args.option, rich_help_panel="Topics and frames")


def _time(name: str) -> Any:
    return partial(parse_time, name, 0.0, 3600.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicOptions:
    """Options of the topics and time stamps of readings."""

    topics: Annotated[
        list[str] | None,
        _topics("--topic", "NAME", "Topic of readings or of the hand's poses; may be repeated. Detected if not given."),
    ] = None
    world: Annotated[
        str | None, _topics("--world", "FRAME", "Frame of the answers; the root of all frames if not given.")
    ] = None
    latency: Annotated[
        float | None,
        _topics("--latency", "TIME", "Time by which readings are older than their stamps, as 5ms."),
        typed.Words(parse_latency),
    ] = None
    radius: Annotated[
        float | None,
        _topics("--radius", "LENGTH", "Radius of the tip's ball if the points are its centres, as 1.5mm."),
        typed.Words(parse_radius),
    ] = None
    direction: Annotated[
        Direction | None,
        _topics("--direction", "DIRECTION", "Direction of the tip's motion, as down, -z, from:0,0,500mm."),
        typed.Words(parse_direction),
    ] = None
    patience: Annotated[
        float,
        _topics("--patience", "TIME", "Longest time to wait for the transforms at a reading's stamp."),
        typed.Words(_time("--patience"), str, "1s"),
    ]
    max_age: Annotated[
        float,
        _topics("--max-age", "TIME", "Largest age of a reading on arrival; older ones are discarded."),
        typed.Words(_time("--max-age"), str, "10s"),
    ]
    every: Annotated[
        float,
        _topics("--every", "TIME", "Smallest time between two readings of a topic; others are discarded."),
        typed.Words(_time("--every"), str, "0.1s"),
    ]
    node: Annotated[str, _topics("--node", "NAME", "Name of the node, and prefix of its topics and services.")] = (
        "tanteo"
    )
    part_frame: Annotated[
        str | None, _topics("--part-frame", "NAME", "Send the pose of the part to /tf, too, as this frame.")
    ] = None
    sim_time: Annotated[
        bool, _topics("--sim-time", None, "Take the time from /clock, for a simulation or a played bag.")
    ] = False
    lifecycle: Annotated[
        bool, _topics("--lifecycle", None, "Wait until ros2 lifecycle configures and activates the node.")
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """Options of ``ros``."""

    parts: args.PartPaths
    table: args.TableAt = None
    rests: args.RestsAt = None
    box: args.BoxAt = None
    pose_prior: args.PosePriorAt = None
    prior: args.PriorPath = None
    furniture: args.FurniturePaths = None
    noise_factor: args.NoiseFactor = None
    units: args.Units = None
    sensor: args.Sensor = None
    sd: args.Sd = None
    robot: args.Robot = None
    tip_sd: args.TipSd = None
    bias_sd: args.BiasSd = None
    rig: args.RigPath = None
    outlier_rate: args.OutlierRate = None
    unknown_prior: args.UnknownPrior = None
    form_sd: args.FormSd = 0.0
    goal: args.Goal = None
    max_measurements: Annotated[
        int,
        args.option("--max-measurements", None, "Largest number of readings until ~/reset."),
        typed.Words(partial(typed.at_least, "--max-measurements", 1, "Use 300"), int),
    ] = 300
    standoff: Annotated[
        float | None,
        args.option(
            "--standoff", "LENGTH", "Distance from the surface at which ~/next starts a reading; 50mm if not given."
        ),
        args.STANDOFF,
    ] = None
    once: Annotated[bool, args.option("--once", None, "End when the part is recognized.")] = False
    seed: args.Seed = 0
    json: args.Json = False
    verbose: args.Verbose = False

    def __post_init__(self) -> None:
        require_errors(self.sensor, self.sd)


def ros(options: Options, topics: TopicOptions) -> None:
    """Recognize and locate parts as a ROS 2 node.

    Subscribes to ranges and touches, and publishes poses with covariance.
    """
    from tanteo.ros.lifecycle import ManagedNode
    from tanteo.ros.network import opened

    settings, ended = _settings(options, topics), threading.Event()
    with _named(topics.node), opened(settings) as node:
        name = node.get_fully_qualified_name()
        if topics.lifecycle:
            managed = ManagedNode(node, settings, lambda changed: _server(node, options, topics, changed, ended), ended)
            print_text(
                f"Node {name} is unconfigured; configure it with: ros2 lifecycle set {name} configure", sys.stderr
            )
            with _ended_by_signals(ended):
                answer = managed.run()
        else:
            server = _server(node, options, topics, {}, ended)
            print_text(f"Listening as node {name}; Ctrl-C ends it.", sys.stderr)
            with _ended_by_signals(ended):
                answer = server.run()
    _print(answer, options)


def _settings(options: Options, topics: TopicOptions) -> Settings:
    from tanteo.ros.network import Settings

    return Settings(
        topics.node, topics.sim_time, options.max_measurements, options.once, topics.part_frame or "",
        tuple(ROS_ARGS.get()), _parameters(options, topics), topics.lifecycle,
    )  # fmt: skip


def _server(
    node: Any, options: Options, topics: TopicOptions, changed: Mapping[str, Any], ended: threading.Event
) -> RosNode:
    """Return the server of a node, with parts and estimator.

    Args:
        node: rclpy node.
        options: options as typed.
        topics: options of the topics as typed.
        changed: parameters that were set since.
        ended: event that ends the node.
    """
    from tanteo.ros import RosNode

    with misuse():
        options, topics = _with_parameters(options, changed), _with_parameters(topics, changed)
    parts = files.read_all_parts(options.parts, options.units, quiet=True)
    return RosNode(
        node, _intake(topics), _estimator(parts, options, topics), {part.name: part for part in parts},
        _settings(options, topics), lambda note: complain("warning", note), partial(_heard, options), ended=ended,
    )  # fmt: skip


def _with_parameters(group: Any, changed: Mapping[str, Any]) -> Any:
    """Return options in which the parameters that were set replace the typed values; empty text is no value."""
    annotations = get_type_hints(type(group), include_extras=True)
    values: dict[str, Any] = {}
    for name in {one.name for one in fields(group)} & set(changed):
        value = None if changed[name] == "" else changed[name]
        words = next((extra for extra in annotations[name].__metadata__ if isinstance(extra, typed.Words)), None)
        if words is None or value is None:
            values[name] = list(value) if isinstance(value, Sequence) and not isinstance(value, str) else value
        elif isinstance(value, Sequence) and not isinstance(value, str):
            values[name] = words.read([str(one) for one in value])
        else:
            values[name] = words.read(int(value) if words.typed is int else typed_value(name, str(value)))
    return replace(group, **values)


def _parameters(options: Options, topics: TopicOptions) -> dict[str, tuple[Any, str]]:
    """Return the options as parameters of the node with descriptions: numbers in SI units, otherwise text.

    Only a node with a lifecycle has parameters that are not given, since only there they can be set.
    """
    out: dict[str, tuple[Any, str]] = {}
    for group in (options, topics):
        annotations = get_type_hints(type(group), include_extras=True)
        for one in fields(group):
            value = getattr(group, one.name)
            words = next((e.help for e in annotations[one.name].__metadata__ if getattr(e, "help", None)), "")
            if isinstance(value, bool | int | float | str):
                out[one.name] = value, words
            elif isinstance(value, list | tuple) and value and all(isinstance(v, str) for v in value):
                out[one.name] = list(value), words
            elif topics.lifecycle:
                out[one.name] = None, words
    return out


@contextmanager
def _named(name: str) -> Iterator[None]:
    if not (name.isidentifier() and name.isascii()):
        raise MisuseError(f"--node: expected letters, digits and _, got '{name}'. Use --node tanteo.")
    yield


def _intake(topics: TopicOptions) -> Intake:
    from tanteo.ros import Intake, Patience

    stated = io.readings.Stated(radius=topics.radius, direction=topics.direction)
    wanted = io.RosOptions(tuple(topics.topics or ()), topics.world, topics.latency or 0.0)
    return Intake(wanted, stated, Patience(topics.patience, topics.patience, topics.max_age, topics.every))


def _estimator(parts: Sequence[Part], options: Options, topics: TopicOptions) -> Estimator:
    """Return a session if a prior pose is given; otherwise a recognizer of all readings together."""
    import numpy as np

    from tanteo.planning import Sensing, Session, Stop
    from tanteo.planning.start import Start
    from tanteo.posterior import prepare_all
    from tanteo.ros.estimators import JointEstimator, SessionEstimator

    rig = None if options.rig is None else files.read_rig(options.rig, options.sensor, options.sd)
    sensing = Sensing(
        sensor=options.sensor, sd=options.sd, robot=options.robot, tip_sd=options.tip_sd,
        shared_errors=options.bias_sd or (),
        rig=rig, tolerance=options.form_sd,
    )  # fmt: skip
    furniture = tuple(io.poses.read_furniture(text, options.units, "--furniture") for text in options.furniture or ())
    known = typed.read_known(options.table, options.box, None, options.prior, options.rests)
    if known is not None and options.pose_prior is not None:
        raise MisuseError(
            "--pose-prior: expected it without --table, --rests, --box and --prior in a node, got both. Drop one."
        )
    stated: dict[str, Any] = {
        "outlier_rate": options.outlier_rate, "unknown": options.unknown_prior, "pose": known,
        "noise_factor": options.noise_factor, "furniture": furniture or None,
    }  # fmt: skip
    with misuse():
        priors = posterior.Priors(**{name: value for name, value in stated.items() if value is not None})
    stop = Stop(tolerance=options.goal, max_measurements=options.max_measurements)
    probe = _probe(options, topics)
    if options.pose_prior is None:
        return JointEstimator(parts, probe, sensing, stop, priors, options.seed)
    n, near = len(parts), options.pose_prior
    Ts, Cs = np.repeat(near.T[None], n, axis=0), np.repeat(near.C[None], n, axis=0)
    start = Start(tuple(prepare_all("parts", parts)), np.arange(n), Ts, Cs, np.ones(n), priors)
    return SessionEstimator(lambda: Session(start, probe, sensing, stop=stop, seed=options.seed))


def _probe(options: Options, topics: TopicOptions) -> Probe:
    """Return the probe for the choice of readings."""
    from tanteo.planning import probe_of

    where: dict[str, Any] = {"form_sd": options.form_sd}
    if options.standoff is not None:
        where["standoff"] = options.standoff
    if topics.radius is not None:
        where |= {"contact": True, "radius": topics.radius}
    with misuse():
        return probe_of(options.sensor or options.sd or 0.0, options.robot, **where)


@contextmanager
def _ended_by_signals(ended: threading.Event) -> Iterator[None]:
    """End the node, and not the process, on Ctrl-C or a termination signal, so that the answer is still printed."""
    numbers = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {number: signal.signal(number, lambda *_: ended.set()) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)


def _heard(options: Options, answer: posterior.Answer) -> None:
    """Print one line for each answer with ``--verbose``."""
    if options.verbose:
        print_text(render.text.answer_lines(answer, layout=layout())[0], sys.stderr)


def _print(answer: posterior.Answer | None, options: Options) -> None:
    if answer is None:
        complain("warning", "no usable reading arrived: check the topics and their types (ros2 topic list).")
        leave(decided=False)
        return
    if options.json:
        put(io.documents.document_json(io.recognition_document(answer), warned()))
    else:
        emit(render.text.answer_lines(answer, verbose=options.verbose, layout=layout()))
    leave(decided=answer.status == "recognized")
