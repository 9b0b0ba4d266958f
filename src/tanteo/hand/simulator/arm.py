"""A robot arm that carries the hand: joints with limits, reach, and collisions of its links.

MuJoCo (the extra ``sim``) reads the model of the arm (MJCF or URDF) and finds contacts of its links in the simulated
cell. Kinematics are computed for many poses at once, because they decide which candidates of a session exist.

Inverse kinematics: damped least squares (Nakamura and Hanafusa 1986, Inverse kinematic solutions with singularity
robustness for robot manipulator control, J. Dyn. Sys., Meas., Control 108).
"""

from __future__ import annotations

import re
import sysconfig
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol

import numpy as np

from tanteo.errors import InputError, MissingExtraError, install_command
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Tangents, Transforms, Vectors
from tanteo.hand.robot import Hand
from tanteo.hand.simulator.scene import Solid
from tanteo.hand.twists import advance

_SHIPPED = {"ur5e": ("ur5e.xml", "flange")}
"""Arms whose models are part of this distribution: file and name of the flange."""

_DATA = {
    "ur3": ("ur_description/urdf/ur3_robot.urdf", "tool0"),
    "ur5": ("ur_description/urdf/ur5_robot.urdf", "tool0"),
    "ur10": ("ur_description/urdf/ur10_robot.urdf", "tool0"),
    "panda": ("panda_description/urdf/panda.urdf", "panda_link8"),
    "xarm7": ("xarm_description/urdf/xarm7.urdf", "link_eef"),
}
"""Arms of the distribution ``example-robot-data`` (BSD-3-Clause): file and name of the flange."""

ARMS = (*_SHIPPED, *_DATA)
"""Names of the arms."""

_SPEED = 2.0
"""Limit of the speed of each joint [rad/s]. Models state none; the slowest joint of these arms turns at 2.1 rad/s."""

_DAMPING = 0.02
"""Damping of the least squares, in the unit of the Jacobian's singular values (rotations weigh 0.3 m)."""

_ARM = 0.3
"""Length that makes a rotation comparable with a shift [m]."""

_PASSES, _STEP = 40, 0.4
"""Numerical: passes of the inverse kinematics, and largest change of a joint in a pass [rad]."""

_CLOSE = 1e-5
"""Numerical: error of a solved pose [m], rotations over :data:`_ARM`."""

_SEEDS = 24
"""Number of joint angles from which the inverse kinematics start, drawn evenly within the limits."""

_TRIED = 3
"""Number of starts from which one reachable pose is sought: the present angles and two others."""

_GAP = 0.005
"""Least distance between links, and between links and obstacles [m]."""


Free = Callable[[Vectors, FloatArray], BoolArray]
"""Function of spheres, centres ``(*batch, k, 3)`` and radii ``(k,)``; it returns flags of free sets ``(*batch,)``."""


class Reach(Protocol):
    """Interface of what carries the hand: which poses and paths of the hand its joints allow."""

    def reaches(self, Ts_world_hand: Transforms, free: Free | None = None) -> BoolArray:
        """Return whether the hand can be at poses ``(N,)``.

        Args:
            Ts_world_hand: poses ``(N, 4, 4)``.
            free: function that returns whether links are free of obstacles; all places are free if None.
        """
        ...

    def follows(self, path: Transforms, free: Free | None = None) -> bool:
        """Return whether the hand can follow a path from its present pose.

        Args:
            path: dense poses ``(N, 4, 4)``.
            free: function that returns whether links are free of obstacles; all places are free if None.
        """
        ...


def mujoco() -> ModuleType:
    """Return the module of MuJoCo.

    Raises:
        MissingExtraError: MuJoCo is not installed.
    """
    try:
        import mujoco as module
    except ImportError as error:
        raise MissingExtraError(
            f"--cell: expected MuJoCo, which reads models of arms, got {error}. Run {install_command('sim')}."
        ) from error
    return module


