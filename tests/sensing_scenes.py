"""A part that is really there, and sessions that sense it by true rays with drawn errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tanteo import _core, locate
from tanteo.errors import InputError
from tanteo.factors import FreeRays
from tanteo.geometry import SE3, SO3
from tanteo.planning import Action, Done, Probe, Sensing, SensingState, Session, Stop, at_place
from tanteo.planning.places import places_of
from tanteo.planning.policies import policy_named
from tanteo.planning.stopping import corner_distances
from tanteo.posterior import PosePrior, Posterior, Priors, Problem
from tanteo.posterior.answers import corner_moves
from tanteo.posterior.details import details_at
from tanteo.posterior.near_variants import log_density_of_near_variant
from tanteo.posterior.part_search import start_search
from tanteo.sensors import Column, Readings, measure
from tanteo.sensors.error_states import BENDS, LARGEST_SCALE, SCALE_PER_NOISE, Drift, Form, Scale
from tanteo.sensors.presets import NoiseLaw

LASER = Probe("laser", NoiseLaw.of(3e-4), max_range=0.3, standoff=0.1)
FLIGHT = Probe("time of flight", NoiseLaw.of(3e-3), max_range=0.6, standoff=0.2)
STYLUS = Probe(
    "stylus", NoiseLaw.of(5e-5), contact=True, radius=1e-3, standoff=0.01, clearance=0.003, retreat=0.05,
    approach=np.array([0.0, 0.0, -1.0]), cone=np.pi / 2, stylus=np.array([0.0, 0.0, 1.0]),
)  # fmt: skip
EXACT_MACHINE = Scale(1e-6), Drift(1e-6), Form(1e-6)
"""Errors of a machine and a part that are stated to have none."""
PLACE_SD = 0.015, 0.15
"""How roughly the place of a part is known: each axis [m], about each axis [rad]."""


def rough(targets, sd=PLACE_SD, priors=None):
    """Return the parts about the world's origin, with noise as stated."""
    priors = Priors(noise_factor=1.0) if priors is None else priors
    return at_place(targets, np.eye(4), np.diag(np.repeat(sd, 3)) ** 2, priors)


def log_densities(points, part, priors, Ts, zs=None, *, rays=None, mixtures=None):
    """Log density of readings at poses ``(S, 4, 4)`` and shared errors ``(S, D)``, the prior of these included."""
    problem = Problem(points, FreeRays.none() if rays is None else rays, priors, mixtures=mixtures or {})
    zs = np.zeros((len(Ts), problem.states)) if zs is None else zs
    return _core.log_densities(part.shape, problem.compiled(part), np.ascontiguousarray(Ts), np.ascontiguousarray(zs))


def log_marginals(points, part, priors, Ts, *, rays):
    """Return the log likelihoods at poses, integrated over the shared errors."""
    problem = Problem(points, rays, priors)
    Ts, zs = np.ascontiguousarray(Ts), np.zeros((len(Ts), problem.states))
    return _core.marginals(part.shape, problem.compiled(part), Ts, zs)[0]


def log_variants(points, part, priors, Ts, zs=None):
    """Return the log likelihoods of a near variant of the part at poses and shared errors."""
    objective = start_search(Problem(points, FreeRays.none(), priors), part, np.random.default_rng(0)).objective
    zs = np.zeros((len(Ts), objective.problem.states)) if zs is None else zs
    return log_density_of_near_variant(details_at(objective, Ts, zs), part.part, priors.outlier_rate)


def without_modes(start, points, rays):
    """Return the posterior of readings that no part explains."""
    posterior = Posterior(Problem(points, rays, start.priors), (), 1.0, 0.0, 0.0, (), np.zeros(0), 0.0)
    return SensingState(start, posterior, 1.0)


def drawn_truth(start, rng, part=None):
    """Return a part and a pose from what the start assumes."""
    k = int(rng.integers(len(start))) if part is None else int(np.flatnonzero(start.part == part)[0])
    xi = np.linalg.cholesky(start.covariances[k]) @ rng.normal(size=6)
    return int(start.part[k]), start.Ts[k] @ SE3.exp(xi)


