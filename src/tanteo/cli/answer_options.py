"""Define the options of ``tanteo identify`` and ``tanteo locate``, and the prior knowledge that they state."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tanteo import io, posterior
from tanteo.cli import arguments as args
from tanteo.cli import controller
from tanteo.cli.assumed_errors import AssumedErrors
from tanteo.cli.image import Cameras
from tanteo.cli.misuse import MisuseError
from tanteo.defaults import SIGNIFICANCE, TOP

if TYPE_CHECKING:
    from tanteo.cli.error_options import Errors
    from tanteo.factors import PoseFactor


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence(AssumedErrors):
    """Options for what is known beside the readings: errors, priors, and further measurements."""

    units: args.Units = None
    sensor: args.Sensor = None
    sd: args.Sd = None
    form_sd: args.FormSd = 0.0
    robot: args.Robot = None
    tip_sd: args.TipSd = None
    bias_sd: args.BiasSd = None
    fan_sd: args.FanSd = None
    stock: args.Stock = None
    noise_factor: args.NoiseFactor = None
    outlier_rate: args.OutlierRate = None
    unknown_prior: args.UnknownPrior = None
    rig: args.RigPath = None
    furniture: args.FurniturePaths = None
    table: args.TableAt = None
    rests: args.RestsAt = None
    box: args.BoxAt = None
    pose_prior: args.PosePriorAt = None
    prior: args.PriorPath = None
    mass: args.Mass = None
    density: args.Density = None
    size: args.Size = None
    factor: args.Factors = None
    image: args.ImagePaths = None
    camera: args.CameraPaths = None
    marks: args.MarksPaths = None
    hand_poses: args.HandPosesPath = None
    hand_eye: args.HandEyePath = None
    hand_eye_sd: args.HandEyeSd = None
    no_table: args.NoTable = False
    detections: args.DetectionsPath = None
    significance: args.Significance = SIGNIFICANCE
    json: args.Json = False
    seed: args.Seed = 0
    verbose: args.Verbose = False

    @property
    def shared_errors(self) -> Errors:
        """Return the errors that all readings share, of all options."""
        return *(self.bias_sd or ()), *self.stated_errors, *(self.fan_sd or ()), *(self.stock or ())

    @property
    def cameras(self) -> Cameras:
        """Return the options of the cameras of images."""
        return Cameras(
            camera=self.camera, marks=self.marks, hand_poses=self.hand_poses, hand_eye=self.hand_eye,
            hand_eye_sd=self.hand_eye_sd, robot=self.robot, no_table=self.no_table,
        )  # fmt: skip

    def factors(self) -> tuple[PoseFactor, ...]:
        """Return the factors in the files of ``--factor``.

        Raises:
            MisuseError: an option is not ``NAME=FILE``, or the file does not exist.
        """
        found = []
        for text in self.factor or ():
            name, _, path = text.partition("=")
            if not name or not path:
                raise MisuseError(f"--factor: expected the name of a plug-in and a file, as NAME=FILE, got '{text}'.")
            if not Path(path).exists():
                raise MisuseError(f"--factor: expected a file, got '{path}', which does not exist. Check the path.")
            found.append(io.readings.read_factor(name, path))
        return tuple(found)

    def priors(
        self, known: posterior.PosePrior | None, outline: posterior.SeenOutline | None = None
    ) -> posterior.Priors | None:
        """Return the prior knowledge that the options and an image state; None if there is none.

        Args:
            known: prior knowledge of the pose.
            outline: outline of the object in an image.
        """
        from tanteo.sensors.presets import sensor_outlier_rate  # slow to import

        furniture = tuple(io.poses.read_furniture(text, self.units, "--furniture") for text in self.furniture or ())
        rate = self.outlier_rate if self.outlier_rate is not None else sensor_outlier_rate(self.sensor)
        stated: dict[str, Any] = {
            "pose": known, "outlier_rate": rate, "unknown": self.unknown_prior,
            "noise_factor": self.noise_factor, "furniture": furniture or None, "whole": self._whole(outline),
        }  # fmt: skip
        stated = {name: value for name, value in stated.items() if value is not None}
        return posterior.Priors(**stated) if stated else None

    def _whole(self, outline: posterior.SeenOutline | None) -> posterior.WholeObject | None:
        """Return the measured global properties of the object: mass, size and outline."""
        if self.mass is None and self.size is None and outline is None:
            if self.density is not None:
                raise MisuseError("--density: expected --mass beside it, got none. Add --mass, or drop --density.")
            return None
        sides, sd = self.size or (None, 0.0)
        return posterior.WholeObject(self.mass, self.density, sides, sd, outline)


@dataclass(frozen=True, slots=True, kw_only=True)
class Options(Evidence):
    """Options of ``identify`` and ``locate``."""

    top: args.Top = TOP
    count: args.Count = None
    as_published: args.AsPublished = False
    need: args.Need = None
    report: args.Report = None
    pose_as: controller.PoseAs = None
    wcs: controller.Wcs = None
    which: controller.Which = None
    best_guess: controller.BestGuess = False
    accept_turn_lost: controller.AcceptTurnLost = False
