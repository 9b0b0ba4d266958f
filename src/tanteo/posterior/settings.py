"""Every tuned number of the inference, once, with its unit and what chose it.

A field names its source: a decision in ``docs/decisions``, a paper, or a command. Rows are rows of
``benchmarks/against_scenes.py`` that react: ``python benchmarks/sweep.py search.rounds 4 8 12 --rows touch``. Numbers
that follow from another one are properties. ``identify(..., settings=)`` takes other values.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

from tanteo.errors import InputError, did_you_mean

POSE_DOF = 6
"""Definition: degrees of freedom of a pose."""

FEWEST = POSE_DOF // 2
"""Definition: number of measurements below which any surface fits. Three points fix a plane: half of a pose."""


@dataclass(frozen=True, slots=True)
class Effort:
    """Numbers of proposals in one round of a search.

    Attributes:
        pairs: number of pairs of points.
        places: number of pairs of surface places for each pair of points.
        kept: number of proposals of each pair that are refined.
        maximized: number of refined proposals that are maximized.
        moved: number of the best maxima that are also tried after half turns and slides.
        moved_hard: the same number if maxima are narrow relative to the spacing of proposals, or if the best maximum
            has more outliers than expected.
    """

    pairs: int
    places: int
    kept: int
    maximized: int
    moved: int = 0
    moved_hard: int = 0


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """Settings of the proposal and maximization of poses of one part.

    Attributes:
        points: number of points on which proposals are scored and refined; number of pairs of them; number of refined
            poses from which a later round maximizes while the points are not explained. Rows touch, bracket_30;
            ``benchmarks/missed.py``.
        places: number of pairs of surface places for each pair of points. Rows touch, hard_walls.
        kept_per_pair: number of proposals of each pair that are refined. Rows touch, hard_walls.
        maximized: number of proposals maximized in a round, of maxima kept, and of poses along a ridge. Rows touch,
            prior.
        moved: number of maxima tried after half turns and slides in later rounds. ``benchmarks/missed.py``; decisions
            51, 52.
        spins: number of turns about the line of two points without normals; half as many slides. Row touch.
        prior_draws: number of draws from the pose prior for each that is refined. Row prior, decision 48.
        prior_widening: standard deviation of these draws over that of the prior. Row hard_prior_6.
        subset: number of draws that are refined by the same subset of the points. Row hard_prior_6.
        omitted: a subset omits one in this number of points. Row hard_prior_6.
        ridge_piece: standard deviation of a component along a ridge over that of the ridge. Decision 55, row
            hard_prior_3.
        coarse_to_fine: blur of the first maximization over that of proposals. Rows touch, hard_walls.
        scale_step: log of the ratio of successive scales of the refinement. Row touch.
        notable_sds: deviation that is notable, the two-sided 5 % level of a normal error [standard deviations]:
            distance within which two maxima are one, excess of outliers that makes a pose doubtful, residual that is
            reported. Rows twins, touch; ``benchmarks/missed.py``.
        negligible: log-evidence gap of a pose or part that is not reported [nats], odds of 6e-6; largest cost of a
            plane or centre without a counterpart. Row touch, decision 76.
        curvature_error: error of a log-evidence by curvature (Laplace) that is allowed for [nats]. Row hard_prior_4.
        steps: largest number of Levenberg-Marquardt steps. Row touch.
        step_gain: gain in log density at which a maximization ends [nats]. Row touch.
        missing: estimated probability of missed maxima at which the search of a part ends; with 0.02 sure answers claim
            up to 0.01 less. ``benchmarks/missed.py``; ``python benchmarks/assumptions.py 15 77 even``.
        rounds: number of rounds of a search; half as many again while the best pose has unexpected outliers.
            ``benchmarks/missed.py``.
        explained: fraction of the points that a part has on its surface if it explains them. Decision 85.
        any_outlier: number of points up to which any outlier makes a pose doubtful. ``benchmarks/missed.py``.
        as_made: standard deviation of the made part from its drawing [m]. Decisions 76, 84.
        tilt_as_made: standard deviation of a made angle from its drawing [rad]. Decision 76.
        noise_fraction: assumed log of the noise factor over the log of the factor to which the noise is known.
            Decision 76.
        holes: number of holes of the part that the cost of a centre without an axis assumes. Decision 84.
        independent: smallest volume (or sine) of directions that fix an attitude. Decision 76.
        off_line: smallest height of a triangle of centres over its longest side. Decision 84.
        tuples: number of tuples of planes or centres that are tried first; multiples of it limit all sets of sensed
            planes and centres. Decisions 76, 84.
        curved_face_cost: cost of a sensed normal on a curved face, in addition to minus the log of the fraction of
            curved area [nats]. Decision 76.
        max_tuples: number of tuples of axes, or of poses of planes, that are tried on one part. Row labelled.
        plane_normal_sd: largest standard deviation of a sensed normal that counts as a plane [rad]. Decision 76.
        coarse_areas: number of equal areas of a surface; their spacing is the step of coarse poses. Decision 76.
        thorough: factor on the number of coarse poses if there are few parts. Decision 85.
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
    omitted: int = 4
    ridge_piece: float = 0.5
    coarse_to_fine: float = 0.25
    scale_step: float = 0.25
    notable_sds: float = 2.0
    negligible: float = 12.0
    curvature_error: float = 2.0
    steps: int = 20
    step_gain: float = 1e-3
    missing: float = 0.005
    rounds: int = 8
    explained: float = 0.9
    any_outlier: int = 20
    as_made: float = 1e-4
    tilt_as_made: float = 0.004
    noise_fraction: float = 0.6
    holes: int = 20
    independent: float = 0.25
    off_line: float = 0.1
    tuples: int = 4
    curved_face_cost: float = 1.5
    max_tuples: int = 1000
    plane_normal_sd: float = 0.1
    coarse_areas: int = 64
    thorough: int = 16

    @property
    def most_rounds(self) -> int:
        """Largest number of rounds, while the missed maxima matter to the answer."""
        return 3 * self.rounds

    @property
    def missing_unsure(self) -> float:
        """Estimated probability of missed maxima at which a search ends while no part is sure.

        Five points on six parts: seeds then have a standard deviation of 0.05 (``python benchmarks/cliffs.py seeds``).
        """
        return 4 * self.missing

    @property
    def gate(self) -> float:
        """Largest deviation of an agreement [standard deviations]: 6e-5 of all normal errors are larger."""
        return 2 * self.notable_sds

    @property
    def reach_sds(self) -> float:
        """Extent of an error [standard deviations], midway between a notable one and the gate."""
        return (self.notable_sds + self.gate) / 2

    @property
    def cost_least(self) -> float:
        """Smallest cost of a plane or centre without a counterpart [nats]: that of a notable residual."""
        return 0.5 * self.notable_sds**2

    @property
    def cost_point(self) -> float:
        """Largest cost of one point [nats], that of a residual at the gate; beyond it the point is an outlier."""
        return 0.5 * self.gate**2

    @property
    def drop_gap(self) -> float:
        """Log-evidence gap at which a maximum is dropped [nats]."""
        return self.negligible + self.curvature_error

    @property
    def cost_limit(self) -> float:
        """Cost by tables of a part without a known pose [nats]."""
        return 5 * self.negligible

    @property
    def items(self) -> int:
        """Number of centres and of planes in tuples; number of tuples that are tried next."""
        return 2 * self.tuples

    @property
    def kept(self) -> int:
        """Number of poses of a part by tables, and of maxima at which near variants are evaluated."""
        return 2 * self.tuples

    @property
    def compared(self) -> int:
        """Number of planes and centres that are compared with tables."""
        return 2 * self.items

    @property
    def few_points(self) -> int:
        """Number of points that represent all in a coarse evaluation, a first pass or a check of conventions.

        A coarse evaluation refines as many poses of a part, and more with fewer points.
        """
        return 2 * self.points

    @property
    def effort(self) -> Effort:
        """Effort of one round of a search."""
        return Effort(self.points, self.places, self.kept_per_pair, self.maximized, 0, self.moved)