@dataclass(frozen=True, slots=True, eq=False)
class Arm:
    """A serial arm with a hand: its chain of joints, and spheres that enclose its links.

    Attributes:
        name: name of the arm.
        links: names of the links, the base first and the hand last ``(n + 2,)``.
        T_world_base: pose of the base ``(4, 4)``.
        fixed: transforms from each link to the next at zero angles, the last one to the hand ``(n + 1, 4, 4)``.
        axes: unit axes of the joints in the frame of the next link ``(n, 3)``.
        low: lower limits of the joints ``(n,)`` [rad].
        high: upper limits of the joints ``(n,)`` [rad].
        centres: centres of the spheres in the frames of their links ``(k, 3)`` [m].
        radii: radii of the spheres ``(k,)`` [m].
        link: index of the link of each sphere ``(k,)``.
        pairs: pairs of spheres that must not meet ``(p, 2)``.
        grounded: names of the bodies that do not move, or only about the first axis.
        source: model of the arm for MuJoCo, without the hand.
    """

    name: str
    links: tuple[str, ...]
    T_world_base: Transforms
    fixed: Transforms
    axes: Vectors
    low: FloatArray
    high: FloatArray
    centres: Vectors
    radii: FloatArray
    link: IntArray
    pairs: IntArray
    grounded: frozenset[str]
    source: Any

    @property
    def joints(self) -> int:
        """Return the number of joints."""
        return len(self.axes)

    def frames(self, q: FloatArray) -> Transforms:
        """Return the poses of all links, the hand last, at joint angles ``(*batch, n)``: ``(*batch, n + 2, 4, 4)``."""
        T = np.broadcast_to(self.T_world_base, (*q.shape[:-1], 4, 4))
        out = [T]
        for k in range(self.joints):
            turn = SE3.from_parts(SO3.exp(self.axes[k] * q[..., k, None]), np.zeros(3))
            T = T @ self.fixed[k] @ turn
            out.append(T)
        out.append(T @ self.fixed[-1])
        return np.stack(out, axis=-3)

    def jacobian(self, frames: Transforms) -> FloatArray:
        """Return the twists of the hand, in its own frame, by the speeds of the joints ``(*batch, 6, n)``.

        Args:
            frames: poses of the links :meth:`frames`.
        """
        hand = frames[..., -1, :, :]
        moving = frames[..., 1:-1, :, :]
        axes = np.einsum("...kij,kj->...ki", moving[..., :3, :3], self.axes)
        arms = hand[..., None, :3, 3] - moving[..., :3, 3]
        world = np.concatenate([np.cross(axes, arms), axes], axis=-1)
        R = hand[..., None, :3, :3]
        own = [np.einsum("...kji,...kj->...ki", R, world[..., part]) for part in (slice(0, 3), slice(3, 6))]
        return np.swapaxes(np.concatenate(own, axis=-1), -1, -2)

    def solve(self, T_world_hand: Transforms, q: FloatArray, passes: int = _PASSES) -> tuple[FloatArray, BoolArray]:
        """Return joint angles at which the hand has poses, from starts, and whether they were found.

        Args:
            T_world_hand: poses ``(N, 4, 4)``.
            q: starts ``(N, n)`` [rad].
            passes: number of passes.

        Returns:
            Joint angles within the limits ``(N, n)``, and flags ``(N,)``.
        """
        weights = np.repeat([1.0, _ARM], 3)
        q = np.array(q)
        error, rows = np.full(len(q), np.inf), np.arange(len(q))
        for _ in range(passes):
            frames = self.frames(q[rows])
            gap = SE3.log(SE3.inverse(frames[:, -1]) @ T_world_hand[rows]) * weights
            error[rows] = np.linalg.norm(gap, axis=1)
            far = error[rows] > _CLOSE
            rows, frames, gap = rows[far], frames[far], gap[far]
            if not len(rows):
                break
            J = self.jacobian(frames) * weights[:, None]
            # far away the damping is that of a step, near the pose it vanishes with the error
            damping = (_DAMPING * np.minimum(error[rows], 1.0)) ** 2
            damped = J @ np.swapaxes(J, 1, 2) + damping[:, None, None] * np.eye(6) + 1e-12 * np.eye(6)
            step = (np.swapaxes(J, 1, 2) @ np.linalg.solve(damped, gap[..., None]))[..., 0]
            step *= np.minimum(1.0, _STEP / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-12))
            q[rows] = np.clip(q[rows] + step, self.low, self.high)
        return q, error < 100 * _CLOSE

    def spheres(self, frames: Transforms) -> Vectors:
        """Return the centres of the spheres of the links in the world ``(*batch, k, 3)``."""
        T = frames[..., self.link, :, :]
        return np.asarray(np.einsum("...kij,kj->...ki", T[..., :3, :3], self.centres) + T[..., :3, 3])

    def apart(self, centres: Vectors) -> BoolArray:
        """Return whether no link meets another one ``(*batch,)``.

        Args:
            centres: centres of the spheres :meth:`spheres`.
        """
        one, other = self.pairs.T
        gaps = np.linalg.norm(centres[..., one, :] - centres[..., other, :], axis=-1)
        return np.asarray((gaps - self.radii[one] - self.radii[other] > _GAP).all(axis=-1))

    @property
    def carrying(self) -> BoolArray:
        """Return the flags of the spheres that are of links, not of the hand ``(k,)``."""
        return self.link < len(self.links) - 1


