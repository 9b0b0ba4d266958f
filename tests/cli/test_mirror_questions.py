"""Readings with exchanged columns fit the mirrored part and raise a question; other readings raise none."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from bare_scenes import box_centred_pose, surface_points
from tanteo.errors import InputError
from tanteo.factors import ContactPoints, FreeRays
from tanteo.geometry import SE3
from tanteo.io import read_readings
from tanteo.parts import Surface, read_part
from tanteo.posterior import Answer, Priors, Problem
from tanteo.posterior.candidates import Candidates
from tanteo.posterior.convention_checks import about_conventions
from tanteo.sensors import Readings

EXAMPLES = Path(__file__).parents[2] / "examples"
PART = EXAMPLES / "parts" / "step_15mm.step"


@pytest.fixture(autouse=True)
def _kernel():
    pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")


def exchanged(name, target, *, swap=("x_mm", "y_mm"), vectors=("dx", "dy")):
    """Return the readings of an example with two columns exchanged."""
    a, b = swap
    u, v = vectors
    names = {a: b, b: a, u: v, v: u}
    lines = (EXAMPLES / "readings" / name).read_text().splitlines()
    head = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    lines[head] = ",".join(names.get(column, column) for column in lines[head].split(","))
    target.write_text("\n".join(lines) + "\n")
    return target


@pytest.mark.slow
@pytest.mark.parametrize("swap", [("x_mm", "y_mm", "dx", "dy"), ("y_mm", "z_mm", "dy", "dz")])
def test_exchanged_columns_raise_a_question(run, tmp_path, swap):
    file = exchanged("step_15mm.csv", tmp_path / "r.csv", swap=swap[:2], vectors=swap[2:])
    _, _, err = run("locate", file, "--part", PART)
    assert "irror" in err
    assert "Are two of the columns x, y, z exchanged" in err


def test_programs_get_the_question_too(run, tmp_path):
    file = exchanged("step_15mm.csv", tmp_path / "r.csv")
    code, out, err = run("locate", file, "--part", PART, "--json")
    (warning,) = json.loads(out)["warnings"]
    assert code in (0, 3)
    assert "irror" in warning
    assert f"warning: {warning}" in err


@pytest.mark.slow
def test_readings_of_no_part_raise_no_question(run):
    code, out, err = run("identify", EXAMPLES / "readings/unknown_part.csv", "--parts", PART, "--json")
    assert (code, json.loads(out)["status"]) == (3, "unknown")
    assert "warnings" not in json.loads(out)
    assert "mirror" not in err


@pytest.mark.parametrize(
    "option",
    [
        ["--pose-prior", "0,0,0mm 0,0,0deg +- 500mm 90deg"],
        pytest.param(["--table", "0mm +- 500mm"], marks=pytest.mark.slow),
    ],
)
def test_where_the_place_is_known_nothing_is_mirrored(run, tmp_path, option):
    file = exchanged("step_15mm.csv", tmp_path / "r.csv")
    assert "mirror" not in run("locate", file, "--part", PART, *option).err


def test_readings_of_a_hand_are_not_mirrored(run):
    words = ["--rig", EXAMPLES / "readings/laser_rig.toml", "--part", PART]
    result = run("locate", EXAMPLES / "readings/wedge_ranges.csv", *words)
    assert result.out.startswith("unknown")
    assert "mirror" not in result.err


def bare(part, file, *, mirrored, seed, count=11):
    """Touches of a part anywhere, without labels; in a left-handed frame or not."""
    rng = np.random.default_rng(seed)
    surface = Surface(part.vertices, part.triangles)
    points, normals = surface_points(surface, count, rng)
    T = box_centred_pose(rng)
    points = SE3.apply(T, points) + 1e-4 * rng.normal(size=points.shape)
    directions = -normals @ T[:3, :3].T
    flip = [1, 1, -1] if mirrored else [1, 1, 1]
    rows = np.concatenate([1e3 * points * flip, directions * flip], axis=1)
    lines = [",".join(f"{x:.4f}" for x in row) for row in rows]
    file.write_text("\n".join(["x_mm,y_mm,z_mm,dx,dy,dz", *lines, ""]))
    return file


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [2, pytest.param(12, marks=pytest.mark.slow)])
def test_a_better_mirror_image_raises_a_question(run, tmp_path, seeds):
    """With few touches one of a mirrored part's may pass for an outlier of the part."""
    part, offered = read_part(EXAMPLES / "parts/bracket_left.step"), 0
    for seed in range(seeds):
        file = bare(part, tmp_path / "r.csv", mirrored=True, seed=seed)
        code, out, err = run("locate", file, "--part", part.source, "--sd", "0.1mm")
        outliers = "Readings that do not fit" in out
        assert not (code == 0 and outliers and "right-handed" not in err)
        offered += "right-handed" in err
        file = bare(part, tmp_path / "r.csv", mirrored=False, seed=seed)
        assert "right-handed" not in run("locate", file, "--part", part.source, "--sd", "0.1mm").err
    assert offered > 0