@dataclass(frozen=True, slots=True)
class PruningSettings:
    """Settings of the pruning of parts.

    Attributes:
        budget: number of full searches that one stage may cost. ``benchmarks/bench_catalogue.py``, decision 76.
        first_pass_cost: cost of a first-pass search from known poses over that of a full search. Measured:
            ``python benchmarks/bench_catalogue.py CATALOGUE 12 points12 --verbose`` at 10,000 parts.
        first_pass_places: number of pairs of surface places in a first pass. Row parts12_known.
        table_weight: log-evidence for each nat of cost by tables, which assume more noise than stated. Decision 76.
        estimate_weight: smallest log-evidence for each nat of an estimate by few points or a coarse field.
            Decision 76.
        least: number of parts that remain after a coarse evaluation, and of similar parts that are tried beside a
            leader. Decision 76.
        leaders: number of leading parts whose poses are tried on others; number of poses of each. Decision 52.
        pruned_by_size: prior probability of all parts that a measured size or outline prunes. Decision 83.
        size_margin: log-odds gap within which a measured size prunes no part [nats]. Decision 83.
        similar: largest difference of box, area and volume of similar parts over the diagonal. Decision 76.
    """

    budget: int = 64
    first_pass_cost: float = 0.05
    first_pass_places: int = 16
    table_weight: float = 1.33
    estimate_weight: float = 0.5
    least: int = 200
    leaders: int = 3
    pruned_by_size: float = 0.06
    size_margin: float = 4.0
    similar: float = 0.08

    @property
    def first_passes(self) -> int:
        """Number of first-pass searches in the budget."""
        return round(self.budget / self.first_pass_cost)

    @property
    def unfixed(self) -> int:
        """Number of parts that remain if very many parts have the sensed planes, and these fix no pose."""
        return self.budget // 4


