"""Relating uncertain frames: ``T12 = T1^-1 T2`` and its covariance ``Ad C1 Ad' + C2``, beside the peers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from common import Table, seconds, version

from tanteo.geometry import SE3, SO3, relate_arrays

PAIRS = 100_000
LOOP = 2_000
"""Pairs timed for a peer that has to loop in Python; its time per pair does not depend on their number."""

TEXT = f"""\
Every contestant gets {PAIRS} pairs of frames with 6 x 6 covariances of their right (body) errors, already in its own
types and order of rows, and returns the relative frame and `Ad C1 Ad' + C2` in float64; its answer is checked against
ours to 1e-9. Peers that have no batch are timed over a Python loop of {LOOP} pairs, by the shortest public way that we
found: the relative transform, its adjoint, two matrix products. JAX is timed without compilation and on one core like
the rest. pytransform3d stands there twice: by its functions for uncertain transforms (checks on, as they come), and by
its transform functions with their checks off."""


@dataclass(frozen=True)
class Data:
    T1: np.ndarray
    C1: np.ndarray
    T2: np.ndarray
    C2: np.ndarray

    def head(self, n: int) -> Data:
        return Data(self.T1[:n], self.C1[:n], self.T2[:n], self.C2[:n])


Answer = tuple[np.ndarray, np.ndarray]
Contestant = tuple[int, Callable[[], object], Callable[[], Answer]]
"""Pairs per call, the call that is timed, and the answer in our types for a check."""


def make_data(n: int) -> Data:
    rng = np.random.default_rng(1991)
    A = rng.normal(size=(2, n, 6, 6)) * np.array([1e-3] * 3 + [1e-2] * 3)[:, None]
    C = A @ np.swapaxes(A, -1, -2)
    T = SE3.exp(rng.normal(size=(2, n, 6)))
    return Data(T[0], C[0], T[1], C[1])


def _rotation_first(C: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(np.roll(C, (3, 3), axis=(-2, -1)))


def tanteo(data: Data) -> Contestant:
    def work() -> Answer:
        return relate_arrays(data.T1, data.C1, data.T2, data.C2)

    return len(data.T1), work, work


def plain_numpy(data: Data) -> Contestant:
    def work() -> Answer:
        T12 = SE3.inverse(data.T1) @ data.T2
        A = SE3.adjoint_inverse(T12)
        return T12, A @ data.C1 @ np.swapaxes(A, -1, -2) + data.C2

    return len(data.T1), work, work


def _loop(one: Callable[..., Answer], columns: list[list[object]], rotation_first: bool) -> Contestant:
    """Return a contestant that takes the pairs one by one and keeps the results in a list."""

    def work() -> list[Answer]:
        return [one(*row) for row in zip(*columns, strict=True)]

    def answer() -> Answer:
        Ts, Cs = (np.array(x) for x in zip(*work(), strict=True))
        return Ts, _rotation_first(Cs) if rotation_first else Cs

    return len(columns[0]), work, answer


def pytransform3d_uncertainty(data: Data) -> Contestant:
    from pytransform3d import transformations as pt
    from pytransform3d import uncertainty as pu

    d = data.head(LOOP)

    def one(T1: np.ndarray, C1: np.ndarray, T2: np.ndarray, C2: np.ndarray) -> Answer:
        # its inverse takes and gives left errors: the right error of T1 is the left error of T1^-1, sign apart
        Ad = pt.adjoint_from_transform(T1)
        inverse, C_inverse = pt.invert_transform(T1), Ad @ C1 @ Ad.T
        return pu.concat_locally_uncertain_transforms(T2, inverse, C2, C_inverse)

    return _loop(one, [list(d.T1), list(_rotation_first(d.C1)), list(d.T2), list(_rotation_first(d.C2))], True)


def pytransform3d_lean(data: Data) -> Contestant:
    from pytransform3d import transformations as pt

    d = data.head(LOOP)

    def one(T1: np.ndarray, C1: np.ndarray, T2: np.ndarray, C2: np.ndarray) -> Answer:
        T12 = pt.concat(T2, pt.invert_transform(T1, check=False), check=False)
        Ad = pt.adjoint_from_transform(pt.invert_transform(T12, check=False), check=False)
        return T12, Ad @ C1 @ Ad.T + C2

    return _loop(one, [list(d.T1), list(_rotation_first(d.C1)), list(d.T2), list(_rotation_first(d.C2))], True)


def gtsam(data: Data) -> Contestant:
    import gtsam

    d = data.head(LOOP)

    def one(pose1: object, C1: np.ndarray, pose2: object, C2: np.ndarray) -> Answer:
        T12 = pose1.between(pose2)
        Ad = T12.inverse().AdjointMap()
        return T12, Ad @ C1 @ Ad.T + C2

    poses = [[gtsam.Pose3(T) for T in Ts] for Ts in (d.T1, d.T2)]
    columns = [poses[0], list(_rotation_first(d.C1)), poses[1], list(_rotation_first(d.C2))]
    n, work, _ = _loop(one, columns, True)

    def answer() -> Answer:
        Ts, Cs = zip(*work(), strict=True)
        return np.array([T.matrix() for T in Ts]), _rotation_first(np.array(Cs))

    return n, work, answer


def pinocchio(data: Data) -> Contestant:
    import pinocchio

    d = data.head(LOOP)

    def one(M1: object, C1: np.ndarray, M2: object, C2: np.ndarray) -> Answer:
        M12 = M1.actInv(M2)
        Ad = M12.toActionMatrixInverse()
        return M12, Ad @ C1 @ Ad.T + C2

    Ms = [[pinocchio.SE3(T) for T in Ts] for Ts in (d.T1, d.T2)]
    n, work, _ = _loop(one, [Ms[0], list(d.C1), Ms[1], list(d.C2)], False)

    def answer() -> Answer:
        Ts, Cs = zip(*work(), strict=True)
        return np.array([T.homogeneous for T in Ts]), np.array(Cs)

    return n, work, answer


def jaxlie(data: Data) -> Contestant:
    import jax
    import jax.numpy as jnp
    import jaxlie

    def parameters(T: np.ndarray) -> object:
        return jnp.asarray(np.concatenate([SO3.as_quaternion(SE3.rotation(T)), SE3.translation(T)], axis=-1))

    def one(a: object, C1: object, b: object, C2: object) -> tuple[object, object]:
        T12 = jaxlie.SE3(a).inverse() @ jaxlie.SE3(b)
        Ad = T12.inverse().adjoint()
        return T12.wxyz_xyz, Ad @ C1 @ Ad.T + C2

    many = jax.jit(jax.vmap(one))
    inputs = parameters(data.T1), jnp.asarray(data.C1), parameters(data.T2), jnp.asarray(data.C2)

    def work() -> tuple[object, object]:
        return jax.block_until_ready(many(*inputs))

    def answer() -> Answer:
        x, C = (np.asarray(a) for a in work())
        return SE3.from_parts(SO3.from_quaternion(x[:, :4]), x[:, 4:]), C

    return len(data.T1), work, answer


CONTESTANTS: dict[str, tuple[str, Callable[[Data], Contestant]]] = {
    "tanteo `relate_arrays`": ("tanteo", tanteo),
    "the formula in NumPy, batched": ("numpy", plain_numpy),
    "jaxlie, jitted and vmapped": ("jaxlie", jaxlie),
    "pinocchio, loop": ("pin", pinocchio),
    "GTSAM, loop": ("gtsam", gtsam),
    "pytransform3d transforms, loop": ("pytransform3d", pytransform3d_lean),
    "pytransform3d uncertainty, loop": ("pytransform3d", pytransform3d_uncertainty),
}


def measure() -> Table:
    data = make_data(PAIRS)
    expected = relate_arrays(data.T1, data.C1, data.T2, data.C2)
    rows, ours = [], 0.0
    for name, (package, make) in CONTESTANTS.items():
        label = f"{name} ({version(package)})"
        try:
            n, work, answer = make(data)
        except ImportError as error:
            rows.append((label, "-", "-", f"not installed: {error}"))
            continue
        for got, wanted in zip(answer(), expected, strict=True):
            np.testing.assert_allclose(got, wanted[:n], atol=1e-9 * np.abs(wanted).max())
        per_pair = seconds(work) / n
        ours = ours or per_pair
        rows.append((label, f"{per_pair * 1e6:.3g}", f"{1 / per_pair:,.0f}", f"{per_pair / ours:.3g}"))
    columns = ("", "microseconds a pair", "pairs a second", "times tanteo's")
    return Table(f"Relating {PAIRS:,} pairs of uncertain frames", TEXT, columns, rows)
