"""Every tuned number of vision, once, with its unit and what chose it.

A field names its source: a decision in ``docs/decisions`` or a command. ``python benchmarks/sweep.py
vision.search.kept 24 48 96`` answers the same rendered images with several values. Numbers that follow from another
number are properties.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import FloatArray

NEWTON_STEPS = int(np.ceil(np.log2(np.finfo(np.float64).nmant)))
"""Numerical: Newton steps that bring a relative error of one half to rounding. Each step squares the error."""

SPACING = float(np.arcsinh(1) / np.arctan(1))
"""Definition: mean length of edge for each edge point [px]. A row or column has one point, and edges have any slant."""


@dataclass(frozen=True, slots=True)
class EdgeSettings:
    """How edge points of an image are found, and how exact they are.

    Attributes:
        smoothing: standard deviation of the Gaussian that smooths the image [px].
        strong: gradient that an edge has somewhere, in standard deviations of its noise.
        least_step: least step of brightness of an edge, because rounding and compression make steps [grey levels].
        blur: standard deviation of the blur by the lens and the area of a pixel in a sharp image [px].
            ``benchmarks/edges_of_photographs.py``.
        coarser: standard deviation of the second, coarser Gaussian, which shows how far an edge point drifts [px].
            Decision 32.
        by_drift: standard deviation of an edge point for each pixel of its drift. Decision 32.
        floor: standard deviation of the interpolation between pixels [px]. Decision 40.
        bias: standard deviation of what moves a whole edge: shading, blur, wear [px].
        lens: standard deviation of the displacement of whole edges after a usual calibration [px]. Decision 43.
        channels: number of directions of edges that are distinguished. Each channel has the edges within one step.
        textured: standard deviation by the gradients from which an image has texture or shared noise, over that of
            independent noise. ``benchmarks/photographs.py``.
    """

    smoothing: float = 1.2
    strong: float = 9.0
    least_step: float = 3.0
    blur: float = 0.7
    coarser: float = 2.0
    by_drift: float = 0.25
    floor: float = 0.01
    bias: float = 0.1
    lens: float = 0.15
    channels: int = 8
    textured: float = 1.5

    @property
    def weak(self) -> float:
        """Gradient at which an edge ends, in standard deviations of its noise: half of the strong one (Canny 1986)."""
        return self.strong / 2

    @property
    def usual_width(self) -> float:
        """Standard deviation of all blur of a step in a sharp image [px]."""
        return float(np.hypot(self.smoothing, self.blur))

    @property
    def extrapolation(self) -> float:
        """Displacement of an edge point by its blur, over its drift to the coarser image.

        Shading beside an edge, and a bend, displace its largest slope by the variance of all blur, to first order.
        """
        return self.usual_width**2 / (self.coarser**2 - self.smoothing**2)

    @property
    def extrapolated_noise(self) -> float:
        """Noise of the mean of extrapolated points along an edge, over that of the points.

        The second derivatives of a Gaussian ``s`` in one dimension have noise of ``s^-2.5``, and that of two Gaussians
        has the correlation ``(2 s t / (s^2 + t^2))^2.5``. An edge of width ``w`` is displaced by ``w^3`` times it.
        """
        s, t, c = self.smoothing, self.coarser, self.extrapolation
        other = (np.hypot(t, self.blur) / self.usual_width) ** 3 * (s / t) ** 2.5
        correlation = (2 * s * t / (s**2 + t**2)) ** 2.5
        return float(np.sqrt((1 + c) ** 2 + (c * other) ** 2 - 2 * (1 + c) * c * other * correlation))

    @property
    def correlation(self) -> float:
        """Length of edge over which smoothed noise is one draw [px]: the integral of its correlation."""
        return float(2 * np.sqrt(np.pi) * self.smoothing)

    @property
    def cell(self) -> int:
        """Side of a cell of coarse grids [px]. Within it the smoothed image has one independent value."""
        return int(self.correlation)

    @property
    def direction(self) -> float:
        """Angle between the directions of two channels [rad]."""
        return float(np.pi / self.channels)


@dataclass(frozen=True, slots=True)
class EvidenceSettings:
    """What the edges of an image say of the pose of a part.

    Attributes:
        reach: largest distance of an edge point from the sample of a part's edge that it matches [px].
            ``python benchmarks/vision_fit.py`` fits the weights with it.
        stretch: length of edge that is one observation [px]. Decision 23.
        whole: length from which more of the same edge adds little [px]; from 30 to 120 px the fit is as good.
            Decision 38.
        rim_shows: probability that an edge at which the part ends shows in the image. Decision 23.
        crease_shows: probability that an edge between two visible faces shows in the image. Decision 23.
        displaced: probability that a shadow, an occluder or a rounding displaces an edge. Decision 23.
        displaced_sd: standard deviation of that displacement [px]. Decision 23.
        spread: standard deviation of the offsets of other edges from a pose that is about right [px]. Decision 23.
        outlying: density of an edge that is not the part's, relative to that of the part's own edge. Three in ten
            edges are not the part's, a pixel off (decision 32); own edges are some hundredths of a pixel off
            (``python benchmarks/vision_poses.py 12``).
        inexact: probability that all edges of an image are less exact than stated, each by half of ``displaced_sd``.
            Decision 87.
        same_place: distance within which two samples match the same place of the image [px]. Decision 38.
        same_direction: cosine between directions of such samples. Decision 38.
        most_pulled: largest displacement of an edge by blur that is corrected [px]. Decision 73.
        same_pose: shift between two poses that are one, as a share of the part's diagonal. Decision 87.
        least_share: least area of the convex hull of a region, over that of the outline of a part that is proposed in
            it. The least in 23 photographs is 1.39: ``benchmarks/photographs.py plain,textured,cluttered 8 5765``.
        missed: probability that the true pose is not proposed: 3 of 74 (``python benchmarks/vision_fit.py 102``).
    """

    reach: float = 2.5
    stretch: float = 12.0
    whole: float = 60.0
    rim_shows: float = 0.85
    crease_shows: float = 0.65
    displaced: float = 0.3
    displaced_sd: float = 0.8
    spread: float = 0.15
    outlying: float = 0.02
    inexact: float = 0.02
    same_place: float = 4.0
    same_direction: float = 0.9
    most_pulled: float = 0.5
    same_pose: float = 0.02
    least_share: float = 0.2
    missed: float = 0.04

    @property
    def shortest(self) -> float:
        """Length of the shortest edge [px]: half of an observation."""
        return self.stretch / 2

    @property
    def surroundings(self) -> int:
        """Side of the window in which the rate of other edges is estimated [px]: two long edges."""
        return int(2 * self.whole)

    @property
    def rarest(self) -> float:
        """Least probability of a random edge within reach: that of a line halfway across the window."""
        return self.reach / self.surroundings

    @property
    def rare(self) -> float:
        """Largest probability of a random edge that encloses a region: that of two lines across the window."""
        return 4 * self.rarest

    @property
    def least_object(self) -> float:
        """Sum of minus the log probability of random edges of an object [nats]: two long edges that are just rare."""
        return float(-2 * self.whole / self.stretch * np.log(self.rare))

    @property
    def same_turn(self) -> float:
        """Turn between two poses that are one [rad]. It moves points half a diagonal off by the shift."""
        return 2 * self.same_pose


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """How poses of a part are proposed and refined.

    Attributes:
        samples: number of samples of a part's sharp edges. Rims of curved faces have as many again.
        coarse: number of samples in the first rounds; number of places on the surface by which poses differ.
        rim_samples: least number of samples of the rim of a hole or boss. Decision 73.
        sharp: angle between two faces from which their edge may be visible. Two segments that meet at more make a
            corner, two that meet at less may be one line [rad].
        yaws: number of yaws at which a part is tried. ``benchmarks/photographs.py cluttered``.
        kept: number of poses of a part that are refined to the end; three times as many of all parts on a table.
        rounds: number of rounds of a robust fit whose reach shrinks.
        likely: log density below the best from which a pose gets others next to it [nats]. Decision 40.
        beside: distance of these poses [px]. Decision 40.
        rims: number of ellipses of an image, and of rims of a part, that are tried, largest first.
        alone: number of ellipses that are tried at all turns, without a second ellipse.
        far_ends: number of places at which a segment may end.
        straight: radius from which a bent edge counts as straight [px].
        loose: standard deviation of the size of an ellipse, relative to it, from which the ellipse is refused. With a
            larger one errors are not normal, and short arcs fit small ellipses as well as large ones.
        scatter: largest chi-square of an ellipse for each degree of freedom.
        contradict: rms distance of marks from which they contradict one another, as a share of the image's width.
    """

    samples: int = 220
    coarse: int = 80
    rim_samples: int = 12
    sharp: float = float(np.pi / 15)
    yaws: int = 108
    kept: int = 48
    rounds: int = 11
    likely: float = 6.0
    beside: float = 1.5
    rims: int = 24
    alone: int = 2
    far_ends: int = 5
    straight: float = 400.0
    loose: float = 0.08
    scatter: float = 5.0
    contradict: float = 0.01

    def reaches(self, first: float, last: float = 1.0) -> FloatArray:
        """Return the shrinking reaches of the rounds of a robust fit [px].

        Args:
            first: largest reach.
            last: smallest reach, one pixel if not given.
        """
        every = np.geomspace(EVIDENCE.stretch, 1, self.rounds)
        slack = np.sqrt(every[0] / every[1])
        return np.asarray(every[(every < first * slack) & (every > last / slack)])

    @property
    def tried(self) -> int:
        """Number of poses of a part that are refined on few samples: five times as many as to the end."""
        return 5 * self.kept

    @property
    def first_reaches(self) -> FloatArray:
        """Reaches of the rounds on few samples [px]."""
        return self.reaches(EVIDENCE.stretch, EVIDENCE.shortest)

    @property
    def last_reaches(self) -> FloatArray:
        """Reaches of the rounds to the end, after those on few samples [px]."""
        return self.reaches(EVIDENCE.shortest)


@dataclass(frozen=True, slots=True)
class VisionSettings:
    """All settings of vision.

    Attributes:
        edges: settings of the detection of edge points, and their accuracy.
        evidence: settings of the likelihood of a pose given the edges of an image.
        search: settings of the proposal and refinement of poses.
    """

    edges: EdgeSettings = EdgeSettings()
    evidence: EvidenceSettings = EvidenceSettings()
    search: SearchSettings = SearchSettings()


VISION = VisionSettings()
"""The settings of vision. ``benchmarks/sweep.py`` replaces them before it imports another module of vision."""

EDGES, EVIDENCE, SEARCH = VISION.edges, VISION.evidence, VISION.search