@dataclass(frozen=True, slots=True)
class SampleSettings:
    """Settings of the sampling of modes, and of their tracking from one measurement to the next.

    Attributes:
        first: number of first samples of a component; effective samples along a ridge of a part that is not the
            likeliest.
        full_gap: log-evidence gap within which a maximum gets all first samples [nats]. Flat from 3 to 9: ``python
            benchmarks/sweep.py samples.full_gap 3 5 9 --rows touch=16 prior=16``.
        few_gap: log-evidence gap within which a maximum gets two samples for each direction of a pose [nats]: a
            ridge can have a hundred times the mass that its curvature suggests.
        enough: number of effective samples of a mode: the relative standard error of a variance is the square root of
            2 / 300, a twelfth. Decision 61.
        probability_sd: standard deviation of the probability of the best mode, by its samples, above which more rounds
            follow. Five seeds then differ by less than 0.05: ``python benchmarks/cliffs.py seeds``.
        more: largest number of samples of a component in a later round. Flat from 300 to 800: ``python
            benchmarks/sweep.py samples.more 300 400 800 --rows touch=16 prior=16``.
        most: largest number of samples for one effective sample. Flat from 4 to 16: ``python benchmarks/sweep.py
            samples.most 4 8 16 --rows touch=16 prior=16``.
        rounds: number of rounds of samples of one part.
        inflation: variance of a first component over the inverse curvature. NEES / dof is 1.11 at 1 and 0.99 at 1.3:
            ``python benchmarks/sweep.py samples.inflation 1 1.3 2 --rows touch=16``.
        adapted_inflation: variance of an adapted component over that of its samples.
        freedom: degrees of freedom of the Student-t components, which bound the weights.
        min_probability: probability from which a mode is sampled until it has enough, and from which its part is
            tracked; probability of all pruned parts over that of the best that a bound allows. Decision 76.
        region: fraction of a part's mass from which a region is compared with a normal density; probability from which
            ridges are sampled.
        min_fraction: fraction of the samples, or of the variance by curvature, below which neither counts; effective
            samples for each drawn below which a component is replaced by pieces;
            fraction of common samples from which two modes are one. Flat from 0.03 to 0.3: ``python benchmarks/sweep.py
            samples.min_fraction 0.03 0.1 0.3 --rows touch=16 prior=16``.
        clip: largest weight of a sample while components adapt, as one over this number of all. Flat from 5 to 60:
            ``python benchmarks/sweep.py samples.clip 5 15 60 --rows touch=16 prior=16``.
        edge_sd: largest standard deviation of a motion by samples, over the part's size, at which the ends of faces
            constrain that motion. Row hard_walls.
        reopen_probability: probability of the unknown object from which all parts are searched again. Row
            session_touch.
    """

    first: int = 64
    full_gap: float = 5.0
    few_gap: float = 9.0
    enough: int = 300
    probability_sd: float = 0.015
    more: int = 400
    most: int = 8
    rounds: int = 5
    inflation: float = 1.3
    adapted_inflation: float = 1.2
    freedom: float = 4.0
    min_probability: float = 5e-3
    region: float = 1e-3
    min_fraction: float = 0.1
    clip: int = 15
    edge_sd: float = 0.05
    reopen_probability: float = 0.2

    @property
    def few_rounds(self) -> int:
        """Number of rounds where there are too few measurements for a pose, or no part and pose is probable.

        The probability of the best part of five points then has an sd of 0.08 over seeds, with one round 0.18 and with
        five 0.05 in twice the time: ``python benchmarks/cliffs.py seeds``.
        """
        return self.rounds // 2

    @property
    def shape(self) -> int:
        """Number of samples that show the shape of a region: four for each direction of a pose."""
        return 4 * POSE_DOF

    @property
    def widely(self) -> int:
        """Number of samples of the pose prior from which a part is maximized."""
        return 4 * self.shape

    @property
    def heaviest(self) -> int:
        """Number of samples for fitted widths, of a piece of a ridge, and of largest weight that are compared."""
        return self.first // 2


