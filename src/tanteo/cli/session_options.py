"""Define the options of a session in a scene."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated

from tanteo.cli import arguments as args
from tanteo.cli import typed
from tanteo.cli.assumed_errors import AssumedErrors
from tanteo.cli.misuse import MisuseError, require_image
from tanteo.cli.typed import Words

if TYPE_CHECKING:
    from tanteo.planning import Stop
    from tanteo.posterior import PosePrior


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionOptions(AssumedErrors):
    """Options of a session in a scene: policy, stopping criterion, prior knowledge, and an image to start from."""

    policy: Annotated[
        str,
        args.sensing(
            "--policy",
            "NAME",
            "Policy that chooses the next reading: information, information-per-second, features, random, nearest, "
            "largest-face, 3-2-1.",
            autocompletion=typed.policy_names,
        ),
        Words(typed.policy, str),
    ] = "information"
    probability: Annotated[
        float,
        args.sensing("--probability", None, "Probability of a part at which the session ends."),
        Words(partial(typed.fraction, "--probability", "probability", "0.99"), float),
    ] = 0.99
    goal: args.Goal = None
    feature: args.Feature = None
    confidence: args.Confidence = 0.95
    form_sd: args.FormSd = 0.0
    max_measurements: Annotated[
        int,
        args.sensing("--max-measurements", None, "Largest number of readings."),
        Words(partial(typed.at_least, "--max-measurements", 1, "Use 100"), int),
    ] = 100
    standoff: args.Standoff = None
    units: args.Units = None
    pose_prior: args.PosePriorAt = None
    prior: args.PriorPath = None
    outlier_rate: args.OutlierRate = None
    unknown_prior: args.UnknownPrior = None
    image: args.ImageFile = None
    camera: args.CameraFile = None
    marks: args.MarksFile = None
    seed: args.SceneSeed = None

    def __post_init__(self) -> None:
        if self.feature is not None and self.goal is None:
            raise MisuseError(f"--feature: expected --goal with '{self.feature}', got none. Add --goal 0.5mm.")
        require_image(self.image, self.camera, self.marks)

    def known(self) -> PosePrior | None:
        """Return the prior pose; None if there is none.

        Raises:
            MisuseError: a table or a box is given.
        """
        known = typed.read_known(None, None, self.pose_prior, self.prior)
        if known is not None and (known.T_world_part is None or known.table is not None or known.box is not None):
            raise MisuseError(
                "--pose-prior, --prior: expected only a prior pose, got a table or a box. Use --pose-prior."
            )
        return known

    def stop(self) -> Stop:
        """Return the stopping criterion."""
        from tanteo.planning import Stop

        return Stop(
            probability=self.probability, tolerance=self.goal, confidence=self.confidence,
            max_measurements=self.max_measurements, feature=self.feature,
        )  # fmt: skip
