"""Tables of a session record for the images from which the session starts (``docs/formats_json.md``)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.errors import InputError
from tanteo.factors import PoseFactor
from tanteo.geometry.typing import FloatArray, IntArray, Transforms
from tanteo.planning.execution import prior_poses
from tanteo.planning.start import Start
from tanteo.posterior import OnTable, PreparedPart
from tanteo.posterior.alternatives import Alternatives
from tanteo.vision import Camera
from tanteo.vision.camera import Mounting
from tanteo.vision.edges import EdgePoints, chance_hits, map_edges
from tanteo.vision.image_edges import ImageEdges, Weights


@dataclass(frozen=True, slots=True, eq=False)
class PoseConstants:
    """Table of the poses of one part in an image, with the log density that each pose has by the image.

    Attributes:
        part: index of the part.
        Ts: poses ``T_world_part`` ``(k, 4, 4)`` [m].
        constants: constants of the log density of the image at each pose ``(k, ...)``, see ``ImageEdges.levels``.
    """

    part: int
    Ts: Transforms
    constants: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ImageTable:
    """Table of the edges of one image.

    Attributes:
        camera: camera of the image.
        points: edge points of the image.
        chance: probability of a random edge like each edge point, if it is one for all; empty if it is computed again
            from the edge points.
        weights: weights of the image factor.
        log_unknown: log density of the image if the object is unknown.
        poses: constants of the poses by part.
    """

    camera: Camera
    points: EdgePoints
    chance: FloatArray
    weights: Weights
    log_unknown: float
    poses: tuple[PoseConstants, ...]

    @classmethod
    def of(cls, image: ImageEdges, targets: Sequence[PreparedPart]) -> ImageTable:
        """Return the table of an image.

        Args:
            image: factor of the image.
            targets: parts of the session, in order.
        """
        index = {target.part: k for k, target in enumerate(targets)}
        chance = np.asarray(image.chance).ravel()
        return cls(
            image.camera, image.edges.points, chance if chance.size == 1 else np.zeros(0),
            image.weights, float(image.log_unknown),
            tuple(PoseConstants(index[part], *known) for part, known in (image.levels or {}).items() if part in index),
        )  # fmt: skip

    def image(self, targets: Sequence[PreparedPart]) -> ImageEdges:
        """Return the factor of the image.

        Args:
            targets: parts of the session, in order.

        Raises:
            InputError: an index of a part is invalid.
        """
        if any(not 0 <= one.part < len(targets) for one in self.poses):
            raise InputError(f"poses, part: expected indices of {len(targets)} parts. Correct them.")
        levels = {targets[one.part].part: (one.Ts, one.constants) for one in self.poses}
        return ImageEdges(
            self.camera, map_edges(self.points), self.chance if len(self.chance) else chance_hits(self.points),
            self.weights, self.log_unknown, {part: Ts for part, (Ts, _) in levels.items()},
            levels or None,  # of several images the first has the constants of all
        )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class RestTable:
    """Table of the support plane on which the part lies, see :class:`tanteo.posterior.OnTable`."""

    T_world_table: Transforms
    height_sd: float
    tilt_sd: float
    area: float


def _with_common_mountings(images: Sequence[ImageTable]) -> list[ImageTable]:
    """Return images in which equal mountings are one object, which states their common error once."""
    known: list[Mounting] = []
    out = []
    for image in images:
        own = image.camera.mounting
        if own is not None:
            same = [
                one
                for one in known
                if np.array_equal(one.T_hand_camera, own.T_hand_camera)
                and np.array_equal(one.covariance, own.covariance)
            ]
            known += [] if same else [own]
            image = replace(image, camera=replace(image.camera, mounting=(same or [own])[0]))
        out.append(image)
    return out


@dataclass(frozen=True, slots=True, eq=False)
class SeenTable:
    """Table of the factors from which a session starts: images and a support plane.

    Attributes:
        images: images of the object.
        table: support plane on which the part lies; None if its attitude is free.
        suggested: number of leading prior poses that come from the images.
        log_weights: log probabilities of the alternatives that the images are right, and that the prior poses apply
            instead; empty without prior poses.
        log_unknown: log density of all factors if the object is unknown; 0 without prior poses.
    """

    images: tuple[ImageTable, ...]
    table: RestTable | None
    suggested: int
    log_weights: FloatArray
    log_unknown: float

    @classmethod
    def of(cls, start: Start) -> SeenTable | None:
        """Return the table of the factors of a start; None without any.

        Args:
            start: start of the session.

        Raises:
            InputError: the start has a factor that a record cannot store.
        """
        if not start.factors:
            return None
        factors, logs, log_unknown = start.factors, np.zeros(0), 0.0
        if len(factors) == 1 and isinstance(either := factors[0], Alternatives):
            factors, logs, log_unknown = either.groups[0], either.log_weights, either.log_unknown
        images = [one for one in factors if isinstance(one, ImageEdges)]
        tables = [one for one in factors if isinstance(one, OnTable)]
        if len(images) + len(tables) < len(factors) or len(tables) > 1:
            raise InputError(
                "start, factors: expected images and a support plane, got others. A record stores only these."
            )
        rest = [RestTable(one.T_world_table, one.height_sd, one.tilt_sd, one.area) for one in tables]
        return cls(
            tuple(ImageTable.of(image, start.targets) for image in images), rest[0] if rest else None,
            start.suggested, logs, float(log_unknown),
        )  # fmt: skip

    def factors(
        self, targets: Sequence[PreparedPart], part: IntArray, Ts: Transforms, covariances: FloatArray, w: FloatArray
    ) -> tuple[PoseFactor, ...]:
        """Return the factors of a start.

        Args:
            targets: parts of the session, in order.
            part: index of the part of each prior pose ``(A,)``.
            Ts: prior poses ``(A, 4, 4)`` [m].
            covariances: covariances of the prior poses ``(A, 6, 6)``.
            w: weights of the prior poses ``(A,)``.
        """
        out: tuple[PoseFactor, ...] = tuple(image.image(targets) for image in _with_common_mountings(self.images))
        if self.table is not None:
            rest = self.table
            out = (*out, OnTable(rest.T_world_table, rest.height_sd, rest.tilt_sd, rest.area))
        if not len(self.log_weights):
            return out
        own = slice(self.suggested, None)
        poses = prior_poses(targets, part[own], Ts[own], covariances[own], w[own])
        return (Alternatives((out, (poses,)), self.log_weights, self.log_unknown),)