@dataclass(frozen=True, slots=True)
class UnknownSettings:
    """Settings of the densities of an unknown object.

    Attributes:
        axis_pairs: number of pairs of normals that propose perpendicular axes, those nearest to perpendicular.
            ``python benchmarks/calibration.py 200``.
        same_axes: angle within which axes are the same [rad]. ``python benchmarks/calibration.py 200``.
    """

    axis_pairs: int = 32
    same_axes: float = 0.02


@dataclass(frozen=True, slots=True)
class CheckSettings:
    """Limits beyond which readings or an answer raise a finding.

    Attributes:
        too_wide: median distance of the readings from their middle over the largest diagonal, beyond which the unit is
            doubted.
        too_narrow: largest distance of the readings from their middle over the smallest diagonal, below which the unit
            is doubted.
        least_span: smallest span of the readings of one part over its diagonal.
        finest: standard deviation below which the unit is doubted [m].
        coarsest: standard deviation over the largest diagonal above which the unit is doubted.
        smallest_part: smallest diagonal of a part that a suggested unit may lead to [m].
        largest_part: largest diagonal of a part that a suggested unit may lead to [m].
        outward: mean cosine between a direction and the outward direction above which directions are doubted; fraction
            of normals out of the material below which normals are doubted.
        limiting_share: contribution of a shared error to the largest corner sd, over that sd, from which it is
            reported.
        beyond_curvature: largest corner sd over that by curvature up to which shared errors explain it.
        of_prior: whether an answer that fits badly is compared with one without the prior pose.
    """

    too_wide: float = 3.0
    too_narrow: float = 0.01
    least_span: float = 0.25
    finest: float = 2e-7
    coarsest: float = 0.1
    smallest_part: float = 2e-3
    largest_part: float = 5.0
    outward: float = 0.2
    limiting_share: float = 0.5
    beyond_curvature: float = 1.5
    of_prior: bool = True


@dataclass(frozen=True, slots=True)
class Settings:
    """All settings of an inference.

    Attributes:
        search: proposal and maximization of poses of one part.
        pruning: pruning of parts.
        samples: sampling of modes.
        unknown: densities of an unknown object.
        checks: limits beyond which readings or an answer raise a finding.
    """

    search: SearchSettings = SearchSettings()
    pruning: PruningSettings = PruningSettings()
    samples: SampleSettings = SampleSettings()
    unknown: UnknownSettings = UnknownSettings()
    checks: CheckSettings = CheckSettings()

    def __repr__(self) -> str:
        """Return the fields that differ from their defaults."""
        groups = [(group.name, getattr(self, group.name), group.default) for group in fields(self)]
        changed = [f"{name}.{one.name}={getattr(own, one.name)!r}" for name, own, usual in groups for one in fields(own)
                   if getattr(own, one.name) != getattr(usual, one.name)]  # fmt: skip
        return f"Settings({', '.join(changed)})"

    @property
    def first_pass(self) -> Effort:
        """Effort of a first-pass search, which proposes no pairs where poses are known."""
        own = self.search
        return Effort(own.points // 2, self.pruning.first_pass_places, own.kept_per_pair // 2, own.kept)

    @property
    def second_pass(self) -> Effort:
        """Effort of the first round with all points of one of several parts."""
        return replace(self.search.effort, moved=self.pruning.leaders, moved_hard=self.pruning.leaders)

    @property
    def brief(self) -> Settings:
        """Settings of a search that is repeated for a check: a quarter of the rounds, enough for a part that fits."""
        return replace(self, search=replace(self.search, rounds=self.search.rounds // 4))

    @property
    def repeated(self) -> Settings:
        """Settings of an inference that is repeated for other readings or errors: the first has checked the prior."""
        return replace(self, checks=replace(self.checks, of_prior=False))

    def changed(self, name: str, value: float) -> Settings:
        """Return the same settings with one field changed.

        Args:
            name: group and field, such as ``search.rounds``.
            value: new value of the field; a field of a whole number takes a whole number.

        Raises:
            InputError: there is no such field.
        """
        groups = [(group.name, getattr(self, group.name)) for group in fields(self)]
        known = {f"{group}.{one.name}": (group, one.name) for group, own in groups for one in fields(own)
                 if isinstance(getattr(own, one.name), int | float)}  # fmt: skip
        if name not in known:
            raise InputError(f"setting: expected the name of a setting, got {name!r}.{did_you_mean(name, known)}")
        group, own = known[name]
        kind = type(getattr(getattr(self, group), own))
        return replace(self, **{group: replace(getattr(self, group), **{own: kind(value)})})


DEFAULTS = Settings()
"""Default settings."""