def true_range(target, T, action):
    """Return the distance of the part along the action's beam [m]; infinite without a hit."""
    to_part = SE3.inverse(T)
    origin, along = SE3.apply(to_part, action.origin), to_part[:3, :3] @ action.direction
    return float(target.surface.cast(origin[None], along[None]).distances[0])


def where_a_ball_stops(target, T, action, radius):
    """Return the distance that a ball's centre moves along the action's path before it touches the part [m]."""
    to_part, t = SE3.inverse(T), 0.0
    for _ in range(1000):
        centre = SE3.apply(to_part, action.origin + t * action.direction)
        gap = float(target.surface.closest(centre[None]).distances[0]) - radius
        t += gap
        if gap < 1e-10 or t > action.max_range:
            break
    return t if t <= action.max_range else np.inf


def beam_hits(target, Ts, origins, directions):
    """Return the hits of beams on a part at poses: ranges, cosines, faces ``(C, S)``, derivatives ``(C, S, 6)``.

    A miss is infinite, 0, -1 and 0. The derivatives are those to a face that is a plane where the beam meets it.
    """
    R = np.swapaxes(Ts[:, :3, :3], 1, 2)
    starts = np.einsum("sij,csj->csi", R, origins[:, None] - Ts[None, :, :3, 3])
    along = np.einsum("sij,cj->csi", R, directions)
    hits = target.surface.cast(starts, along)
    hit, reached = np.isfinite(hits.distances), np.where(np.isfinite(hits.distances), hits.distances, 0.0)
    n = np.where(hit[..., None], target.surface.normals[hits.triangles], 0.0)
    cosine = np.einsum("csi,csi->cs", n, along)
    moved = np.concatenate([n, np.cross(starts + reached[..., None] * along, n)], axis=-1)
    faces = np.where(hit, target.part.triangle_face[hits.triangles], -1)
    return hits.distances, np.abs(cosine), faces, moved / np.where(hit, cosine, 1.0)[..., None]


def as_rows(target, origins, directions, probe):
    """Return how readings change with a part's pose at the origin ``(N, 6)``, and variances of new ones ``(N,)``."""
    ranges, cosines, _, g = beam_hits(target, np.eye(4)[None], origins, directions)
    return g[:, 0], probe.own_variance(ranges, cosines)[:, 0]


def of_plan(found):
    """Origins and directions of the readings of a plan."""
    return (np.array([getattr(r, name) for r in found.readings]) for name in ("origin", "direction"))


def located(target, sd):
    """Return a pose covariance with a given standard deviation at the corners of the part's box ``(6, 6)``."""
    J = corner_moves(target.part)
    return sd**2 / 2 * np.linalg.inv(np.mean(np.swapaxes(J, 1, 2) @ J, axis=0))


def sense(session, target, T, rng, sd=None, each=None):
    """Run plans and updates until the session ends, and call ``each`` after every reading."""
    sd = float(session.probe.law.const) if sd is None else sd
    while isinstance(action := session.ask(), Action):
        distance = true_range(target, T, action)
        if np.isfinite(distance):
            distance = max(distance + sd * rng.normal(), 1e-6)
        session.tell(action.read(distance))
        if each is not None:
            each(session)
    return action


def sense_made(session, target, T, outward, rng, machine=None):
    """Touch a made part until the session ends.

    ``outward(face, point, normal)`` is the displacement of its surface along the normal [m], and ``machine(point,
    count)`` that of the machine's positions from those that it reports ``(3,)`` [m].
    """
    sd, radius, to_part = float(session.probe.law.const), session.probe.radius, SE3.inverse(T)
    while isinstance(action := session.ask(), Action):
        moved = action
        if machine is not None:
            moved = replace(action, origin=action.origin + machine(action.origin, session.count))
        distance = where_a_ball_stops(target, T, moved, radius)
        if np.isfinite(distance):
            centre = SE3.apply(to_part, moved.origin + distance * moved.direction)
            closest = target.surface.closest(centre[None])
            normal = target.surface.normals[closest.triangles[0]]
            cosine = abs(normal @ (to_part[:3, :3] @ action.direction))
            off = outward(target.part.triangle_face[closest.triangles[0]], centre, normal)
            distance = max(distance - off / max(cosine, 0.2) + sd * rng.normal(), 1e-6)
        session.tell(action.read(distance))
    return action


