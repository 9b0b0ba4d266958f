"""Print an answer in the syntax of a controller: ``--as`` and ``--wcs`` of ``identify`` and ``locate``.

Only a decided answer is written, because a program that runs in a frame does not take its uncertainty into account.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from tanteo import io
from tanteo.cli import arguments as args
from tanteo.cli import typed
from tanteo.cli.misuse import MisuseError
from tanteo.cli.printing import complain
from tanteo.errors import InputError
from tanteo.words.findings import AccuracyNeeded

if TYPE_CHECKING:
    from tanteo.io.poses import WorkFrame
    from tanteo.parts import Part
    from tanteo.posterior import Answer
else:  # the parser resolves annotations; this name avoids a slow import
    WorkFrame = Any


def _controller(text: str) -> str:
    """Return the name of a controller; ``io`` is loaded when one is given."""
    try:
        return io.poses.check_pose_name(text)
    except InputError as error:
        try:
            frame = io.poses.parse_work_frame(text)
        except InputError:
            raise MisuseError(f"--as: {error}") from None
        raise MisuseError(
            f"--as: expected a controller that reads poses, got '{text}', which has work frames. Use --wcs "
            f"{frame.controller}:{frame.slot}."
        ) from None


def work_frame(text: str) -> WorkFrame:
    """Return the work frame that a text names; ``io`` is loaded when one is given."""
    try:
        return io.poses.parse_work_frame(text)
    except InputError as error:
        raise MisuseError(f"--wcs: {error}") from None


_output = partial(args.option, rich_help_panel="Output")

PoseAs = Annotated[
    str | None,
    _output(
        "--as",
        "CONTROLLER",
        "Print the best pose as this controller writes it: kuka, ur, ros, ... (a wrong name lists all).",
    ),
    typed.Words(_controller),
]
Wcs = Annotated[
    WorkFrame | None,
    _output(
        "--wcs",
        "FRAME",
        "Print the lines that set this work frame to the pose: G54, haas:G54, fanuc:G54, siemens:G54, heidenhain, "
        "fanuc:1, kuka:1, abb:NAME, ...",
    ),
    typed.Words(work_frame),
]
Which = Annotated[
    int | None,
    _output(
        "--which", "NUMBER", "With --as or --wcs: number of the part to write, if several equal parts were sensed."
    ),
    typed.Words(partial(typed.at_least, "--which", 1, "Use 1"), int),
]
BestGuess = Annotated[
    bool, _output("--best-guess", None, "With --as or --wcs: write the best pose of an ambiguous answer, too.")
]
AcceptTurnLost = Annotated[
    bool,
    _output(
        "--accept-turn-lost", None, "With --wcs: write a frame that omits a rotation of the part, at your own check."
    ),
]


@dataclass(frozen=True, slots=True)
class Words:
    """Output that ``--as`` and ``--wcs`` request.

    Attributes:
        pose_as: name of a controller; None for none.
        wcs: work frame of a controller; None for none.
        best_guess: whether to write the best pose of an ambiguous or insufficient answer.
        accept_turn_lost: whether to write a frame that omits a rotation of the part.
        doubt: probable mistake in the readings that is not a finding of the answer; empty for none.
        which: number of the part that is written, of several equal ones; None if there is one.
    """

    pose_as: str | None
    wcs: WorkFrame | None
    best_guess: bool
    accept_turn_lost: bool = False
    doubt: str = ""
    which: int | None = None

    def __post_init__(self) -> None:
        if self.pose_as is not None and self.wcs is not None:
            raise MisuseError("--as, --wcs: expected one of the two, got both. Run it once for each.")
        if self.best_guess and not self:
            raise MisuseError("--best-guess: expected with --as or --wcs, got neither. Add one, or drop --best-guess.")
        if self.which is not None and not self:
            raise MisuseError("--which: expected with --as or --wcs, got neither. Add one, or drop --which.")
        if self.accept_turn_lost and self.wcs is None:
            raise MisuseError("--accept-turn-lost: expected with --wcs, got none. Add it, or drop --accept-turn-lost.")

    def __bool__(self) -> bool:
        return self.pose_as is not None or self.wcs is not None

    @property
    def option(self) -> str:
        """Name of the option that requests the output."""
        return "--as" if self.wcs is None else "--wcs"

    def document(self, answer: Answer, parts: Sequence[Part]) -> dict[str, Any]:
        """Return the keys for ``--json``: ``text`` with its format, or ``text: null`` with the reason as ``refused``.

        Args:
            answer: answer to write.
            parts: candidate parts.
        """
        key = "as" if self.wcs is None else "wcs"
        why, answer = self.refused(answer), self._chosen(answer)
        if why is not None:
            return {key: {"text": None, "refused": why}}
        if self.wcs is not None:
            frame = self._frame(answer, parts)
            where = {"controller": self.wcs.controller, "frame": self.wcs.slot}
            return {key: {**where, "text": frame.text, "warnings": [*_doubts(answer), *frame.warnings]}}
        pose = io.write_pose(self.pose_as or "", _upright(answer, parts), answer.frame, answer.stamp)
        facts = {"name": pose.name, "frame": answer.frame, "units": pose.units, "verified": pose.verified}
        doubts = [*_doubts(answer), *filter(None, [_frame_doubt(answer.frame, pose.name)])]
        return {key: {**facts, "values": pose.values, "text": pose.text, "warnings": doubts}}

    def text(self, answer: Answer, parts: Sequence[Part]) -> str:
        """Return the text for standard output, and print warnings; empty if the answer is not written.

        Args:
            answer: answer to write.
            parts: candidate parts.
        """
        why, answer = self.refused(answer), self._chosen(answer)
        if why is not None:
            complain("error", f"{self.option}: {why}")
            return ""
        for doubt in _doubts(answer):
            complain("warning", f"{self.option}: {doubt}")
        if self.wcs is not None:
            frame = self._frame(answer, parts)
            for warning in frame.warnings:
                complain("warning", f"--wcs: {warning}")
            return frame.text
        pose = io.write_pose(self.pose_as or "", _upright(answer, parts), answer.frame, answer.stamp)
        if not pose.verified:
            complain("warning", f"--as {pose.name}: {_UNVERIFIED} ({io.BRANDS[pose.name].source}).")
        if why := _frame_doubt(answer.frame, pose.name):
            complain("warning", f"--as {pose.name}: {why}")
        return f"{pose.text}\n"

    def refused(self, answer: Answer) -> str | None:
        """Return why an answer is not written; None if it is written.

        Args:
            answer: answer to write.
        """
        count = 1 + len(answer.equal)
        if (self.which or 1) > count:
            return f"expected --which from 1 to {count}, got {self.which}. Nothing is written."
        if answer.equal and self.which is None:
            return f"expected --which from 1 to {count}, because {count} equal parts were sensed, got none. Add it."
        if answer.status == "unknown" or not answer.hypotheses:
            return f"expected an answer that names a part and its pose, got {answer.status}. Nothing is written."
        if self.best_guess:
            return None
        missed = [one for one in answer.findings if isinstance(one, AccuracyNeeded) and not one.reached]
        if missed:
            return f"{missed[0].message} No pose is written for a program. Sense more, or use --best-guess."
        if mistake := self.doubt or next((one.message for one in answer.findings if one.subject), ""):
            return (
                f"expected readings without a sign of a mistake: {mistake} No pose is written for a program. Correct "
                "it, or use --best-guess to write the best pose."
            )
        if answer.status == "recognized":
            return None
        return (
            f"expected a decided answer, got {answer.status}: no pose is written for a program. Sense more, or use "
            "--best-guess to write the best pose."
        )

    def _chosen(self, answer: Answer) -> Answer:
        """Return the answer for the part that is written."""
        k = (self.which or 1) - 1
        return answer if not 0 < k <= len(answer.equal) else answer.equal[k - 1]

    def _frame(self, answer: Answer, parts: Sequence[Part]) -> io.poses.WrittenFrame:
        from tanteo.parts import part_named
        from tanteo.planning.following import corner_error
        from tanteo.posterior import box_corners

        assert self.wcs is not None
        best = answer.hypotheses[0]
        part = part_named(parts, best.part)
        error = corner_error(best, part)
        of_part = "".join(f"part {P:.1%}, this pose " for _, P in answer.several_poses[:1])
        named = f"{best.part}: {answer.status}, {of_part}{best.probability:.1%}"

        def note(omitted: float) -> str:
            lost = ", with the omitted rotation" if omitted else ""
            return f"{named}, farthest corner within {1e3 * (error + omitted):.3g} mm (95 %){lost}"

        corners = box_corners(part)
        return io.poses.write_work_frame(
            self.wcs, _upright(answer, parts), corners, note, accept_lost=self.accept_turn_lost
        )


_UNVERIFIED = "the convention was not verified in the brand's documentation: confirm one pose on your controller"


def _frame_doubt(frame: str, name: str) -> str:
    """Return a sentence on the frame of a pose for a controller; empty for a frame without a name of its own."""
    if frame == "world" or name in ("ros", "gtsam", "matrix"):
        return ""
    note = f"the pose is in the frame '{frame}'."
    if name == "ur" and frame.rpartition("/")[2].endswith("base_link"):
        note += (
            " The controller of a Universal Robot has it in 'base', which is turned by 180 degrees about z: use "
            f"--world {frame.removesuffix('_link')}."
        )
    return note


def _doubts(answer: Answer) -> list[str]:
    """Return warnings about the pose that a program will use."""
    best, doubts = answer.hypotheses[0], []
    if answer.status != "recognized":
        doubts.append(f"the answer is {answer.status}; this is its best guess.")
    for name, P in answer.several_poses[:1]:
        doubts.append(f"{name} has a probability of {P:.1%} in any pose, and {best.probability:.1%} in this one.")
    if best.spherical:
        doubts.append("the part is a ball: its whole orientation is arbitrary; only its position was measured.")
    elif best.symmetry_axis is not None:
        doubts.append(
            "the part is a solid of revolution: of its equivalent poses, that with z up and the least turn is written."
        )
    elif best.symmetry_order > 1:
        doubts.append(
            f"the part is identical in {best.symmetry_order} poses: that with z up and the least turn is written."
        )
    return doubts


def _upright(answer: Answer, parts: Sequence[Part]) -> Any:
    """Return the best pose, of the equivalent ones that with z up and the least turn, as an ``UncertainFrame``."""
    import numpy as np

    from tanteo.geometry import SE3, UncertainFrame
    from tanteo.parts import part_named
    from tanteo.posterior.symmetry import upright

    best = answer.hypotheses[0]
    S = upright(part_named(parts, best.part), best.T_world_part)
    A = SE3.adjoint_inverse(S)
    return UncertainFrame(best.T_world_part @ S, np.asarray(A @ best.covariance @ A.T))
