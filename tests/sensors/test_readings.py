"""What readings refuse, and that taking rows keeps them whole; presets complete and with their sources."""

import numpy as np
import pytest

from tanteo.errors import InputError, ReadingsError
from tanteo.sensors import Column, Readings, Rig, RigSensor, check_features
from tanteo.sensors.presets import robot_preset, robot_presets, sensor_preset, sensor_presets

P = np.arange(9.0).reshape(3, 3)
EYES = np.stack([np.eye(4)] * 3)
MIRROR = EYES * np.array([-1, 1, 1, 1.0])[None, :, None]


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"ids": ["a", "b", "a"]}, "got 'a' twice"),
        ({"ids": ["a", "", "c"]}, "got none in row 2"),
        ({"points": P[:, :2]}, "points: expected shape (3, 3), got (3, 2)"),
        ({"sds": [1, 1, 0.0]}, "sds of reading '3': expected a positive number [m], got 0"),
        ({"sds": [1, np.inf, 1.0]}, "sds of reading '2': expected finite numbers"),
        ({"sds": [1, 1e-200, 1.0]}, "sds of reading '2': expected at least 1e-09 m"),
        ({"sds": [1, 1, 1e200]}, "sds of reading '3': expected at most 1e+06 m"),
        ({"points": np.where(P > 7, 1e200, P)}, "points of reading '3': expected at most 1e+06 m"),
        ({"Ts_world_hand": EYES + 1e9 * np.outer([1, 0, 0, 0], [0, 0, 0, 1])}, "Ts_world_hand: expected a hand within"),
        ({"radii": [1, 1, -1.0]}, "radii of reading '3'"),
        ({"radii": [1, 1, np.nan]}, "radii of reading '3'"),
        ({"directions": np.zeros((3, 3))}, "expected a vector that is not zero, got zero in row 1"),
        ({"directions": np.full((3, 3), np.inf)}, "directions: expected finite numbers"),
        ({"normals": [[1, 0, 0], [1, np.nan, 0], [1, 0, 0]]}, "normals of reading '2'"),
        ({"kinds": ["plane", "plan", "plane"], "features": ["A"] * 3}, "got 'plan'"),
        ({"kinds": ["plane", "edge", "plane"], "features": ["A"] * 3}, "Give one label one kind"),
        ({"kinds": ["plane", "", ""]}, "expected a label for kind 'plane'"),
        ({"kinds": ["point"] * 2}, "kinds: expected 3 entries"),
        ({"features": ["A"] * 2 + ["B"] * 2}, "features: expected 3 entries"),
        ({"points": [[1, 2, 3], [np.nan] * 3, [1, 2, 3]]}, "reading '2': expected a point"),
        ({"is_free": [False, True, False]}, "free reading '2': expected where the beam was"),
        ({"normal_sds": [0.1] * 3}, "expected a normal beside it"),
        ({"normals": P + 1, "normal_sds": np.radians([1, 1000, 1])}, "normal_sds of reading '2': expected from 5.7"),
        ({"normals": P + 1, "normal_sds": np.radians([1, 1, 1e-20])}, "to 60 degrees, got 1e-20. Check the unit"),
        ({"Ts_world_hand": 2 * EYES}, "expected rigid motions"),
        ({"Ts_world_hand": MIRROR}, "expected rigid motions"),
        ({"points": np.ma.array(P, mask=P > 7)}, "points: expected numbers, got a masked array"),
        ({"sds": np.ma.array([1.0] * 3, mask=[0, 1, 0])}, "sds: expected numbers, got a masked array"),
        ({"directions": np.ma.array(P + 1, mask=P > 7)}, "directions: expected numbers, got a masked array"),
        ({"points": P + 1j}, "points: expected real numbers"),
        ({"is_free": ["ok", "none", "ok"]}, "is_free: expected true or false, got 'ok'"),
        ({"ids": [0, 0, 1]}, "got '0' twice"),
    ],
)
def test_refusals(columns, message):
    with pytest.raises(ReadingsError) as caught:
        Readings.from_columns(**({"points": P} | columns))
    assert message in str(caught.value)


def test_a_normal_may_be_known_badly_or_well():
    sds = [np.nan, np.radians(60.0), 1e-6]
    readings = Readings.from_columns(P, normals=P + 1, normal_sds=sds)
    np.testing.assert_array_equal(readings.normal_sds.filled(np.nan), sds)


@pytest.mark.parametrize(("kind", "least"), [("plane", 3), ("edge", 2), ("vertex", 1)])
def test_features_need_enough_readings(kind, least):
    for n in range(1, 4):
        r = Readings.from_columns(P[:n], kinds=[kind] * n, features=["A"] * n)
        if n < least:
            with pytest.raises(ReadingsError, match=f"at least {least} readings of kind {kind}, got {n}"):
                check_features(r)
        else:
            check_features(r)


def test_take_keeps_rows_whole():
    r = Readings.from_columns(P, ids=list("abc"), sds=[1, 2, 3], directions=P + 1, Ts_world_hand=EYES, source="s")
    t = r.take([2, 0])
    assert (t.ids, t.source, len(t)) == (("c", "a"), "s", 2)
    np.testing.assert_array_equal(t.points, P[[2, 0]])
    np.testing.assert_array_equal(t.sds, [3, 1])
    assert r.take(np.array([False, True, False])).ids == ("b",)