def test_inward_normals_raise_a_question(run, tmp_path):
    part, rng = read_part(EXAMPLES / "parts/bracket_left.step"), np.random.default_rng(1)
    points, normals = surface_points(Surface(part.vertices, part.triangles), 12, rng)
    for sign, mirrored in ((-1, True), (1, False)):
        rows = np.concatenate([1e3 * points, -normals, sign * normals], axis=1)
        lines = [",".join(f"{x:.4f}" for x in row) for row in rows]
        file = tmp_path / "r.csv"
        file.write_text(
            "\n".join(["x_mm,y_mm,z_mm,dx,dy,dz,nx,ny,nz,normal_sd_deg,sd_mm", *[f"{x},1,0.1" for x in lines]])
        )
        result = run("locate", file, "--part", part.source)
        assert ("normals have to point out of the material" in result.err) == mirrored


def question(answer):
    """Return a stand-in for a question with too few points for a trial fit, and its answer."""
    return SimpleNamespace(
        rig=None,
        problem=lambda readings, parts: (Problem(ContactPoints.none(), FreeRays.none(), Priors()), Candidates(parts)),
        answer=lambda readings, parts, *, shared_errors=(), settings=None: answer(readings, parts),
    )


@pytest.mark.parametrize(("excluded", "offered"), [((), True), (("3",), False)])
def test_a_mirror_image_has_to_fit_all_readings(excluded, offered):
    part = read_part(EXAMPLES / "parts/bracket_left.step")

    def mirrored(readings, parts):
        return SimpleNamespace(rig=None, best=SimpleNamespace(part=parts[1].name, outliers=excluded, probability=0.999))

    best = SimpleNamespace(
        rig=None, part=part.name, outliers=("7",), pairings=(("1", "face 0"),) * 20, noise_scale=(1.0, 0.9, 1.1)
    )
    answer = SimpleNamespace(rig=None, status="recognized", best=best)
    readings = read_readings(EXAMPLES / "readings/bracket_left.csv")
    assert bool(about_conventions(answer, readings, [part], question(mirrored))) == offered


def test_an_impossible_question_costs_the_answer_nothing():
    def refused(readings, parts):
        raise InputError("no")

    part = read_part(EXAMPLES / "parts/step_15mm.step")
    readings = read_readings(EXAMPLES / "readings/step_15mm.csv")
    assert about_conventions(Answer("unknown", (), (), 1.0), readings, [part], question(refused)) is None


def test_two_dozen_of_many_readings_raise_a_question():
    offered = []

    def refused(readings, parts):
        offered.append(len(readings))
        raise InputError("no")

    part = read_part(EXAMPLES / "parts/step_15mm.step")
    readings = Readings.from_columns(points=0.02 * np.random.default_rng(0).normal(size=(100, 3)))
    assert about_conventions(Answer("unknown", (), (), 1.0), readings, [part], question(refused)) is None
    assert set(offered) == {24}
