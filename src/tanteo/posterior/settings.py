"""Every number that was chosen, once, with its unit and what chose it.

A field says what it is, its unit, and its source: a decision in ``docs/decisions``, a paper, or the rows of
``benchmarks/against_scenes.py`` that react to it: ``python benchmarks/sweep.py search.rounds 4 8 12 --rows touch``.
Numbers that follow from another one are properties. ``identify_points(..., settings=)`` takes other values.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

from tanteo.errors import InputError, did_you_mean

POSE_DOF = 6
"""Degrees of freedom of a pose."""

FEWEST = POSE_DOF // 2
"""Measurements below which any surface fits: three points fix a plane, which fixes half of a pose."""


@dataclass(frozen=True, slots=True)
class Effort:
    """How much one round of a search proposes.

    Attributes:
        pairs: number of pairs of points.
        places: pairs of surface places for each pair of points.
        kept: proposals of each pair that are settled.
        maximized: settled proposals that are maximized.
        moved: best maxima that are also tried after half turns and slides.
        moved_hard: the same where maxima are narrow beside the spacing of proposals, or the best one leaves points out.
    """

    pairs: int
    places: int
    kept: int
    maximized: int
    moved: int = 0
    moved_hard: int = 0


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """How poses of one part are proposed and maximized.

    Attributes:
        points: points on which proposals are scored and settled; number of pairs of them. Rows touch, bracket_30.
        places: pairs of surface places for each pair of points. Rows touch, hard_walls.
        kept_per_pair: proposals of each pair that are settled. Rows touch, hard_walls.
        maximized: proposals maximized in a round, maxima kept, poses along a ridge. Rows touch, prior.
        moved: maxima tried after half turns and slides in later rounds. ``benchmarks/missed.py``; decisions 51, 52.
        spins: turns about the line of two points without normals; half as many slides. Row touch.
        prior_draws: draws from the pose prior for each that is settled. Row prior, decision 48.
        prior_widening: spread of these draws over that of the prior. Row hard_prior_6.
        subset: draws that are settled by the same subset of the points. Row hard_prior_6.
        left_out: one in so many points is left out of a subset. Row hard_prior_6.
        ridge_piece: spread of a component along a ridge over that of the ridge. Decision 55, row hard_prior_3.
        coarse_to_fine: blur of the first maximization over that of proposals. Rows touch, hard_walls.
        scale_step: log of the ratio of successive scales of settling. Row touch.
        same_sds: distance within which two maxima are one [standard deviations]. Rows twins, touch.
        negligible: log-evidence gap of a pose or part that is not reported [nats]: odds of 6e-6.
        curvature_error: error of a log-evidence by curvature (Laplace) that is allowed for [nats]. Row hard_prior_4.
        steps: Levenberg-Marquardt steps at most. Row touch.
        step_gain: gain in log density at which a maximization ends [nats]. Row touch.
        often: pairs that lead to a maximum from which it is surely found: it is missed in one of 2^often searches.
            Good 1953; ``benchmarks/missed.py``.
        missing: probability of rarely found maxima up to which a part is searched enough. ``benchmarks/missed.py``.
        rounds: rounds of a search; half as many again while the best pose leaves points out.
            ``benchmarks/missed.py``.
        explained: share of the points that the leader has on it if it explains them. Decision 85.
        unusual_sds: excess of outliers that makes a pose doubtful, of a residual that is reported, and of the scatter
            of points along a line [standard deviations]. ``benchmarks/missed.py``.
        any_outlier: number of points up to which any outlier makes a pose doubtful. ``benchmarks/missed.py``.
        gate: agreement of distances, angles and sizes [standard deviations]: 6e-5 two-sided for a normal error.
            Decision 76.
        reach_sds: reach of an error: normals within it are parallel, a side of a box within it cuts a region, and a
            free ray within it may pass beside the part [standard deviations]: 0.3 % two-sided for a normal error.
        as_made: difference of the made part from its drawing, 1 sd [m]. Decisions 76, 84.
        tilt_as_made: difference of a made angle from its drawing, 1 sd [rad]. Decision 76.
        noise_share: assumed inflation of the noise, as a share of the log of the factor to which it is known.
            Decision 76.
        cost_least: cost of a plane or centre that has no counterpart, at least [nats]. Decision 76.
        cost_most: the same, at most [nats]. Decision 76.
        cost_point: cost of one point at most, which may be on a curved face or an outlier [nats]. Decision 76.
        holes: number of holes of the part by which the cost of a centre without an axis is taken. Decision 84.
        independent: volume (or sine) of directions that fix an attitude, at least. Decision 76.
        off_line: height of a triangle of centres over its longest side, at least. Decision 84.
        tuples: tuples of planes or centres that are tried at first. Decision 84.
        items: centres and planes that tuples are made of; tuples that are tried next. Decision 84.
        compared: planes and centres that are compared. Decisions 76, 84.
        loose: cost of a sensed normal on a face that is not a plane, beside its share of the area [nats]. Decision 76.
        vote_share: share of all parts up to which the vote of a pair is counted. Decision 76.
        placed: tuples of axes, or poses of planes, that are tried on one part. Row labelled.
        kept: poses of a part that a table proposes; maxima about which near variants are evaluated. Decision 76.
        wall_slack: distance of a centre beyond the end of its wall, over the length of the wall. Decision 84.
        plane_normal_sd: standard deviation of a sensed normal up to which it counts as a plane [rad]. Decision 76.
        few_points: points of a coarse evaluation and of a first-pass search; readings on which usual mistakes are
            tried. Decisions 76, 85.
        coarse_areas: equal areas of a surface; their spacing is the step of coarse poses. Decision 76.
        coarse_poses: poses of a part that are refined on its field with all ``few_points``; more with fewer points.
            Decision 76.
        thorough: times as many of them where parts are few. Decision 85.
        furniture_rays: free rays before points on furniture; each is cast at every pose.
        sources: number of independent sources that are counted apart: bits of a whole number.
    """

    points: int = 12
    places: int = 40
    kept_per_pair: int = 7
    maximized: int = 40
    moved: int = 10
    spins: int = 24
    prior_draws: int = 30
    prior_widening: float = 1.2
    subset: int = 8
    left_out: int = 4
    ridge_piece: float = 0.5
    coarse_to_fine: float = 0.25
    scale_step: float = 0.25
    same_sds: float = 2.0
    negligible: float = 12.0
    curvature_error: float = 2.0
    steps: int = 20
    step_gain: float = 1e-3
    often: int = 4
    missing: float = 0.02
    rounds: int = 8
    explained: float = 0.9
    unusual_sds: float = 2.0
    any_outlier: int = 20
    gate: float = 4.0
    reach_sds: float = 3.0
    as_made: float = 1e-4
    tilt_as_made: float = 0.004
    noise_share: float = 0.6
    cost_least: float = 2.0
    cost_most: float = 13.0
    cost_point: float = 8.0
    holes: int = 20
    independent: float = 0.25
    off_line: float = 0.1
    tuples: int = 4
    items: int = 8
    compared: int = 16
    loose: float = 1.5
    vote_share: float = 0.3
    placed: int = 1000
    kept: int = 8
    wall_slack: float = 0.5
    plane_normal_sd: float = 0.1
    few_points: int = 24
    coarse_areas: int = 64
    coarse_poses: int = 24
    thorough: int = 16
    furniture_rays: int = 40
    sources: int = 60

    @property
    def faint(self) -> float:
        """Log-evidence gap at which a maximum is forgotten [nats]."""
        return self.negligible + self.curvature_error

    @property
    def cost_limit(self) -> float:
        """Cost of a part of which no pose was found, by tables [nats]."""
        return 5 * self.negligible

    @property
    def effort(self) -> Effort:
        """A round of a search."""
        return Effort(self.points, self.places, self.kept_per_pair, self.maximized, 0, self.moved)


@dataclass(frozen=True, slots=True)
class RaceSettings:
    """How parts are pruned.

    Attributes:
        budget: full searches that one stage of the race may cost. ``benchmarks/bench_catalogue.py``, decision 76.
        first_pass_cost: cost of a first-pass search from known poses over that of a full search. Measured:
            ``python benchmarks/bench_catalogue.py CATALOGUE 12 points12 --say`` at 10,000 parts.
        first_pass: effort of a first-pass search; it proposes no pairs where poses are known. Row parts12_known.
        table_weight: log-evidence for each nat of cost by tables, where noise is taken larger than stated. Decision 76.
        estimate_weight: the same of an estimate by few points or a coarse field, at least. Decision 76.
        least: parts that remain after a coarse evaluation; similar parts that are tried beside a leader. Decision 76.
        unfixed: parts that remain where very many have the sensed planes and these fix no pose. Decision 76.
        leaders: leading parts whose poses are tried on others; poses of each. Decision 52.
        pruned_by_size: prior probability of all parts that a measured size or outline prunes. Decision 83.
        size_margin: log-odds gap within which it prunes none [nats]. Decision 83.
        outlier_level: probability of more outliers than sizes allow for. Decision 76.
        similar: differences of box, area and volume of similar parts over the diagonal. Decision 76.
    """

    budget: int = 64
    first_pass_cost: float = 0.05
    first_pass: Effort = Effort(6, 16, 3, 8)
    table_weight: float = 1.33
    estimate_weight: float = 0.5
    least: int = 200
    unfixed: int = 16
    leaders: int = 3
    pruned_by_size: float = 0.06
    size_margin: float = 4.0
    outlier_level: float = 1e-4
    similar: float = 0.08

    @property
    def first_passes(self) -> int:
        """First-pass searches that the budget pays for."""
        return round(self.budget / self.first_pass_cost)


@dataclass(frozen=True, slots=True)
class SampleSettings:
    """How the regions of the posterior are sampled, and followed from one measurement to the next.

    Attributes:
        first: samples of a component at first; effective samples along a ridge of a part that is not the likeliest.
        first_trusted: samples of a component at first whose region was normal before the last measurement.
        likely: log-evidence behind the total up to which a maximum gets all first samples [nats].
        rare: the same up to which it gets ``few`` [nats]: a ridge can have a hundred times the mass by its curvature.
        enough: effective samples of a mode: its covariance is good to a twelfth.
        more: samples of a component in one later round at most.
        most: samples that are drawn for one effective sample at most.
        rounds: rounds of samples of one part.
        told: effective samples that show the shape of a region; samples that stand for it.
        heaviest: samples by which the widths of a component are fitted; samples of most weight among which the one is
            sought that agrees best with the measurements and the prior.
        few: samples of a component that may matter little.
        along: samples of each of dozens of components along a ridge.
        wider: variance of a component at first over that by curvature.
        adapted: variance of an adapted component over that of its samples.
        freedom: degrees of freedom of the Student components: weights stay bounded.
        matters: probability from which a mode is sampled until it has enough; probability of all pruned parts together,
            over that of the best, which a bound allows. Decision 76.
        region: share of a part's mass from which a region is compared with a normal density; probability from which
            regions along ridges are sampled.
        followed: probability of a part from which, while its region is not normal, its prior is sampled again.
        cut: share of a normal region outside a box from which the region is not normal.
        comparable: log of the mass by curvature over the largest weight of a sample, either way, up to which both are
            compared [nats].
        strange: samples of large weight from which maximizations start, at a time.
        share: least share of the samples, or of the variance by curvature, that counts as such.
        overlap: share of its samples that a mode has in common with another from which both are one.
        narrowest: least variance of a mode over that by curvature.
        left: least share of the mass of the samples that a control variate leaves.
        clip: number of samples of which one has the whole weight at most while components are adapted.
        halvings: halvings of a width at most where a face ends.
        barrier: fall of the log density between two maxima of one region [nats]: less than to the border of a
            region of two standard deviations in six directions.
        path_steps: steps of the path between two maxima on which the density has to stay high for one region.
        held: standard deviation over the part's size up to which samples show that the ends of faces hold a motion.
        widely: samples of the prior of the pose from which a part is maximized where nothing or too little is known.
        normal_starts: samples of a normal mode from which its part is maximized again.
        several: number of points that, with a prior, fix a pose: then pairs of them propose poses, too.
        doubt: probability of the unknown object from which all parts are searched again.
        sweeps: sweeps of coordinate descent in a box.
    """

    first: int = 64
    first_trusted: int = 40
    likely: float = 5.0
    rare: float = 9.0
    enough: int = 300
    more: int = 400
    most: int = 8
    rounds: int = 5
    told: int = 24
    heaviest: int = 32
    few: int = 12
    along: int = 8
    wider: float = 1.3
    adapted: float = 1.2
    freedom: float = 4.0
    matters: float = 5e-3
    region: float = 1e-3
    followed: float = 3e-3
    cut: float = 0.01
    comparable: float = 30.0
    strange: int = 4
    share: float = 0.1
    overlap: float = 0.15
    narrowest: float = 0.05
    left: float = 0.2
    clip: int = 15
    halvings: int = 7
    barrier: float = 3.0
    path_steps: int = 4
    held: float = 0.05
    widely: int = 96
    normal_starts: int = 2
    several: int = 4
    doubt: float = 0.2
    sweeps: int = 50


@dataclass(frozen=True, slots=True)
class UnknownSettings:
    """How densities of an object that is none of the parts are integrated.

    Attributes:
        axis_pairs: pairs of normals that propose perpendicular axes, those nearest to perpendicular.
        axis_steps: steps from proposed axes to a maximum.
        same_axes: angle within which axes are the same [rad].
        ball_steps: steps to the middle of the ball of the points, plus one.
        nodes: nodes of the quadrature over the share of a surface that is displaced, at least.
    """

    axis_pairs: int = 32
    axis_steps: int = 3
    same_axes: float = 0.02
    ball_steps: int = 32
    nodes: int = 12


@dataclass(frozen=True, slots=True)
class CheckSettings:
    """When readings or an answer raise a finding.

    Checks that need no search, those of units above all, use the defaults.

    Attributes:
        too_wide: median distance of the readings from their middle over the largest diagonal; beyond it the unit is
            doubted.
        too_narrow: the same over the smallest diagonal; if all readings are nearer, the unit is doubted.
        least_span: span of the readings of one part over its diagonal, at least.
        finest: standard deviation below which the unit is doubted [m].
        coarsest: standard deviation over the largest diagonal above which the unit is doubted.
        smallest_part: diagonal of the smallest part that a suggested unit may lead to [m].
        largest_part: diagonal of the largest part that a suggested unit may lead to [m].
        many_parts: number of parts above which diagonals are rounded to a hundredth.
        outward: mean cosine between a direction and the way away from the middle, above which directions are doubted.
        into: share of the sensed normals that point into the material, above which normals are doubted.
        path_turns: directions across a free ray in which it is moved.
        outlier_level: probability of as many outliers as a pose leaves, from which it explains the measurements.
        limiting_share: share of the largest corner sd from which a shared error is reported.
        beyond_curvature: largest corner sd over that by curvature up to which shared errors explain it.
    """

    too_wide: float = 3.0
    too_narrow: float = 0.01
    least_span: float = 0.25
    finest: float = 2e-7
    coarsest: float = 0.1
    smallest_part: float = 2e-3
    largest_part: float = 5.0
    many_parts: int = 1000
    outward: float = 0.2
    into: float = 0.8
    path_turns: int = 8
    outlier_level: float = 0.03
    limiting_share: float = 0.5
    beyond_curvature: float = 1.5


@dataclass(frozen=True, slots=True)
class Settings:
    """All settings of an inference.

    Attributes:
        search: how poses of one part are proposed and maximized.
        race: how parts are pruned.
        samples: how regions are sampled.
        unknown: how densities of an unknown object are integrated.
        checks: when readings or an answer raise a finding.
    """

    search: SearchSettings = SearchSettings()
    race: RaceSettings = RaceSettings()
    samples: SampleSettings = SampleSettings()
    unknown: UnknownSettings = UnknownSettings()
    checks: CheckSettings = CheckSettings()

    @property
    def second_pass(self) -> Effort:
        """The first round with all points of one of several parts."""
        return replace(self.search.effort, moved=self.race.leaders, moved_hard=self.race.leaders)

    def changed(self, name: str, value: float) -> Settings:
        """Return the same settings with one field changed.

        Args:
            name: group and field, such as ``search.rounds``.
            value: of the field; a field of a whole number takes a whole number.

        Raises:
            InputError: there is no such field.
        """
        groups = [(group.name, getattr(self, group.name)) for group in fields(self)]
        known = {f"{group}.{one.name}": (group, one.name) for group, own in groups for one in fields(own)
                 if isinstance(getattr(own, one.name), int | float)}  # fmt: skip
        if name not in known:
            raise InputError(f"setting: expected the name of one, got {name!r}.{did_you_mean(name, known)}")
        group, own = known[name]
        kind = type(getattr(getattr(self, group), own))
        return replace(self, **{group: replace(getattr(self, group), **{own: kind(value)})})


DEFAULTS = Settings()