def test_free_by_kind_or_by_flag_is_the_same():
    flags = np.array([False, False, True])
    beams = {"directions": P + 1, "max_ranges": np.ones(3), "features": list("ABC")}
    r = Readings.from_columns(P, is_free=flags, kinds=["", "free", "plane"], **beams)
    assert r.kinds == ("point", "free", "free")
    assert r.features == ("A", "", "")
    np.testing.assert_array_equal(r.is_free, [False, True, True])
    np.testing.assert_array_equal(flags, [False, False, True])


def test_names_are_text_and_empty_cells_of_a_table_are_none():
    made = Readings.from_columns(P, ids=np.arange(3), features=[np.nan, None, "A"], sensors=["", np.nan, 7])
    assert made.ids == ("0", "1", "2")
    assert made.features == ("", "", "A")
    assert made.sensors == ("", "", "7")
    plain = Readings.from_columns(np.ma.array(P))  # nothing of it is masked
    np.testing.assert_array_equal(plain.points, P)


def test_no_readings_are_allowed_as_a_value():
    assert len(Readings.from_columns(np.zeros((0, 3)))) == 0


def test_presets_are_complete_and_name_their_source():
    assert len(sensor_presets()) == 23
    assert len(robot_presets()) == 5
    for preset in (*sensor_presets().values(), *robot_presets().values()):
        assert preset.check
        assert preset.source
    for p in sensor_presets().values():
        assert p.sigma_const > 0
        assert 0 <= p.beam_half_angle < np.pi / 4
        assert p.is_contact or p.max_range > p.min_range
        assert np.isnan(p.exp_k) == np.isnan(p.exp_d0)
    assert sensor_preset("vl53l0x").beam_half_angle == pytest.approx(np.deg2rad(12.5))
    assert robot_preset("calibrated_small").pos_abs_std == 0.000025


def test_unknown_presets_name_the_nearest():
    with pytest.raises(InputError, match="Did you mean 'vl53l1x'"):
        sensor_preset("VL53L1")
    with pytest.raises(InputError, match="robot: expected one of abb_irb1600"):
        robot_preset("zzz")


def test_rig_refuses_what_it_cannot_use():
    good = {
        "name": "a", "T_hand_sensor": np.eye(4), "preset": None, "sd": 1e-3, "beam_half_angle": 0.0,
        "max_range": 1.0, "bias_sd": 0.0, "cov_mount": np.zeros((6, 6)),
    }  # fmt: skip
    with pytest.raises(InputError, match="expected a preset or a positive sd"):
        RigSensor(**(good | {"sd": np.nan}))
    with pytest.raises(InputError, match="T_hand_sensor of sensor 'a'"):
        RigSensor(**(good | {"T_hand_sensor": np.full((4, 4), np.nan)}))
    with pytest.raises(InputError, match="within 90 degrees"):
        RigSensor(**(good | {"axis_cosine": -0.5}))
    with pytest.raises(InputError, match="names of their own"):
        Rig((RigSensor(**good), RigSensor(**good)))


def test_a_column_holds_only_what_was_reported():
    column = Column.from_rows([[np.nan] * 3, [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    assert column.given.tolist() == [False, True, True]
    np.testing.assert_array_equal(column.values, [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(column[[2, 1]], [[4, 5, 6], [1, 2, 3]])
    np.testing.assert_array_equal(column.filled(0.0), [[0, 0, 0], [1, 2, 3], [4, 5, 6]])
    assert not column.values.flags.writeable
    assert column.filled(0.0).flags.writeable


@pytest.mark.parametrize("read", [np.asarray, lambda column: column[0], lambda column: column[:]])
def test_a_column_refuses_rows_without_a_value(read):
    with pytest.raises(ReadingsError, match="got none of row 1"):
        read(Column.from_rows([np.nan, 1.0]))


def test_operations_on_columns_agree_with_operations_on_rows():
    rng = np.random.default_rng(1991)
    for _ in range(50):
        a, b = (np.where(rng.random(8) < 0.5, np.nan, rng.normal(size=8)) for _ in range(2))
        rows, mask = rng.integers(0, 8, 5), rng.random(8) < 0.5
        column = Column.from_rows(a)
        np.testing.assert_array_equal(column.filled(np.nan), a)
        np.testing.assert_array_equal(column.take(rows).filled(np.nan), a[rows])
        np.testing.assert_array_equal(column.only(mask).filled(np.nan), np.where(mask, a, np.nan))
        np.testing.assert_array_equal(column.map(np.square).filled(np.nan), a**2)
        np.testing.assert_array_equal(column.coalesce(Column.from_rows(b)).filled(np.nan), np.where(np.isnan(a), b, a))


def test_readings_of_columns_and_of_rows_with_gaps_are_equal():
    rows = Readings.from_columns(P, sds=[1.0, np.nan, 3.0], directions=[[0, 0, -2], [np.nan] * 3, [0, 3, 0]])
    columns = Readings.from_columns(P, sds=rows.sds, directions=rows.directions)
    for name in ("points", "sds", "directions"):
        np.testing.assert_array_equal(getattr(columns, name).given, getattr(rows, name).given)
        np.testing.assert_array_equal(getattr(columns, name).values, getattr(rows, name).values)