def displaced_faces(target, form_sd, rng, tilt_sd=0.0):
    """Return the surface of a part each face of which is displaced, and tilted by ``tilt_sd`` at its ends [m]."""
    faces = range(len(target.part.faces))
    corners = [
        target.part.vertices[target.part.triangles[target.part.triangle_face == f]].reshape(-1, 3) for f in faces
    ]
    middles = [(c.min(axis=0) + c.max(axis=0)) / 2 for c in corners]
    extents = [max(np.linalg.norm(np.ptp(c, axis=0)) / 2, 1e-6) for c in corners]
    offsets, tilts = form_sd * rng.normal(size=len(faces)), tilt_sd * rng.normal(size=(len(faces), 3))
    return lambda face, point, normal: offsets[face] + tilts[face] @ (point - middles[face]) / extents[face]


def assumed_of(target, noise, rng, readings):
    """Return a machine and a surface with the scale error, drift and warp that are assumed, drawn from their priors."""
    drift, warp = (noise * rng.choice(list(BENDS[e]), p=list(BENDS[e].values())) for e in (Drift, Form))
    scale = min(SCALE_PER_NOISE * noise, LARGEST_SCALE) * rng.normal()
    way, length, count = drift * rng.normal(size=3), 0.5 * target.part.diagonal, 200
    waves, phases = rng.normal(size=(count, 3)) / length, rng.uniform(0, 2 * np.pi, count)
    field = warp * np.sqrt(2 / count) * rng.normal(size=(count, 3))

    def surface(face, point, normal):
        return normal @ (np.cos(waves @ point + phases) @ field)

    return (lambda point, made: scale * point + way * made / (readings - 1)), surface


def touches_of_hand(target, rng, count, tip_off, sd=5e-5):
    """Return a pose and touches with poses of the hand, whose tip is off by one vector in the frame of the hand."""
    T = SE3.exp(np.r_[0.1 * rng.normal(size=3), 0.5 * rng.normal(size=3)])
    rows = rng.choice(len(target.samples), count, replace=False)
    outward = target.normals[rows] @ T[:3, :3].T
    hands = np.tile(np.eye(4), (count, 1, 1))
    hands[:, :3, :3] = SO3.frame_from_axis(-outward, 2) @ SO3.exp(rng.uniform(-np.pi, np.pi, (count, 1)) * [0, 0, 1.0])
    offset = rng.normal(size=3)
    offset *= tip_off / np.linalg.norm(offset)
    points = SE3.apply(T, target.samples[rows]) - hands[:, :3, :3] @ offset + sd * rng.normal(size=(count, 3))
    hands[:, :3, 3] = points + 0.1 * outward
    return T, Readings.from_columns(points, directions=-outward, sds=np.full(count, sd), Ts_world_hand=hands)


def made_session(target, form_sd, rng, seed=0, sd=5e-5, errors=EXACT_MACHINE, at=(0.0, 0.0, 0.0), **stop):
    """Return a session with a stylus on a made part, and its pose; by default its machine has no other errors."""
    start = at_place([target], SE3.from_parts(np.eye(3), np.array(at)), np.diag(np.repeat([2e-3, 0.05], 3)) ** 2)
    T, probe = drawn_truth(start, rng)[1], replace(STYLUS, law=NoiseLaw.of(sd), max_range=0.06, form_sd=form_sd)
    sensing = Sensing(sd=float(probe.law.const), tolerance=form_sd, shared_errors=errors)
    return Session(start, probe, sensing, stop=Stop(probability=None, **stop), seed=seed), T


