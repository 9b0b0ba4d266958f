"""The images from which a session starts, in its record (``docs/formats.md``)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.factors import PoseFactor
from tanteo.geometry.typing import FloatArray, IntArray, Transforms
from tanteo.planning.execution import prior_poses
from tanteo.planning.start import Start
from tanteo.posterior import Alternatives, OnTable, PreparedPart
from tanteo.vision import Camera
from tanteo.vision.edges import EdgePoints, map_edges
from tanteo.vision.image_edges import ImageEdges, Weights, chance_map


@dataclass(frozen=True, slots=True, eq=False)
class PoseConstants:
    """The constants about the poses of one part that an image suggests."""

    part: int
    Ts: Transforms
    constants: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ImageTable:
    """The edges of one image; ``chance`` is empty where it is measured in windows of the image.

    ``bare`` has the lengths of runs of pixels, row by row, that do not and that do show bare table, in turn.
    """

    camera: Camera
    points: EdgePoints
    chance: FloatArray
    bare: IntArray | None
    weights: Weights
    log_unknown: float
    poses: tuple[PoseConstants, ...]

    @classmethod
    def of(cls, image: ImageEdges, targets: Sequence[PreparedPart]) -> ImageTable:
        """Return the table of an image."""
        index = {target.part: k for k, target in enumerate(targets)}
        chance = np.asarray(image.chance).ravel()
        return cls(
            image.camera, image.edges.points, chance if chance.size == 1 else np.zeros(0),
            None if image.bare is None else _runs(image.bare), image.weights, float(image.log_unknown),
            tuple(PoseConstants(index[part], *known) for part, known in (image.levels or {}).items() if part in index),
        )  # fmt: skip

    def image(self, targets: Sequence[PreparedPart]) -> ImageEdges:
        """Return the image as a factor.

        Raises:
            InputError: a part or a number of pixels that is none.
        """
        if any(not 0 <= one.part < len(targets) for one in self.poses):
            raise InputError(f"poses, part: expected indices of {len(targets)} parts. Correct them.")
        rows, columns = self.points.shape
        if self.bare is not None and int(self.bare.sum()) != rows * columns:
            raise InputError(f"bare: expected runs of {rows * columns} pixels, got {int(self.bare.sum())}.")
        edges = map_edges(self.points)
        levels = {targets[one.part].part: (one.Ts, one.constants) for one in self.poses}
        return ImageEdges(
            self.camera, edges, self.chance if len(self.chance) else chance_map(edges),
            None if self.bare is None else _from_runs(self.bare).reshape(rows, columns), self.weights,
            self.log_unknown, {part: Ts for part, (Ts, _) in levels.items()}, levels,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class RestTable:
    """The table on which the part lies, see :class:`tanteo.posterior.OnTable`."""

    T_world_table: Transforms
    height_sd: float
    tilt_sd: float
    area: float


@dataclass(frozen=True, slots=True, eq=False)
class SeenTable:
    """What a session starts from beside prior poses.

    Attributes:
        images: the images.
        table: the table on which the part lies; None if it may lie anyhow.
        suggested: number of prior poses, the first ones, that only the images suggest.
        log_weights: log weights of the images, and of the prior poses where the images are wrong; empty without those.
        log_unknown: log density of all of it if the object is unknown; 0 without prior poses.
    """

    images: tuple[ImageTable, ...]
    table: RestTable | None
    suggested: int
    log_weights: FloatArray
    log_unknown: float

    @classmethod
    def of(cls, start: Start) -> SeenTable | None:
        """Return the table of the factors of a start; None without any.

        Raises:
            InputError: there are factors that a record cannot hold.
        """
        if not start.factors:
            return None
        factors, logs, log_unknown = start.factors, np.zeros(0), 0.0
        if len(factors) == 1 and isinstance(either := factors[0], Alternatives):
            factors, logs, log_unknown = either.groups[0], either.log_weights, either.log_unknown
        images = [one for one in factors if isinstance(one, ImageEdges)]
        tables = [one for one in factors if isinstance(one, OnTable)]
        if len(images) + len(tables) < len(factors) or len(tables) > 1:
            raise InputError("start, factors: expected images and a table, got others. A record can hold only these.")
        rest = [RestTable(one.T_world_table, one.height_sd, one.tilt_sd, one.area) for one in tables]
        return cls(
            tuple(ImageTable.of(image, start.targets) for image in images), rest[0] if rest else None,
            start.suggested, logs, float(log_unknown),
        )  # fmt: skip

    def factors(
        self, targets: Sequence[PreparedPart], part: IntArray, Ts: Transforms, covariances: FloatArray, w: FloatArray
    ) -> tuple[PoseFactor, ...]:
        """Return the factors of a start with these prior poses."""
        out: tuple[PoseFactor, ...] = tuple(image.image(targets) for image in self.images)
        if self.table is not None:
            rest = self.table
            out = (*out, OnTable(rest.T_world_table, rest.height_sd, rest.tilt_sd, rest.area))
        if not len(self.log_weights):
            return out
        own = slice(self.suggested, None)
        poses = prior_poses(targets, part[own], Ts[own], covariances[own], w[own])
        return (Alternatives((out, (poses,)), self.log_weights, self.log_unknown),)


def _runs(mask: np.ndarray) -> IntArray:
    """Return lengths of runs of a mask, of false ones first."""
    flat = np.r_[False, np.asarray(mask, dtype=bool).ravel()]
    ends = np.r_[np.flatnonzero(flat[1:] != flat[:-1]), len(flat) - 1]
    return np.asarray(np.diff(np.r_[0, ends]), dtype=np.int64)


def _from_runs(runs: IntArray) -> np.ndarray:
    """Return the mask of such runs."""
    return np.repeat(np.arange(len(runs)) % 2 == 1, runs)