class ArmMotion:
    """The joints of an arm: present angles, motions by twists of the hand, and reach.

    Args:
        arm: the arm.
        T_world_hand: pose of the hand at the start ``(4, 4)``.
        free: function that returns whether links are free of known obstacles; all places are free if None.
        solids: solids of the cell, for the true contacts of the links.

    Attributes:
        q: present joint angles ``(n,)`` [rad].
        stops: reasons for which the arm's controller did not carry out a command, with their number.
        contacts: names of the pairs of a link and a solid that touched.

    Raises:
        InputError: the arm does not reach the start without a collision.
    """

    def __init__(
        self, arm: Arm, T_world_hand: Transforms, *, free: Free | None = None, solids: Sequence[Solid] = ()
    ) -> None:
        self.arm = arm
        self.stops = dict[str, int]()
        self.contacts = set[tuple[str, str]]()
        self._truth = _Truth(arm, solids)
        self._starts = np.random.default_rng(0).uniform(
            np.maximum(arm.low, -np.pi), np.minimum(arm.high, np.pi), (_SEEDS, arm.joints)
        )
        found = self._solutions(np.asarray(T_world_hand, dtype=np.float64)[None], free)[0]
        if not len(found):
            raise InputError(
                f"cell: expected a start pose of the hand in the reach of the {arm.name}, got one at "
                f"{np.round(1e3 * np.asarray(T_world_hand)[:3, 3], 1).tolist()} mm. Move the start pose or the base."
            )
        # with the elbow up the links stay away from parts and table
        moving = arm.carrying & (arm.link > 1)
        self.q = found[np.argmax(arm.spheres(arm.frames(found))[:, moving, 2].min(axis=1))]
        self._starts[0] = self.q

    @property
    def spheres(self) -> tuple[Vectors, FloatArray]:
        """Return centres ``(k, 3)`` and radii ``(k,)`` of the spheres of the links at the present angles [m]."""
        own = self.arm.carrying
        return self.arm.spheres(self.arm.frames(self.q))[own], self.arm.radii[own]

    @property
    def facts(self) -> dict[str, Any]:
        """Return what happened to the arm, by name."""
        pairs = [{"link": link, "solid": solid} for link, solid in sorted(self.contacts)]
        return {"name": self.arm.name, "contacts": pairs, "stops": dict(self.stops), "joints_rad": self.q.tolist()}

    @property
    def words(self) -> str:
        """Return what happened to the arm as text."""
        touched = ", ".join(f"{link} touched {solid}" for link, solid in sorted(self.contacts)) or "no link touched"
        stops = "".join(f"; {count} commands limited by {why}" for why, count in sorted(self.stops.items()))
        return f"{self.arm.name}, {touched}{stops}"

    def carry(self, T_world_hand: Transforms, twist: Tangents, seconds: float) -> Transforms:
        """Move the joints by a twist of the hand and return its new pose.

        The controller of the arm keeps the limits of joints and speeds, and stops before links meet each other.

        Args:
            T_world_hand: present pose of the hand ``(4, 4)``.
            twist: velocity ``[v, w]`` of the hand in its own frame [m/s, rad/s].
            seconds: duration.
        """
        if not np.any(twist):
            return T_world_hand
        arm = self.arm
        q, _ = arm.solve(advance(T_world_hand, twist, seconds)[None], self.q[None], passes=3)
        step = q[0] - self.q
        most = float(np.abs(step).max())
        if most > _SPEED * seconds:
            step = step * (_SPEED * seconds / most)
            self._stopped("speed of a joint")
        if ((self.q + step <= arm.low) | (self.q + step >= arm.high)).any():
            self._stopped("limit of a joint")
        frames = arm.frames((self.q + step)[None])
        if not arm.apart(arm.spheres(frames))[0]:
            self._stopped("link near another link")
            return T_world_hand
        self.q = self.q + step
        self.contacts |= self._truth.contacts(self.q)
        return np.asarray(frames[0, -1])

    def reaches(self, Ts_world_hand: Transforms, free: Free | None = None) -> BoolArray:
        """Return whether the arm can hold the hand at poses, with links free of obstacles and of each other.

        Args:
            Ts_world_hand: poses ``(N, 4, 4)``.
            free: function that returns whether links are free of obstacles; all places are free if None.
        """
        return np.array([len(found) > 0 for found in self._solutions(Ts_world_hand, free, first=True)], dtype=bool)

    def follows(self, path: Transforms, free: Free | None = None) -> bool:
        """Return whether the arm can follow a path from its present angles without a limit, jump or collision.

        Args:
            path: dense poses of the hand ``(N, 4, 4)``.
            free: function that returns whether links are free of obstacles; all places are free if None.
        """
        q, every = self.q, []
        for T in path:
            found, ok = self.arm.solve(T[None], q[None], passes=12)
            if not ok[0] or np.abs(found[0] - q).max() > 2 * _STEP:
                return False
            q = found[0]
            every.append(q)
        return bool(self._allowed(np.array(every), free).all()) if every else True

    def _stopped(self, why: str) -> None:
        self.stops[why] = self.stops.get(why, 0) + 1

    def _solutions(self, Ts: Transforms, free: Free | None, *, first: bool = False) -> list[FloatArray]:
        """Return allowed joint angles for each pose; only those of the first start that leads to some, if wanted."""
        out = [np.zeros((0, self.arm.joints)) for _ in Ts]
        open_ = np.arange(len(Ts))
        for start in self._starts[: _TRIED if first else None]:
            starts = np.broadcast_to(start, (len(open_), self.arm.joints))
            q, ok = self.arm.solve(Ts[open_], starts, _PASSES // 2 if first else _PASSES)
            rows = np.flatnonzero(ok)
            rows = rows[self._allowed(q[rows], free)]
            for row in rows:
                out[open_[row]] = np.concatenate([out[open_[row]], q[row][None]])
            if first:
                open_ = np.delete(open_, rows)
            if not len(open_):
                break
        return out

    def _allowed(self, q: FloatArray, free: Free | None) -> BoolArray:
        """Return whether joint angles ``(N, n)`` are within the limits and the links free."""
        arm = self.arm
        inside = ((q > arm.low + 1e-3) & (q < arm.high - 1e-3)).all(axis=1)
        centres = arm.spheres(arm.frames(q))
        ok = inside & arm.apart(centres)
        if free is not None and ok.any():
            # the base stands on the table
            moving = arm.carrying & (arm.link > 1)
            ok[ok] = free(centres[ok][:, moving], arm.radii[moving])
        return np.asarray(ok)


class _Truth:
    """True contacts of the links with the solids of the cell, by MuJoCo; solids count as their convex hulls."""

    def __init__(self, arm: Arm, solids: Sequence[Solid]) -> None:
        module = mujoco()
        spec = arm.source.copy()
        base = spec.worldbody
        T = SE3.inverse(arm.T_world_base)
        for solid in solids:
            mesh = spec.add_mesh(name=f"solid {solid.name}")
            mesh.uservert = SE3.apply(T, solid.vertices).ravel()
            mesh.userface = np.asarray(solid.triangles, dtype=np.int32).ravel()
            base.add_geom(name=f"solid {solid.name}", type=module.mjtGeom.mjGEOM_MESH, meshname=mesh.name)
        self._module, self._model = module, spec.compile()
        self._data = module.MjData(self._model)
        self._angles = [int(self._model.jnt_qposadr[k]) for k in range(self._model.njnt)][: arm.joints]
        self._grounded = arm.grounded

    def contacts(self, q: FloatArray) -> set[tuple[str, str]]:
        """Return the pairs of a moving link and a solid that touch at joint angles."""
        module, model, data = self._module, self._model, self._data
        data.qpos[self._angles] = q
        module.mj_kinematics(model, data)
        module.mj_comPos(model, data)
        module.mj_collision(model, data)
        found = set()
        for k in range(data.ncon):
            contact = data.contact[k]
            names = [model.geom(int(g)).name for g in contact.geom]
            bodies = [model.body(int(model.geom_bodyid[g])).name for g in contact.geom]
            for name, body in ((names[0], bodies[1]), (names[1], bodies[0])):
                if name.startswith("solid ") and body not in self._grounded and contact.dist < 0:
                    found.add((body, name.removeprefix("solid ")))
        return found


def read_arm(name: str, hand: Hand, T_world_base: Transforms) -> Arm:
    """Return an arm with a hand at its flange.

    Args:
        name: one of :data:`ARMS`, or ``FILE#flange`` with a model (MJCF or URDF) and the name of its flange's body.
        hand: hand; the back of its body is at the flange, its +z along the flange's.
        T_world_base: pose of the base ``(4, 4)`` [m].

    Raises:
        InputError: no arm has the name, or the model is no chain of rotating joints.
        MissingExtraError: MuJoCo or the models are not installed.
    """
    module = mujoco()
    path, flange = _model_of(name)
    try:
        text = Path(path).read_text(encoding="utf-8")
        spec = module.MjSpec.from_string(_plain_urdf(text, Path(path))) if "<robot" in text else None
        spec = module.MjSpec.from_file(str(path)) if spec is None else spec
        for geom in spec.geoms:
            if geom.meshname:
                geom.type = module.mjtGeom.mjGEOM_CAPSULE  # fitted to the mesh
        model = spec.compile()
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise InputError(f"cell: expected a model of an arm, got {path}: {error}. Check the file.") from None
    return _chain(name, spec, model, flange, hand, np.asarray(T_world_base, dtype=np.float64))


def _model_of(name: str) -> tuple[str, str]:
    """Return the path of a model and the name of its flange."""
    if name in _SHIPPED:
        file, flange = _SHIPPED[name]
        return str(resources.files("tanteo.hand.simulator") / file), flange
    if name in _DATA:
        file, flange = _DATA[name]
        kept = Path(sysconfig.get_paths()["purelib"]) / "cmeel.prefix/share/example-robot-data/robots" / file
        if not kept.exists():
            raise MissingExtraError(
                f"cell: expected the models of example-robot-data for '{name}', got none. Run pip install "
                "example-robot-data, or use ur5e."
            )
        return str(kept), flange
    path, _, flange = name.partition("#")
    if not flange or not Path(path).exists():
        raise InputError(
            f"cell: expected {', '.join(ARMS)}, or FILE#flange with a model (MJCF or URDF), got '{name}'. Choose one."
        )
    return path, flange


def _plain_urdf(text: str, path: Path) -> str:
    """Return a URDF without what is only drawn, with paths of meshes that MuJoCo finds."""
    folder = next((p for p in path.parents if p.name == "robots"), path.parent)
    text = re.sub(r"package://[^\"']*?robots/", f"{folder}/", text)
    text = re.sub(r"package://", f"{path.parent}/", text)
    text = re.sub(r"<visual.*?</visual>", "", text, flags=re.DOTALL)
    settings = '<mujoco><compiler strippath="false" discardvisual="true" fusestatic="false"/></mujoco>'
    return re.sub(r"(<robot[^>]*>)", rf"\1{settings}", text, count=1)


def _chain(name: str, spec: Any, model: Any, flange: str, hand: Hand, T_world_base: Transforms) -> Arm:
    """Return the chain from the base to the flange of a compiled model."""
    module = mujoco()
    bodies = [model.body(k).name for k in range(model.nbody)]
    if flange not in bodies:
        raise InputError(f"cell: expected the flange of {name} among {', '.join(bodies)}, got '{flange}'. Name it.")
    chain = [bodies.index(flange)]
    while chain[0]:
        chain.insert(0, int(model.body_parentid[chain[0]]))
    links, fixed, axes, low, high = ["base"], list[Transforms](), list[FloatArray](), list[float](), list[float]()
    link_of, T, offset = dict[int, tuple[int, Transforms]](), np.eye(4), np.eye(4)
    for body in chain:
        own = SE3.from_parts(SO3.from_quaternion(model.body_quat[body]), model.body_pos[body])
        T = T @ own
        count = int(model.body_jntnum[body])
        if count > 1 or (count and model.jnt_type[model.body_jntadr[body]] != module.mjtJoint.mjJNT_HINGE):
            raise InputError(f"cell: expected one rotating joint at each link of {name}, got others. Use another arm.")
        if count:
            joint = int(model.body_jntadr[body])
            offset = SE3.from_parts(np.eye(3), model.jnt_pos[joint])
            fixed.append(T @ offset)
            axes.append(model.jnt_axis[joint] / np.linalg.norm(model.jnt_axis[joint]))
            limited = bool(model.jnt_limited[joint])
            low.append(float(model.jnt_range[joint, 0]) if limited else -2 * np.pi)
            high.append(float(model.jnt_range[joint, 1]) if limited else 2 * np.pi)
            links.append(model.body(body).name)
            T = SE3.inverse(offset)
        link_of[body] = len(links) - 1, T
    if not axes:
        raise InputError(f"cell: expected a rotating joint before the flange of {name}, got none. Check the model.")
    back = float((hand.body.centres[:, 2] - hand.body.radii).min())
    mount = SE3.from_parts(np.eye(3), np.array([0.0, 0.0, -back + _GAP]))
    fixed.append(T @ mount)
    centres, radii, link = [hand.body.centres], [hand.body.radii], [np.full(len(hand.body.radii), len(links))]
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        if body not in link_of:
            continue
        number, inside = link_of[body]
        own = SE3.from_parts(SO3.from_quaternion(model.geom_quat[geom]), model.geom_pos[geom])
        places, radius = _covered(model, geom)
        centres.append(SE3.apply(inside @ own, places))
        radii.append(np.full(len(places), radius))
        link.append(np.full(len(places), number))
    links.append("hand")
    grounded = frozenset({"world", *(model.body(body).name for body, (number, _) in link_of.items() if number < 2)})
    arm = Arm(
        name, tuple(links), T_world_base, np.stack(fixed), np.stack(axes), np.array(low), np.array(high),
        np.concatenate(centres), np.concatenate(radii), np.concatenate(link), np.zeros((0, 2), dtype=np.int64),
        grounded, spec,
    )  # fmt: skip
    return _with_pairs(arm)


def _covered(model: Any, geom: int) -> tuple[Vectors, float]:
    """Return the centres of spheres that enclose a geometry, in its frame, and their radius."""
    module = mujoco()
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind in (module.mjtGeom.mjGEOM_CAPSULE, module.mjtGeom.mjGEOM_CYLINDER):
        count = 2 + int(2 * size[1] / size[0])
        along = np.linspace(-size[1], size[1], count)
        half = 0.5 * (along[1] - along[0])
        return along[:, None] * np.array([0.0, 0.0, 1.0]), float(np.hypot(size[0], half))
    return np.zeros((1, 3)), float(model.geom_rbound[geom])


def _with_pairs(arm: Arm) -> Arm:
    """Return an arm with the pairs of spheres that must not meet.

    Links that follow each other, or are two apart, may touch by design: their distance hardly changes. Pairs of links
    that meet at most joint angles enclose each other too widely to be compared.
    """
    one, other = np.triu_indices(len(arm.radii), 1)
    far = np.abs(arm.link[one] - arm.link[other]) > 2
    one, other = one[far], other[far]
    q = np.random.default_rng(1).uniform(np.maximum(arm.low, -np.pi), np.minimum(arm.high, np.pi), (200, arm.joints))
    centres = arm.spheres(arm.frames(q))
    gaps = np.linalg.norm(centres[:, one] - centres[:, other], axis=-1) - arm.radii[one] - arm.radii[other]
    mostly = (gaps < _GAP).mean(axis=0) > 0.5
    pairs = np.stack([one[~mostly], other[~mostly]], axis=1)
    return replace(arm, pairs=pairs)
