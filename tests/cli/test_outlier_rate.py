"""``--outlier-rate`` and ``--unknown-prior``: expected outliers, and the prior of the unknown object."""

import json
from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import surface_points
from tanteo.parts import Surface

BRACKET = Path(__file__).parents[2] / "examples" / "parts" / "bracket_left.step"


@pytest.fixture(scope="module")
def touches(tmp_path_factory):
    """Thirty touches of the bracket, eight of them somewhere else."""
    part, rng = tanteo.read_part(BRACKET), np.random.default_rng(8)
    p, _ = surface_points(Surface(part.vertices, part.triangles), 30, rng)
    p += 1e-4 * rng.normal(size=p.shape)
    p[22:] += rng.uniform(-0.05, 0.05, (8, 3))
    lines = ["x_mm,y_mm,z_mm,sd_mm", *("{:.4f},{:.4f},{:.4f},0.1".format(*(1e3 * x)) for x in p)]
    path = tmp_path_factory.mktemp("outliers") / "touches.csv"
    path.write_text("\n".join(lines) + "\n")
    return str(path)


@pytest.mark.slow
def test_more_outliers_than_expected_are_no_answer(run, touches):
    code, out, _ = run("locate", touches, "--part", str(BRACKET))
    assert code == 3
    assert "of 30 readings are not on it" in out
    code, out, _ = run("locate", touches, "--part", str(BRACKET), "--outlier-rate", "30%")
    assert code == 0
    assert "bracket_left at x " in out


def test_a_preset_of_the_sensor_has_its_rate_of_outliers(run, tmp_path):
    """Options that state no rate take that of the sensor; a stated rate replaces it."""
    part, rng = tanteo.read_part(BRACKET), np.random.default_rng(3)
    p = 1e3 * surface_points(Surface(part.vertices, part.triangles), 14, rng)[0]
    path = tmp_path / "touches.csv"
    path.write_text("x_mm,y_mm,z_mm,sd_mm\n" + "".join("{:.3f},{:.3f},{:.3f},0.1\n".format(*x) for x in p))

    def unknown(*words):
        found = run("locate", path, "--part", BRACKET, "--json", "--bias-sd", "0.001mm", *words)
        return json.loads(found.out)["unknown_probability"]

    trigger, rare, often = ("--sensor", "touch_trigger_cnc"), ("--outlier-rate", "0.1%"), ("--outlier-rate", "30%")
    assert unknown(*trigger) == pytest.approx(unknown(*rare), rel=0.01)
    assert unknown(*trigger, *often) == pytest.approx(unknown(*often), rel=0.01)
    assert unknown(*rare) < 0.95 * unknown()
    assert "outliers   0.1 %" in run("sensor", "show", "touch_trigger_cnc").out

    readings = tanteo.read_readings(path)  # in Python as on the command line
    rare, usual = (
        tanteo.locate(readings, part, sensor=sensor, bias_sd=1e-6).unknown_probability
        for sensor in ("touch_trigger_cnc", None)
    )
    assert rare < 0.95 * usual


def test_the_unknown_object_has_its_stated_prior(run, tmp_path):
    """Eight touches, all on the part, that leave most of it unseen."""
    part = tanteo.read_part(BRACKET)
    p, _ = surface_points(Surface(part.vertices, part.triangles), 12, np.random.default_rng(3))
    path = tmp_path / "touches.csv"
    path.write_text("\n".join(["x_mm,y_mm,z_mm,sd_mm", *("{:.4f},{:.4f},{:.4f},0.1".format(*(1e3 * x)) for x in p)]))
    usual, rare, common = (
        json.loads(run("locate", path, "--part", str(BRACKET), "--json", *more).out)["unknown_probability"]
        for more in ((), ("--unknown-prior", "0.1%"), ("--unknown-prior", "0.9"))
    )
    odds = [p / (1 - p) for p in (usual, rare, common)]
    assert odds[1] / odds[0] == pytest.approx(0.001 / 0.999 / (0.05 / 0.95), rel=0.01)
    assert odds[2] / odds[0] == pytest.approx(9 / (0.05 / 0.95), rel=0.01)
    code, _, err = run("locate", path, "--part", str(BRACKET), "--unknown-prior", "100%")
    assert code == 2
    assert "--unknown-prior: expected a fraction above 0 and below one, got '100%'" in err


@pytest.mark.parametrize("text", ["0", "0.5", "-10%", "60%", "some", "nan", "1e999"])
def test_a_share_that_cannot_be_meant_is_refused(run, touches, text):
    code, out, err = run("locate", touches, "--part", str(BRACKET), f"--outlier-rate={text}")
    assert (code, out) == (2, "")
    assert f"--outlier-rate: expected a fraction above 0 and below one half, got '{text}'" in err
