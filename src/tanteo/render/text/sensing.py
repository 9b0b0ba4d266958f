"""Results of a hand as lines of text: acquired features, and actions of a session."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tanteo.features import feature_covariance, relate_size
from tanteo.geometry import SO3
from tanteo.hand.acquisition import EdgeGuess, FaceGuess, RoundGuess
from tanteo.render.text.answers import answer_lines
from tanteo.render.text.layout import PLAIN, Layout, printable
from tanteo.words.sentences import acquisition_message

if TYPE_CHECKING:
    from tanteo.features import Feature
    from tanteo.hand import Predicted
    from tanteo.hand.acquisition import Acquired
    from tanteo.planning.execution import Executed, Visit
    from tanteo.posterior import Answer


def sensed_lines(
    got: Acquired,
    *,
    standoff: float,
    clearance: float,
    seed: int,
    record: str | None = None,
    expected: Predicted | None = None,
    verbose: bool = False,
    layout: Layout = PLAIN,
) -> list[str]:
    """Return the result of an acquisition as lines of text.

    Args:
        got: result of the acquisition.
        standoff: stand-off of the hand's front [m].
        clearance: smallest distance of the hand from all objects [m].
        seed: seed of the simulated errors.
        record: file of the readings; None without one.
        expected: prediction from an image; None without one.
        verbose: whether to add all motions.
        layout: width and style of the output.
    """
    lines = [
        layout.bold(
            printable(
                f"{got.status}: {got.kind} {_where(got.feature)}" if got.feature else f"{got.status}: no {got.kind}"
            )
        )
    ]
    if got.feature is not None:
        lines += _spread(got.feature)
        lines += [f"  image       {_compared(expected, got.feature)}"] if expected is not None else []
    lines += [f"  also        {f.kind.name} '{printable(f.label)}' {_where(f)}" for f in got.others]
    if got.readings is not None:
        used = ", ".join(dict.fromkeys(got.readings.sensors))
        lines.append(
            f"  readings    {len(got.readings)} ranges of {used}" + (f", written to {record}" if record else "")
        )
    lines.append(f"  time        {got.seconds:.1f} s simulated, {len(got.motions)} motions, seed {seed}")
    lines.append(
        f"  clearance   {1e3 * clearance:.1f} mm at least, of the whole hand from everything; the stand-off was "
        f"{1e3 * standoff:.3g} mm"
    )
    if verbose:
        lines += [f"    {m.seconds:6.2f} s  {m.name:10}  {m.status:8}  {printable(m.message)}" for m in got.motions]
    return [*lines, "", printable(acquisition_message(got.status, got.finding))]


def _where(feature: Feature | None) -> str:
    if feature is None:
        return ""
    T = feature.T_world_feature
    place = "at x {:z.2f} y {:z.2f} z {:z.2f} mm".format(*(1e3 * T[:3, 3]))
    axis = feature.kind.axis
    if axis is None:
        return place + " in the world"
    name = "along" if axis == 0 else "axis" if feature.kind.size_name else "outward normal"
    return place + ", {} ({:.4f}, {:.4f}, {:.4f}) in the world".format(name, *T[:3, axis])


def _spread(feature: Feature) -> list[str]:
    """Return the standard deviations of a feature, with and without the errors that all readings share."""
    rows = list(feature.kind.rows)
    whole = np.sqrt(np.diag(feature_covariance(feature))[rows])
    own = np.sqrt(np.diag(feature.P))
    names = {0: "along x", 1: "along y", 2: "along z", 3: "about x", 4: "about y", 5: "about z"}
    if feature.kind.shape == "plane":
        names[2] = "along the normal"

    def words(sds: np.ndarray) -> str:
        return ", ".join(
            f"{1e3 * s:.3g} mm {names[r]}" if r < 3 else f"{np.degrees(s):.3g} deg {names[r]}"
            for s, r in zip(sds, rows, strict=True)
        )

    return [
        *_size(feature),
        f"  sd          {words(whole)}, in the feature's own frame ({feature.kind.frame})",
        f"  of readings {words(own)}, without the errors that all readings of a sensor share",
    ]


def _size(feature: Feature) -> list[str]:
    """Return the radius or half angle of a round feature, and the side of the material."""
    if feature.size is None:
        return []
    value, sd = feature.size.value, float(np.sqrt(relate_size(feature).covariance[0, 0]))
    shown = f"{1e3 * value:.4f} mm" if feature.radius is not None else f"{np.degrees(value):.3f} deg"
    spread = f"{1e3 * sd:.3g} mm" if feature.radius is not None else f"{np.degrees(sd):.3g} deg"
    side = {True: ", a boss", False: ", a bore", None: ""}[feature.convex]
    return [f"  {feature.kind.size_name:<11} {shown}, sd {spread}{side}"]


def known_words(expected: Predicted) -> str:
    """Return the standard deviations of a feature that an image predicts, as text.

    Args:
        expected: feature predicted from an image.
    """
    return f"known from the image to {1e3 * expected.guess.sd:.2g} mm and {np.degrees(expected.guess.turn_sd):.2g} deg"


def _compared(expected: Predicted, got: Feature) -> str:
    """Return the deviation of a sensed feature from the feature that an image predicted, as text."""
    T, guess = got.T_world_feature, expected.guess
    gap = guess.point - T[:3, 3]
    if isinstance(guess, FaceGuess):
        off, own, expected_axis = f"{1e3 * abs(gap @ T[:3, 2]):.2g}", T[:3, 2], guess.normal
    elif isinstance(guess, EdgeGuess):
        own = T[:3, 0] * np.sign(T[:3, 0] @ guess.direction)
        off, expected_axis = f"{1e3 * np.linalg.norm(SO3.cross(gap, own)):.2g}", guess.direction
    elif isinstance(guess, RoundGuess):
        own = T[:3, 2] * np.sign(T[:3, 2] @ guess.axis)
        off, expected_axis = f"{1e3 * np.linalg.norm(SO3.cross(gap, own)):.2g}", guess.axis
    else:
        return f"{1e3 * np.linalg.norm(gap):.2g} mm off what was expected, {known_words(expected)}"
    turned = f"{np.degrees(np.arctan2(np.linalg.norm(SO3.cross(own, expected_axis)), own @ expected_axis)):.2g}"
    return f"{off} mm and {turned} deg off what was expected, {known_words(expected)}"


def executed_lines(
    answer: Answer,
    done: Executed,
    count: int,
    clearance: float,
    *,
    arm: Sequence[str] = (),
    verbose: bool = False,
    layout: Layout = PLAIN,
) -> list[str]:
    """Return the result of a session with a hand as lines of text: answer, cost and reason for the end.

    Args:
        answer: answer of the session.
        done: actions of the hand and their results.
        count: number of readings.
        clearance: smallest distance of the hand from all objects [m].
        arm: facts about the arm that carried the hand.
        verbose: whether to add matrix, pairings and times of the stages.
        layout: width and style of the output.
    """
    headline, *rest = answer_lines(answer, verbose=verbose, layout=layout)
    cost = (
        f"  cost        {count} readings, {done.seconds:.1f} s simulated, {done.travel:.2f} m of travel, "
        f"clearance {1e3 * clearance:.1f} mm at least"
    )
    return [headline, cost, *(f"  arm         {line}" for line in arm), *rest, printable(done.end.message)]


def executed_facts(done: Executed, count: int, clearance: float) -> list[tuple[str, str]]:
    """Return the cost of a session with a hand as facts for a report.

    Args:
        done: actions of the hand and their results.
        count: number of readings.
        clearance: smallest distance of the hand from all objects [m].
    """
    return [
        ("Reason for the end", done.end.message),
        ("Actions, readings", f"{len(done.visits)}, {count}"),
        ("Time and path of the hand, simulated", f"{done.seconds:.1f} s, {done.travel:.2f} m"),
        ("Smallest clearance", f"{1e3 * clearance:.1f} mm"),
    ]


def visit_lines(visit: Visit, *, verbose: bool = False) -> list[str]:
    """Return an action of a hand and its result as one line, followed by its motions if verbose.

    Args:
        visit: action and its result.
        verbose: whether to add the motions.
    """
    action, step = visit.action, visit.step
    words = f"{action.number:3}  {visit.seconds:6.1f} s {visit.travel:6.2f} m  {action.aim}"
    if step is not None and len(step.ids):
        count = "1 reading" if len(step.ids) == 1 else f"{len(step.ids)} readings"
        words += f", {count}: {_state(visit)}"
    words += f" ({visit.note})" if visit.note else ""
    lines = [printable(words)]
    if verbose:
        lines.append(f"       {printable(action.words)}")
        lines += [f"       {m.seconds:6.2f} s  {m.name:8}  {m.status:8}  {printable(m.message)}" for m in visit.motions]
    return lines


def _state(visit: Visit) -> str:
    """Return the most probable part, its probability and its largest corner sd."""
    step = visit.step
    if step is None or step.part < 0:
        return "no part explains the readings"
    probability = float(step.probabilities[step.part])
    words = f"{visit.leader} P = {probability:.3f}" if probability < 0.9995 else f"{visit.leader} P > 0.999"
    return f"{words}, largest corner sd {1e3 * step.corner_sd:.2f} mm"
