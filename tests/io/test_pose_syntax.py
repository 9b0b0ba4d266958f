"""Poses in the syntax of a controller: one pose, as each of them shows it."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.io import pose_as_brand
from tanteo.io.poses import parse_pose, parse_pose_prior

T = SE3.from_parts(SO3.exp(np.array([0.2, -0.1, 1.2])), np.array([0.21, -0.4, 0.05]))


def shown(brand, digits=9):
    return [f"{x:.{digits}f}" for x in pose_as_brand(brand, T)]


def typed():
    x, y, z, a, b, c = shown("kuka")
    w = shown("fanuc")
    q = shown("abb")
    return {
        "numbers": f"kuka {x},{y},{z},{a},{b},{c}",
        "colon": f"kuka: {x} {y} {z} {a} {b} {c}",
        "frame": f"kuka {{X {x}, Y {y}, Z {z}, A {a}, B {b}, C {c}}}",
        "any order": f"kuka {{C {c}, B {b}, A {a}, Z {z}, X {x}, Y {y}, S 2, T 34}}",
        "position": "fanuc X = {} mm, Y = {} mm, Z = {} mm, W = {} deg, P = {} deg, R = {} deg".format(*w),
        "robtarget": f"abb [[{','.join(q[:3])}],[{','.join(q[3:])}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]",
        "two brackets": f"abb [[{','.join(q[:3])}],[{','.join(q[3:])}]]",
        "script": f"ur p[{', '.join(shown('ur'))}]",
        "ours": "210,-400,50mm {},{},{}deg".format(*np.degrees(pose_as_brand("paper", T)[3:])),
    }


@pytest.mark.parametrize("way", typed())
def test_one_pose_as_controllers_write_it(way):
    text = typed()[way]
    np.testing.assert_allclose(parse_pose(text), T, atol=1e-8)
    np.testing.assert_allclose(parse_pose_prior(text + " +- 5mm 3deg").T, T, atol=1e-8)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("kuka {X 1, Y 2, Z 3, A 0, B 0}", "got no C in"),
        ("kuka {X 1, X 1, Y 2, Z 3, A 0, B 0, C 0}", "expected X once"),
        ("kuka {X 1 m, Y 2, Z 3, A 0, B 0, C 0}", "expected X in mm, as kuka writes it, got m"),
        ("ur p[210, -400, 50, 0, 0, 1]", "within 100 m of the origin"),
        ("ur p[0.2, -0.4, 0.05, 0, 0, 90]", "are these degrees"),
        ("ur p[0.2, -0.4, 0.05, 4, 4, 4]", "a rotation vector of at most a full turn"),
        ("kuka 210,-400,50,1.5708,0,3.14159", "are these radians"),
        ("abb [[1,2,3],[1,1,0,0]]", "expected a length of 1"),
        ("abb [[1,2,3]]", "expected 7 finite numbers"),
        ("kukka 1,2,3,4,5,6", "Did you mean 'kuka'"),
        ("ur 1,2,3x,4,5,6", "expected plain numbers behind 'ur'"),
    ],
)
def test_what_a_controller_would_not_write_is_refused(text, message):
    with pytest.raises(InputError) as caught:
        parse_pose(text, "--pose-prior")
    assert str(caught.value).startswith("--pose-prior: ")
    assert message in str(caught.value)