def carried_out(found, target, start, sd, rng, *, assumed=False):
    """Return the largest error of a place after a plan whose readings go to ``locate`` without feedback.

    With ``assumed`` they have the errors that ``locate`` assumes, drawn from their prior.
    """
    T = start.Ts[0] @ SE3.exp(np.linalg.cholesky(start.covariances[0]) @ rng.normal(size=6))
    origins, directions = of_plan(found)
    ranges = beam_hits(target, T[None], origins, directions)[0][:, 0]
    on_face = np.isfinite(ranges)
    ranges = ranges[on_face] + sd * rng.normal(size=int(on_face.sum()))
    readings = Readings.from_columns(
        origins[on_face] + ranges[:, None] * directions[on_face],
        directions=directions[on_face],
        sds=np.full(on_face.sum(), sd),
    )
    for error in measure(readings).unstated if assumed else ():
        size = rng.choice(list(error.sizes), p=list(error.sizes.values()))
        columns = error.columns()
        moved = columns @ (size * rng.normal(size=columns.shape[2]))
        readings = replace(readings, points=Column.from_rows(np.asarray(readings.points) + moved))
    answer = locate(readings, target.part, priors=Priors(pose=PosePrior(start.Ts[0], start.covariances[0])))
    if not answer.hypotheses:
        return np.inf
    places, gap = places_of(target.part, found.feature), SE3.inverse(T) @ answer.hypotheses[0].T_world_part
    moved = SE3.apply(gap, places.points) - places.points
    return float(np.linalg.norm(np.einsum("kij,kj->ki", places.across, moved), axis=1).max())


def new_session(start, probe=LASER, policy="information", seed=0, errors=(), **stop):
    """Return a session whose sensor has the noise of its probe."""
    sensing = Sensing(sd=float(probe.law.const), shared_errors=errors)
    return Session(start, probe, sensing, policy_named(policy), Stop(**stop), seed)


def off(session, part, T):
    """Largest distance of a corner of the part's box from where the best mode has it; infinite for another part."""
    b = session.state
    if not len(b.weights) or b.part[0] != part:
        return np.inf
    return float(corner_distances(b, 0, T[None])[0])


def with_radius(probe, clearance):
    """Return the same probe with a radius."""
    return replace(probe, clearance=clearance)


def valid(session):
    """Weights sum to one, and every pose and covariance is one."""
    b = session.state
    assert b.unknown + b.weights.sum() == pytest.approx(1, abs=1e-9)
    assert (b.weights >= 0).all()
    assert 0 <= b.unknown <= 1
    assert np.isfinite(b.poses).all()
    assert not len(b.covariances) or np.linalg.eigvalsh(b.covariances).min() > 0


def give_any_readings(session, target, T, rng, steps):
    """Give valid and invalid readings: planned, wrong, free, repeated, late, not finite; check the posterior."""
    late = []
    for _ in range(steps):
        action = session.ask()
        if isinstance(action, Done):
            assert action.reason.message
            break
        kind = rng.integers(7)
        if kind == 0:
            reading = action.read(rng.uniform(1e-3, 0.29))
        elif kind == 1:
            reading = action.read(np.inf)
        elif kind == 2:
            reading = Readings.from_columns(rng.normal(size=(2, 3)), ids=[f"w{rng.integers(9)}", "x"])
        elif kind == 3:
            refuse_nan(session, action, rng)
            continue
        elif kind == 4 and late:
            reading = late[rng.integers(len(late))]
        else:
            reading = action.read(true_range(target, T, action))
            late.append(reading)
            if rng.uniform() < 0.3:
                continue
        session.tell(reading)
        valid(session)
        session.answer()


def refuse_nan(session, action, rng):
    """Check that values that are not finite are refused and change nothing."""
    before = session.state
    with pytest.raises(InputError):
        action.read(np.nan)
    with pytest.raises(InputError):
        session.tell(
            Readings.from_columns(np.where(rng.uniform(size=(1, 3)) < 0.5, np.nan, 0.1) * np.array([1, 1, np.nan]))
        )
    assert session.state is before
