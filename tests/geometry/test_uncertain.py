"""Uncertain frames: laws over batches, covariances against sampling, the fast kernel against the formula."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from tanteo import geometry
from tanteo.errors import CovarianceError, InputError
from tanteo.geometry import SE3, UncertainFrame

BATCHES = [(), (1,), (5,), (2, 3), (0,)]
TRIALS = 4000


def covariances(rng, batch, sigma=1e-3, rank=6):
    A = sigma * rng.normal(size=(*batch, 6, rank))
    return A @ np.swapaxes(A, -1, -2)


def transforms(rng, batch, reach=2.0):
    xi = rng.normal(size=(*batch, 6)) * [reach, reach, reach, 1, 1, 1]
    return SE3.exp(xi)


def uncertain(rng, batch=(), **kwargs):
    return UncertainFrame(transforms(rng, batch), covariances(rng, batch, **kwargs))


def assert_same(a, b, rtol=1e-12):
    assert a.batch == b.batch
    np.testing.assert_allclose(a.T, b.T, atol=rtol * 10)
    np.testing.assert_allclose(a.C, b.C, atol=rtol * np.abs(b.C).max(initial=1e-300))


def assert_consistent(errors, C):
    """NEES of ``errors`` ``(n, 6)`` within its 95 % interval, and every whitened variance within 5 s.d. of 1."""
    n, d = errors.shape
    assert n >= 2000
    white = np.linalg.solve(np.linalg.cholesky(C), errors[..., None])[..., 0]
    low, high = chi2.ppf([0.025, 0.975], n * d)
    assert low <= np.sum(white**2) <= high
    np.testing.assert_allclose(white.T @ white / n, np.eye(d), atol=5 * np.sqrt(2 / n))


@pytest.mark.parametrize("batch", BATCHES)
class TestLaws:
    def test_associative(self, batch):
        rng = np.random.default_rng(1)
        a, b, c = (uncertain(rng, batch) for _ in range(3))
        assert_same(
            geometry.compose(geometry.compose(a, b), c), geometry.compose(a, geometry.compose(b, c)), rtol=1e-11
        )

    def test_inverting_twice(self, batch):
        a = uncertain(np.random.default_rng(2), batch)
        assert_same(geometry.invert(geometry.invert(a)), a, rtol=1e-11)

    def test_inverse_of_a_product(self, batch):
        rng = np.random.default_rng(3)
        a, b = uncertain(rng, batch), uncertain(rng, batch)
        swapped = geometry.compose(geometry.invert(b), geometry.invert(a))
        assert_same(geometry.invert(geometry.compose(a, b)), swapped, rtol=1e-11)

    def test_relating_is_inverse_then_compose(self, batch):
        rng = np.random.default_rng(4)
        a, b = uncertain(rng, batch), uncertain(rng, batch)
        assert_same(geometry.relate(a, b), geometry.compose(geometry.invert(a), b), rtol=1e-11)

    def test_relating_does_not_see_the_world_frame(self, batch):
        rng = np.random.default_rng(5)
        a, b, T = uncertain(rng, batch), uncertain(rng, batch), transforms(rng, ())
        moved = geometry.relate(UncertainFrame(T @ a.T, a.C), UncertainFrame(T @ b.T, b.C))
        assert_same(moved, geometry.relate(a, b), rtol=1e-11)

    def test_results_are_frames(self, batch):
        rng = np.random.default_rng(6)
        a, b = uncertain(rng, batch), uncertain(rng, batch, rank=2)
        for result in (
            geometry.compose(a, b),
            geometry.relate(b, a),
            geometry.invert(b),
            geometry.compose(a, b, order=4),
        ):
            UncertainFrame(result.T, result.C)  # passes its own checks, singular covariances included
            np.testing.assert_array_equal(result.C, np.swapaxes(result.C, -1, -2))
            assert not result.T.flags.writeable
            assert not result.C.flags.writeable

    def test_sample_shape(self, batch):
        rng = np.random.default_rng(7)
        assert geometry.sample(uncertain(rng, batch), rng, (4,)).shape == (4, *batch, 4, 4)


class TestRelateArrays:
    def formula(self, T1, C1, T2, C2):
        T12 = SE3.inverse(T1) @ T2
        A = SE3.adjoint_inverse(T12)
        return T12, A @ C1 @ np.swapaxes(A, -1, -2) + C2

    @pytest.mark.parametrize("n", [0, 1, 2, 1023, 1024, 1025, 3000])
    def test_equals_the_formula(self, n):
        rng = np.random.default_rng(8)
        a = transforms(rng, (n,), 30.0), covariances(rng, (n,)), transforms(rng, (n,), 30.0), covariances(rng, (n,))
        for got, wanted in zip(geometry.relate_arrays(*a), self.formula(*a), strict=True):
            assert got.shape == wanted.shape
            scale = np.abs(wanted).max(axis=(-1, -2), initial=0.0, keepdims=True)
            assert np.all(np.abs(got - wanted) <= 1e-12 * scale)
            assert got.flags.c_contiguous
            assert got.dtype == np.float64

    @pytest.mark.parametrize(
        ("first", "second"), [((), ()), ((), (7,)), ((7,), ()), ((4, 1), (1, 3)), ((2, 1, 3), (5, 1)), ((0,), ())]
    )
    def test_broadcasts(self, first, second):
        rng = np.random.default_rng(9)
        a = transforms(rng, first), covariances(rng, ()), transforms(rng, second), covariances(rng, second)
        for got, wanted in zip(geometry.relate_arrays(*a), self.formula(*a), strict=True):
            assert got.shape == wanted.shape
            np.testing.assert_allclose(got, wanted, rtol=1e-10, atol=1e-16)

    def test_any_memory_layout(self):
        rng = np.random.default_rng(10)
        a = transforms(rng, (9,)), covariances(rng, (9,)), transforms(rng, (9,)), covariances(rng, (9,))
        fortran = [np.asfortranarray(x) for x in a]
        strided = [np.repeat(x, 2, axis=0)[::2] for x in a]
        read_only = [np.broadcast_to(x, x.shape) for x in a]
        for other in (fortran, strided, read_only):
            for got, wanted in zip(geometry.relate_arrays(*other), geometry.relate_arrays(*a), strict=True):
                np.testing.assert_allclose(got, wanted, rtol=1e-12, atol=1e-18)

    def test_inputs_are_left_alone(self):
        rng = np.random.default_rng(11)
        a = transforms(rng, (3,)), covariances(rng, (3,)), transforms(rng, (3,)), covariances(rng, (3,))
        before = [x.copy() for x in a]
        geometry.relate_arrays(*a)
        for x, y in zip(a, before, strict=True):
            np.testing.assert_array_equal(x, y)


class TestAgainstSampling:
    def test_compose(self):
        rng = np.random.default_rng(20)
        a, b = uncertain(rng), uncertain(rng)
        result = geometry.compose(a, b)
        truth = geometry.sample(a, rng, (TRIALS,)) @ geometry.sample(b, rng, (TRIALS,))
        assert_consistent(SE3.log(SE3.inverse(result.T) @ truth), result.C)

    def test_invert(self):
        rng = np.random.default_rng(21)
        a = uncertain(rng)
        result = geometry.invert(a)
        assert_consistent(SE3.log(SE3.inverse(result.T) @ SE3.inverse(geometry.sample(a, rng, (TRIALS,)))), result.C)

    def test_relate(self):
        rng = np.random.default_rng(22)
        a, b = uncertain(rng), uncertain(rng)
        result = geometry.relate(a, b)
        truth = SE3.inverse(geometry.sample(a, rng, (TRIALS,))) @ geometry.sample(b, rng, (TRIALS,))
        assert_consistent(SE3.log(SE3.inverse(result.T) @ truth), result.C)

    @pytest.mark.parametrize("what", ["relate", "compose"])
    def test_correlated(self, what):
        rng = np.random.default_rng(23)
        L = 1e-3 * rng.normal(size=(12, 12))
        joint = L @ L.T
        a = UncertainFrame(transforms(rng, ()), joint[:6, :6])
        b = UncertainFrame(transforms(rng, ()), joint[6:, 6:])
        e = rng.normal(size=(TRIALS, 12)) @ L.T
        Ta, Tb = a.T @ SE3.exp(e[:, :6]), b.T @ SE3.exp(e[:, 6:])
        truth = SE3.inverse(Ta) @ Tb if what == "relate" else Ta @ Tb
        function = geometry.relate if what == "relate" else geometry.compose
        result = function(a, b, joint[:6, 6:])
        errors = SE3.log(SE3.inverse(result.T) @ truth)
        assert_consistent(errors, result.C)
        with pytest.raises(AssertionError):
            assert_consistent(errors, function(a, b).C)  # the correlation matters
        with pytest.raises(AssertionError):
            assert_consistent(errors, function(a, b, -joint[:6, 6:]).C)  # and so does its sign

    def test_fourth_order_is_needed_and_enough_at_large_tilts(self):
        # composed with a product of samples whose rotations have a s.d. of 0.35 rad about every axis
        rng = np.random.default_rng(24)
        C = np.diag([0.05**2] * 3 + [0.35**2] * 3)
        a, b = UncertainFrame(np.eye(4), C), UncertainFrame(SE3.exp(np.array([0.3, 0.2, 0.1, 0.4, 0.2, 0.1])), C)
        n = 200_000
        truth = geometry.sample(a, rng, (n,)) @ geometry.sample(b, rng, (n,))
        errors = SE3.log(SE3.inverse(a.T @ b.T) @ truth)
        sampled = errors.T @ errors / n
        ratios = {}
        for order in (2, 4):
            root = np.linalg.cholesky(geometry.compose(a, b, order=order).C)
            white = np.linalg.solve(root, np.linalg.solve(root, sampled).T)
            ratios[order] = np.abs(np.linalg.eigvalsh(white) - 1).max()
        assert ratios[4] < 0.6 * ratios[2]
        assert ratios[4] < 0.05

    def test_draws_keep_nanometres_beside_radians(self):
        # a lateral error that is all correlated with a turn, over six orders of magnitude
        C = np.diag([1e-18] * 3 + [1e-2] * 3)
        C[0, 5] = C[5, 0] = 0.9e-10
        frame, rng = UncertainFrame(np.eye(4), C), np.random.default_rng(25)
        assert_consistent(SE3.log(geometry.sample(frame, rng, (TRIALS,))), C)


class TestDegenerate:
    def test_certain_frames_stay_certain(self):
        rng = np.random.default_rng(30)
        a, b = (UncertainFrame(transforms(rng, ()), np.zeros((6, 6))) for _ in range(2))
        for result in (
            geometry.compose(a, b),
            geometry.compose(a, b, order=4),
            geometry.relate(a, b),
            geometry.invert(a),
        ):
            np.testing.assert_array_equal(result.C, 0.0)
        np.testing.assert_allclose(geometry.sample(a, rng, (3,)), np.broadcast_to(a.T, (3, 4, 4)), atol=1e-15)

    def test_a_frame_related_to_itself(self):
        rng = np.random.default_rng(31)
        a = uncertain(rng)
        independent = geometry.relate(a, a)
        np.testing.assert_allclose(independent.T, np.eye(4), atol=1e-14)
        np.testing.assert_allclose(independent.C, 2 * a.C, atol=1e-15)
        np.testing.assert_allclose(geometry.relate(a, a, a.C).C, 0.0, atol=1e-15)  # one and the same error cancels

    def test_a_common_error_cancels(self):
        rng = np.random.default_rng(32)
        C, Ta, Tb = covariances(rng, ()), transforms(rng, ()), transforms(rng, ())
        A, B = SE3.adjoint_inverse(Ta), SE3.adjoint_inverse(Tb)  # one error of the world frame, in either part frame
        a, b = UncertainFrame(Ta, A @ C @ A.T), UncertainFrame(Tb, B @ C @ B.T)
        np.testing.assert_allclose(geometry.relate(a, b, A @ C @ B.T).C, 0.0, atol=1e-14)

    def test_free_directions_stay_free_of_variance(self):
        rng = np.random.default_rng(33)
        C = np.diag([0, 1e-6, 1e-6, 0, 1e-4, 1e-4])
        result = geometry.compose(UncertainFrame(transforms(rng, ()), np.zeros((6, 6))), UncertainFrame(np.eye(4), C))
        np.testing.assert_array_equal(result.C, C)

    def test_rounding_of_singular_covariances_is_no_fault(self):
        rng = np.random.default_rng(34)
        frame = UncertainFrame(transforms(rng, (200,), 0.5), np.diag([1e-6, 0, 0, 0, 0, 1e-4]))
        for _ in range(3):
            frame = geometry.invert(frame)
            frame = UncertainFrame(frame.T, frame.C)


class TestRefusals:
    @pytest.mark.parametrize(
        "T",
        [
            np.eye(3),
            np.diag([1.0, 1, -1, 1]),
            np.diag([1.0, 2, 1, 1]),
            np.full((4, 4), np.nan),
            np.eye(4) + np.eye(4)[3],
        ],
    )
    def test_not_a_motion(self, T):
        with pytest.raises(InputError, match="T: expected"):
            UncertainFrame(T, np.eye(6))

    @pytest.mark.parametrize(
        "C",
        [
            np.eye(5),
            np.diag([1.0, 1, 1, 1, 1, -1]),
            np.diag([1.0] * 5 + [np.inf]),
            np.eye(6) + np.eye(6, k=1),
            np.eye(6) + 1.1 * (np.eye(6, k=1) + np.eye(6, k=-1)),
            np.diag([0.0] + [1.0] * 5) + 1e-3 * (np.eye(6, k=1) + np.eye(6, k=-1)),
        ],
    )
    def test_not_a_covariance(self, C):
        with pytest.raises(CovarianceError, match="C: expected"):
            UncertainFrame(np.eye(4), C)
        if C.shape == (6, 6):
            batch = np.stack([np.eye(6), C])
            with pytest.raises(CovarianceError, match="C: expected"):
                UncertainFrame(np.eye(4), batch)

    def test_order(self):
        a = uncertain(np.random.default_rng(40))
        for order, cross in ((3, None), (4, np.zeros((6, 6)))):
            with pytest.raises(InputError, match="order: expected 2"):
                geometry.compose(a, a, cross, order=order)


def test_metres_and_radians_are_judged_equally():
    tiny = np.diag([1e-18] * 3 + [1e-2] * 3)  # nanometres beside a tenth of a radian
    np.testing.assert_array_equal(UncertainFrame(np.eye(4), tiny).C, tiny)


def test_values_are_copied():
    T, C = np.eye(4), np.eye(6)
    frame = UncertainFrame(T, C)
    T[0, 3], C[0, 0] = 1.0, 9.0
    assert frame.T[0, 3] == 0
    assert frame.C[0, 0] == 1
    with pytest.raises(ValueError, match="read-only"):
        frame.T[0, 3] = 1.0


def test_certain_and_uncertain_broadcast():
    frame = UncertainFrame(transforms(np.random.default_rng(41), (3,)), 1e-6 * np.eye(6))
    assert frame.batch == (3,)
    assert frame.C.shape == (3, 6, 6)
