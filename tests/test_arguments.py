"""What is passed by mistake is refused with advice, and what is meant is taken: paths, texts, one part for several."""

from __future__ import annotations

import copy
import os
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tanteo
from tanteo.errors import InputError
from tanteo.planning import Sensing, Session, Stop, at_place, probe_of
from tanteo.planning.start import at_pose
from tanteo.posterior import PosePrior, Priors, prepare
from tanteo.sensors import Readings
from tanteo.sensors.presets import sensor_preset
from tanteo.vision import prepare_vision

EXAMPLES = Path(__file__).parents[1] / "examples"
EYE, LOOSE, DOWN = np.eye(4), 1e-4 * np.eye(6), np.tile([0.0, 0.0, -1.0], (12, 1))


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    """A wedge of 60 x 40 x 30 mm."""
    file = tmp_path_factory.mktemp("part") / "wedge.off"
    corners = [(x, y, z) for z in (0, 30) for x, y in ((0, 0), (60, 0), (45, 40), (0, 40))]
    faces = ["3 2 1 0", "4 5 6 7", "0 1 5 4", "1 2 6 5", "2 3 7 6", "3 0 4 7"]
    rows = [" ".join(map(str, c)) for c in corners] + [f"4 {f}" for f in faces]
    file.write_text("\n".join(["OFF", "8 6 0", *rows, ""]))
    return tanteo.read_part(file, unit="mm")


@pytest.fixture(scope="module")
def readings():
    at = [(10, 10, 0), (30, 10, 0), (20, 30, 0), (10, 0, 10), (40, 0, 15), (20, 0, 25), (0, 10, 10), (0, 30, 20)]
    at += [(10, 40, 10), (30, 40, 20), (10, 10, 30), (40, 20, 30)]
    return Readings.from_columns(1e-3 * np.array(at, dtype=float), sds=np.full(len(at), 1e-4))


MISUSES = [
    (lambda r, p: tanteo.identify(r, "parts"), r"parts: .*the path 'parts'\. .*read_parts\('parts'\)"),
    (lambda r, p: tanteo.identify(r, [p, Path("a.step")]), r"the path 'a\.step'"),
    (lambda r, p: tanteo.identify(r, 3), r"parts: expected parts, got one of type int"),
    (lambda r, p: tanteo.identify(r, []), r"parts: expected at least one part"),
    (lambda r, p: tanteo.identify("a.csv", p), r"readings: expected Readings, got 'a\.csv'.*read_readings"),
    (lambda r, p: tanteo.identify(r.points[:], p), r"readings: .*type ndarray.*from_columns"),
    (lambda r, p: tanteo.identify(r, p, sd="0.3mm"), r"sd: expected one number \[m\], got '0\.3mm'.*0\.3e-3"),
    (lambda r, p: tanteo.identify(r, p, sd=[1e-4, 2e-4]), r"sd: expected one number"),
    (lambda r, p: tanteo.identify(r, p, tolerance="0.1mm"), r"tolerance: expected one number \[m\]"),
    (lambda r, p: tanteo.identify(r, p, tolerance=None), r"tolerance: expected one number"),
    (lambda r, p: tanteo.identify(r, p, rig="paper-gripper"), r"rig: expected Rig, got 'paper-gripper'.*read_rig"),
    (lambda r, p: tanteo.identify(r, p, robot=3), r"robot: expected RobotPreset, got one of type int"),
    (lambda r, p: tanteo.identify(r, p, sensor=3), r"sensor: expected SensorPreset"),
    (lambda r, p: tanteo.identify(r, p, tip_sd="1,1,1mm"), r"tip_sd: expected three numbers \[m\]"),
    (lambda r, p: tanteo.identify(r, p, significance="1%"), r"significance: expected one number"),
    (lambda r, p: tanteo.identify(r, p, top=1.5), r"top: expected a whole number, got 1\.5"),
    (lambda r, p: tanteo.identify(r, p, top=0), r"top: expected 1 or more, got 0"),
    (lambda r, p: tanteo.identify(r, p, seed=-1), r"seed: expected 0 or more, got -1"),
    (lambda r, p: tanteo.identify(r, p, seed="a"), r"seed: .*got 'a'"),
    (lambda r, p: tanteo.identify(r, p, priors=PosePrior()), r"priors: expected Priors, .*Priors\(pose="),
    (lambda r, p: tanteo.locate(r, [p, p]), r"part: expected one part, got 2\. Use tanteo\.identify"),
    (lambda r, p: tanteo.read_parts(None), r"paths: expected Iterable, got one of type NoneType"),
    (lambda r, p: tanteo.read_readings(None), r"path: expected str, got one of type NoneType"),
    (lambda r, p: Readings.from_columns(3), r"readings: expected columns"),
    (lambda r, p: Readings.from_columns([[1, 2, 3], [1, 2]]), r"points: expected numbers, one row a reading"),
    (lambda r, p: Readings.from_columns([["a", 2, 3]]), r"points: expected numbers.*'a'"),
    (lambda r, p: Readings.from_columns(r.points, sds="0.3mm"), r"sds: expected numbers.*'0\.3mm'"),
    (lambda r, p: Priors(outlier_rate="2%"), r"priors, outlier_rate: expected one number"),
    (lambda r, p: Stop(probability="99%"), r"probability: expected one number"),
    (lambda r, p: Stop(tolerance="1mm"), r"tolerance: expected one number \[m\]"),
    (lambda r, p: Stop(max_measurements=2.5), r"max_measurements: expected a whole number"),
    (lambda r, p: Sensing(sd="0.3mm"), r"sd: expected one number \[m\]"),
    (lambda r, p: at_place("wedge.step", EYE, LOOSE), r"parts: .*'wedge\.step'"),
    (lambda r, p: at_pose([p, p], EYE, LOOSE), r"part: expected one part, got 2"),
    (lambda r, p: tanteo.identify(r, p, sd=[[1e-4], [1e-4, 2e-4]]), r"sd: expected one number"),
    (lambda r, p: tanteo.identify(r, p, top=True), r"top: expected a whole number"),
    (lambda r, p: at_place(p, np.eye(3), LOOSE), r"T_world_place: expected 4 x 4"),
    (lambda r, p: at_place(p, EYE, np.eye(3)), r"covariance: expected 6 x 6"),
    (lambda r, p: at_place(p, EYE, np.diag([1e-4] * 3 + [100.0] * 3)), r"got 10 rad\. Is it in degrees"),
    (lambda r, p: probe_of(3), r"preset: expected SensorPreset"),
    (lambda r, p: probe_of("nobody"), r"sensor: expected one of"),
    (lambda r, p: Session(p, probe_of("keyence_il300")), r"start: expected Start.*at_place\(parts"),
    (lambda r, p: Session(at_pose(p, EYE, LOOSE), "laser"), r"probe: expected Probe, got 'laser'"),
    (lambda r, p: Session(at_pose(p, EYE, LOOSE), probe_of("keyence_il300"), "x"), r"sensing: expected Sensing"),
    (lambda r, p: Session(at_pose(p, EYE, LOOSE), probe_of("keyence_il300"), seed=0.5), r"seed: expected a whole"),
    (lambda r, p: Session(at_pose(p, EYE, LOOSE), probe_of("keyence_il300")).tell(r.points[:]), r"readings: .*ndarray"),
]


@pytest.mark.parametrize(("misuse", "words"), MISUSES)
def test_a_mistake_is_named_with_what_to_do(part, readings, misuse, words):
    with pytest.raises(InputError, match=words):
        misuse(readings, part)


def test_one_part_a_generator_and_a_catalogue_are_parts(part, readings):
    first = tanteo.locate(readings, part)
    assert first.hypotheses[0].part == "wedge"
    for parts in (part, (p for p in [part]), np.array([part], dtype=object), prepare(part)):
        again = tanteo.identify(readings, parts)
        assert again.message == first.message
        assert np.array_equal(again.hypotheses[0].T_world_part, first.hypotheses[0].T_world_part)


def test_numbers_of_numpy_are_numbers(part, readings):
    of_numpy = {"tolerance": np.float64(1e-4), "significance": np.array(0.01), "top": np.int64(2), "seed": np.uint8(3)}
    plain = {"tolerance": 1e-4, "significance": 0.01, "top": 2, "seed": 3}
    assert tanteo.identify(readings, part, **of_numpy).message == tanteo.identify(readings, part, **plain).message


def test_a_session_takes_parts_and_names_of_sensors(part):
    sensor = sensor_preset("keyence_il300")
    by_name = probe_of("keyence_il300", "calibrated_small")
    assert (by_name.name, by_name.max_range) == (sensor.name, sensor.max_range)
    assert by_name.repeat_sd > 0
    from_part, prepared = at_place(part, EYE, LOOSE), at_place([prepare(part)], EYE.tolist(), LOOSE.tolist())
    assert np.array_equal(from_part.Ts, prepared.Ts)
    assert np.array_equal(from_part.covariances, prepared.covariances)
    Session(from_part, by_name, Sensing(sensor="keyence_il300"), seed=np.int64(1)).ask()


def test_what_is_prepared_is_kept_with_the_part_and_only_there(part):
    assert prepare(part) is prepare(part)
    assert prepare_vision(part) is prepare_vision(part)
    for other in (replace(part, name="b"), copy.copy(part), copy.deepcopy(part), pickle.loads(pickle.dumps(part))):
        assert other.derived == {}
        assert np.array_equal(other.vertices, part.vertices)
        assert prepare(other) is not prepare(part)
        assert prepare(other).part is other


def test_the_cache_may_be_below_the_home_folder(monkeypatch, tmp_path):
    from tanteo.catalogue.cache import cache_folder

    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("TANTEO_CACHE", os.path.join("~", "kept"))
    assert cache_folder() == tmp_path / "kept" or os.name == "nt"


@pytest.mark.parametrize("labelled", [False, True])
def test_millimetres_are_recognised_by_their_span(part, readings, labelled):
    columns = {"features": [f"f{k // 3}" for k in range(12)], "kinds": ["plane"] * 12} if labelled else {}
    wide = Readings.from_columns(1e3 * readings.points[:], sds=readings.sds, directions=DOWN, **columns)
    assert "the largest part measures 0.0" in tanteo.identify(wide, part).message
    assert "the largest part measures 0.0" in tanteo.identify(wide, prepare(part)).message
    same = Readings.from_columns(readings.points, sds=readings.sds)
    assert "measures" not in tanteo.identify(same, part).message
