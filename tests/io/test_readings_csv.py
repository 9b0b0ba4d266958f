"""Readings files: what is read, what is refused and where, and that writing reads back."""

import os
from pathlib import Path

import numpy as np
import pytest

from tanteo.errors import InputError, ReadingsError, UnitError
from tanteo.geometry import SE3, SO3
from tanteo.io import pose_as_brand, read_readings, write_readings
from tanteo.sensors import Readings

DATA = Path(__file__).parents[3] / "shared" / "data"


def file(tmp_path, content, name="r.csv"):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


GOOD = "id,x_mm,y_mm,z_mm\na,1,2,3\nb,4,5,6\n"


@pytest.mark.parametrize(
    "content",
    [
        GOOD,
        GOOD.replace("\n", "\r\n"),
        GOOD.replace("\n", "\r"),
        "\ufeff" + GOOD,
        "# made by hand\n\n" + GOOD.replace("b,", "  # between\n\nb,") + "# end",
        'id,"x_mm", y_mm ,z_mm\n"a",1,"2",3\nb,4, 5 ,6',
        "z_mm,id,x_m,y_um\n3,a,0.001,2000\n6,b,.004,5e3\n",
        "id,x_in,y_mm,z_mm\na,0.03937007874015748,2,3\nb,0.15748031496062992,5,6\n",
        GOOD.replace("z_mm", "z_mm,sd_mm,feature").replace("3\n", "3,,\n").replace("6\n", "6,,\n"),
    ],
)
def test_one_table_in_many_spellings(tmp_path, content):
    r = read_readings(file(tmp_path, content))
    assert r.ids == ("a", "b")
    np.testing.assert_allclose(r.points, [[1e-3, 2e-3, 3e-3], [4e-3, 5e-3, 6e-3]], rtol=1e-14)
    assert not r.sds.given.any()
    assert r.kinds == ("point", "point")


def test_all_columns(tmp_path):
    r = read_readings(
        file(
            tmp_path,
            "id,x_mm,y_mm,z_mm,radius_mm,dx,dy,dz,nx,ny,nz,normal_sd_deg,sd_um,feature,kind,hand_x_mm,hand_y_mm,"
            "hand_z_mm,hand_qw,hand_qx,hand_qy,hand_qz,status,max_m,range_mm,sensor\n"
            "1,1,2,3,1.5,0,0,-2,0,0,1,18,300,A,vertex,10,20,30,0.7071068,0,0,0.7071068,ok,,7,eye\n"
            "2,1,2,3,,0,0,-2,,,,,,,,,,,,,,,none,0.5,,\n",
        )
    )
    assert (r.kinds, r.features, r.sensors) == (("vertex", "free"), ("A", ""), ("eye", ""))
    np.testing.assert_allclose(r.radii, [1.5e-3, 0])
    np.testing.assert_allclose(r.directions, [[0, 0, -1]] * 2)
    np.testing.assert_allclose(r.normal_sds.filled(np.nan), [np.pi / 10, np.nan])
    np.testing.assert_allclose(r.sds.filled(np.nan), [3e-4, np.nan])
    np.testing.assert_allclose(r.max_ranges.filled(np.nan), [np.nan, 0.5])
    np.testing.assert_allclose(r.ranges.filled(np.nan), [7e-3, np.nan])
    np.testing.assert_allclose(r.Ts_world_hand[0][:3], [[0, -1, 0, 0.01], [1, 0, 0, 0.02], [0, 0, 1, 0.03]], atol=1e-9)
    assert not r.Ts_world_hand.given[1]


@pytest.mark.parametrize("unit", ["deg", "rad"])
def test_the_hand_s_rotation_in_three_ways(tmp_path, unit):
    R = SO3.exp(np.random.default_rng(1).uniform(-1.8, 1.8, (20, 3)))
    angles = pose_as_brand("paper", SE3.from_parts(R, np.zeros(3)))[:, 3:]
    factor = {"deg": np.pi / 180, "rad": 1.0}[unit]
    ways = {
        ("hand_qw", "hand_qx", "hand_qy", "hand_qz"): SO3.as_quaternion(R),
        tuple(f"hand_r{axis}_{unit}" for axis in "xyz"): SO3.log(R) / factor,
        tuple(f"hand_{name}_{unit}" for name in ("roll", "pitch", "yaw")): angles / factor,
    }
    for names, values in ways.items():
        rows = ["1,2,3,10,20,30," + ",".join(map(repr, row)) for row in values.tolist()]
        head = "x_mm,y_mm,z_mm,hand_x_mm,hand_y_mm,hand_z_mm," + ",".join(names)
        # a row may have no hand
        r = read_readings(file(tmp_path, "\n".join([head, *rows, "1,2,3,,,," + "," * (len(names) - 1)])))
        np.testing.assert_allclose(r.Ts_world_hand[:-1][:, :3, :3], R, atol=1e-12)
        np.testing.assert_allclose(r.Ts_world_hand[:-1][:, :3, 3], [[0.01, 0.02, 0.03]] * 20)
        assert not r.Ts_world_hand.given[-1]


def test_roll_is_turned_first_and_yaw_last(tmp_path):
    head = "x_mm,y_mm,z_mm,hand_x_mm,hand_y_mm,hand_z_mm,hand_roll_deg,hand_pitch_deg,hand_yaw_deg\n"
    r = read_readings(file(tmp_path, head + "1,2,3,0,0,0,90,0,90\n1,2,3,0,0,0,0,90,90\n"))
    np.testing.assert_allclose(r.Ts_world_hand[0][:3, :3], [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-12)
    np.testing.assert_allclose(r.Ts_world_hand[1][:3, :3], [[0, -1, 0], [0, 0, 1], [-1, 0, 0]], atol=1e-12)


HEAD = "id,x_mm,y_mm,z_mm,dx,dy,dz,sd_mm\n"
FREE = "x_mm,y_mm,z_mm,dx,dy,dz,max_mm,status,kind,range_mm\n"
PLACE = "x_mm,y_mm,z_mm,hand_x_mm,hand_y_mm,hand_z_mm"
VECTOR = f"{PLACE},hand_rx_rad,hand_ry_rad,hand_rz_rad\n"
QUAT = "x_mm,y_mm,z_mm,hand_x_mm,hand_y_mm,hand_z_mm,hand_qw,hand_qx,hand_qy,hand_qz\n"


@pytest.mark.parametrize(
    ("content", "error", "message"),
    [
        ("", ReadingsError, "got an empty file"),
        ("# only a comment\n", ReadingsError, "got an empty file"),
        ("id,x_mm,y_mm,z_mm\n", ReadingsError, "expected at least one reading"),
        (b"PK\x03\x04\0\0\0", ReadingsError, "Save the sheet as CSV"),
        (b"\x7fELF\0\0\1\2\0", ReadingsError, "got a binary one"),
        ("1,2,3\n4,5,6\n", UnitError, "expected --units with a list of points (X Y Z ...), got none. Use --units mm."),
        ("1,2,a\n4,5,6\n", ReadingsError, "expected a header"),
        ("x_mm|y_mm z_mm\n1|2 3\n", ReadingsError, "expected commas"),
        ("x,y,z\n1,2,3\n", UnitError, "line 1, column 1: expected a unit in the name (x_mm, x_m, x_um, x_in), got 'x'"),
        ("x_cm,y_cm,z_cm\n1,2,3\n", UnitError, "expected one of the units x_mm, x_m, x_um, x_in, got 'x_cm'"),
        ("x_mm,y_mm,z_mm,normal_sd\n", UnitError, "normal_sd_deg, normal_sd_rad"),
        ("x_mm,y_mm,z_mm,x_m\n1,2,3,1\n", UnitError, "got it also as 'x_mm'"),
        ("x_mm,y_mm,z_mm,x_mm\n1,2,3,1\n", ReadingsError, "expected 'x' once"),
        ("x_mm,y_mm\n1,2\n", ReadingsError, "got only x_mm, y_mm. Add z"),
        ("x_mm,y_mm,z_mm,dx\n1,2,3,1\n", ReadingsError, "expected dx, dy, dz together"),
        ("x_mm,y_mm,z_mm,hand_x_mm\n1,2,3,1\n", ReadingsError, "Add hand_y, hand_z, hand_qw"),
        ("id,sd_mm\n1,2\n", ReadingsError, "Add where the points are"),
        ("x_mm,y_mm,z_mm,featur\n1,2,3,A\n", ReadingsError, "Did you mean 'feature'"),
        ("x_mm,y_mm,z_mm,nomral_sd_deg\n1,2,3,A\n", ReadingsError, "Did you mean 'normal_sd_deg'"),
        ("x_mm,y_mm,\n1,2,\n", ReadingsError, "column 3: expected a name, got nothing"),
        (GOOD + "c,1,2,3x\n", ReadingsError, "line 4, column 'z_mm': expected a finite number, got '3x'"),
        (GOOD + "\n# c\nc,1,2,nan\n", ReadingsError, "line 6, column 'z_mm': expected a finite number, got 'nan'"),
        (GOOD + "c,1,inf,3\n", ReadingsError, "column 'y_mm': expected a finite number, got 'inf'"),
        (GOOD + "c,1,1e999,3\n", ReadingsError, "got '1e999'"),
        (GOOD + "c,1_0,2,3\n", ReadingsError, "got '1_0'"),
        (GOOD + "c,١,2,3\n", ReadingsError, "got '١'"),
        (GOOD + "c,1,2cm,3\n", ReadingsError, "got '2cm'"),
        (GOOD + "c,1,,3\n", ReadingsError, "line 4, column 'y_mm': expected all of x, y, z or none, got an empty cell"),
        (GOOD + "c,,,\n", ReadingsError, "reading 'c': expected a point"),
        (GOOD + "c,1,2\n", ReadingsError, "line 4: expected 4 cells as in the header, got 3 ('c,1,2')"),
        (GOOD + "c,1,5,2,5,3\n", ReadingsError, "Mind decimal commas"),
        (GOOD + ",,,\n,,,\n", ReadingsError, "line 4, column 'id': expected a name in every row"),
        (GOOD + "a,1,2,3\n", ReadingsError, "line 4, column 'id': expected every reading to have its own, got 'a'"),
        (GOOD + ",1,2,3\n", ReadingsError, "line 4, column 'id': expected a name"),
        (GOOD + 'c,1,2,"3\n', ReadingsError, "line 4: expected comma-separated cells, got a quotation mark"),
        (GOOD + 'c,1,2,"3"4\n', ReadingsError, "line 4: expected comma-separated cells"),
        (GOOD + "c,1,2," + "9" * 140_000 + "\n", ReadingsError, "field larger than field limit"),
        (GOOD.replace("_mm", "_m") + "c,381,2,3\n", ReadingsError, "line 4, column 'x_m': expected within 100 m"),
        (HEAD + "a,1,2,3,0,0,0,1\n", ReadingsError, "line 2, column 'dx': expected a direction that is not zero"),
        (HEAD + "a,1,2,3,0,0,-1e-200,1\n", ReadingsError, "column 'dz': expected a direction that is"),
        (HEAD + "a,1,2,3,0,-1e200,1,1\n", ReadingsError, "column 'dy': expected components of a direction, up"),
        (HEAD + "a,1,2,3,1,0,0,-0.3\n", ReadingsError, "column 'sd_mm': expected a positive number, got '-0.3'"),
        (HEAD + "a,1,2,3,1,0,0,0\n", ReadingsError, "column 'sd_mm': expected a positive number, got '0'"),
        (HEAD + "a,1,2,3,1,,0,1\n", ReadingsError, "column 'dy': expected all of dx, dy, dz or none"),
        ("x_mm,y_mm,z_mm,radius_mm\n1,2,3,-1\n", ReadingsError, "column 'radius_mm': expected zero or more, got '-1'"),
        ("x_mm,y_mm,z_mm,radius_mm\n1,2,3,1001\n", ReadingsError, "column 'radius_mm': expected 1 m or less"),
        (FREE + "1,2,3,0,0,1,9,none,,5\n", ReadingsError, "line 2: expected no range of a beam with status none"),
        (FREE + "1,2,3,0,0,1,9,none,edge,\n", ReadingsError, "line 2: expected kind free of a beam with status none"),
        (FREE + "1,2,3,0,0,1,9,ok,free,\n", ReadingsError, "line 2: expected status none of a beam of kind free"),
        (QUAT + "1,2,3,0,0,0,1,1,0,0\n", ReadingsError, "a unit quaternion hand_qw .. hand_qz, got 'length 1.41"),
        (QUAT + "1,2,3,0,0,0,0,0,0,0\n", ReadingsError, "got 'length 0'"),
        ("x_mm,y_mm,z_mm,hand_x_mm\n1,2,3,1\n", ReadingsError, "hand_rx_rad .. hand_rz_rad (a rotation vector) or"),
        (f"{PLACE},hand_rx_rad\n1,2,3,0,0,0,0\n", ReadingsError, "Add hand_ry, hand_rz (with unit"),
        (f"{PLACE},hand_rx\n1,2,3,0,0,0,0\n", UnitError, "expected a unit in the name (hand_rx_deg, hand_rx_rad)"),
        (f"{PLACE},hand_rx_mm\n1,2,3,0,0,0,0\n", UnitError, "expected one of the units hand_rx_deg, hand_rx_rad"),
        ("x_mm,y_mm,z_mm,hand_yaw_deg\n1,2,3,0\n", ReadingsError, "Add hand_x, hand_y, hand_z, hand_roll, hand_pitch"),
        (f"{PLACE},hand_rx_rad,hand_qw\n1,2,3,0,0,0,0,1\n", ReadingsError, "in one way, got hand_qw, hand_rx_rad. K"),
        (f"{PLACE},hand_rx_rad,hand_yaw_deg\n1,2,3,0,0,0,0,1\n", ReadingsError, "one way, got hand_rx_rad, hand_yaw"),
        (VECTOR + "1,2,3,0,0,0,0,0,\n", ReadingsError, "column 'hand_rz_rad': expected all of hand_x, hand_y"),
        (VECTOR + "1,2,3,0,0,0,0,0,6.3\n1,2,3,0,0,0,0,-92.3,0\n", UnitError, "line 3, hand_ry_rad of reading '2': "
         "-92.3 rad is more than a full turn: are these degrees? Name the column hand_ry_deg."),
        ("id," + VECTOR + "a,1,2,3,,,,,,\nb,1,2,3,0,0,0,92.3,0,0\n", UnitError, "hand_rx_rad of reading 'b': 92.3 rad"),
        ("x_mm,y_mm,z_mm,nx,ny,nz,normal_sd_rad\n1,2,3,0,0,1,18\n", UnitError, "Name the column normal_sd_deg."),
        ("x_mm,y_mm,z_mm,kind\n1,2,3,plan\n", ReadingsError, "column 'kind': expected one of plane, edge"),
        ("x_mm,y_mm,z_mm,kind\n1,2,3,plane\n", ReadingsError, "expected a label for kind 'plane'"),
        ("x_mm,y_mm,z_mm,kind,feature\n1,2,3,plane,A\n2,3,4,edge,A\n", ReadingsError, "expected 'plane' as for"),
        ("x_mm,y_mm,z_mm,kind,feature\n1,2,3,edge,A\n", ReadingsError, "at least 2 readings"),
        ("x_mm,y_mm,z_mm,status\n1,2,3,off\n", ReadingsError, "expected one of ok, none, invalid, got 'off'"),
        ("x_mm,y_mm,z_mm,status\n1,2,3,none\n", ReadingsError, "free reading '1': expected where the beam was"),
        ("range_mm,sensor\n100,eye\n", ReadingsError, "Add where the points are"),
        (100_000 * "x_mm," + "\n1\n", ReadingsError, "expected up to 10000 columns, got 10000"),
    ],
)  # fmt: skip
def test_refusals(tmp_path, content, error, message):
    path = file(tmp_path, content)
    with pytest.raises(InputError) as caught:
        read_readings(path)
    assert type(caught.value) is error
    assert str(caught.value).startswith(str(path))
    assert message in str(caught.value)


def test_a_message_quotes_only_the_beginning_of_a_long_cell(tmp_path):
    path = file(tmp_path, f"x_mm,y_mm,z_mm\n0,0,{'9' * 5000}\n")
    with pytest.raises(ReadingsError, match="expected a finite number, got '9999") as caught:
        read_readings(path)
    assert len(str(caught.value)) < len(str(path)) + 200


@pytest.mark.parametrize(
    ("name", "message"), [("missing.csv", "No such file"), (".", "directory"), ("x" * 300, "too long")]
)
def test_paths_that_cannot_be_read(tmp_path, name, message):
    with pytest.raises(ReadingsError) as caught:
        read_readings(tmp_path / name)
    assert message in str(caught.value)


def test_pipes_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", "-"):
        with pytest.raises(ReadingsError, match="got a pipe or device"):
            read_readings(path)


def test_the_line_is_right_in_a_later_chunk(tmp_path, monkeypatch):
    monkeypatch.setattr("tanteo.io.readings.readings_csv.CHUNK", 10)
    rows = [f"r{i},{i},2,3" for i in range(57)]
    rows[43] = "r43,oops,2,3"
    path = file(tmp_path, "# one\nid,x_mm,y_mm,z_mm\n" + "\n".join(rows))
    with pytest.raises(ReadingsError, match="line 46, column 'x_mm'"):
        read_readings(path)
    rows[43] = "r1,4,2,3"
    with pytest.raises(ReadingsError, match=r"line 46, column 'id': .* got 'r1'"):
        read_readings(file(tmp_path, "# one\nid,x_mm,y_mm,z_mm\n" + "\n".join(rows)))
    seen = []
    rows[43] = "r43,4,2,3"
    assert len(read_readings(file(tmp_path, "id,x_mm,y_mm,z_mm\n" + "\n".join(rows)), progress=seen.append)) == 57
    assert seen == [10, 20, 30, 40, 50, 57]


@pytest.mark.slow
def test_a_million_rows(tmp_path):
    line = "{},1.5,-2.25,1e2,0.3\n"
    path = file(tmp_path, "id,x_mm,y_mm,z_mm,sd_mm\n" + "".join(line.format(i) for i in range(1_000_000)))
    r = read_readings(path)
    assert len(r) == 1_000_000
    np.testing.assert_allclose(r.points[-1], [1.5e-3, -2.25e-3, 0.1], rtol=1e-15)


@pytest.mark.parametrize("unit", ["mm", "m", "um", "in"])
def test_writing_reads_back(tmp_path, unit):
    rng = np.random.default_rng(0)
    n = 8
    free = np.arange(n) == 5
    r = Readings.from_columns(
        rng.normal(size=(n, 3)),
        ids=["#1", 'q"uote', "comma,", "ä", "x", "y", "z", "w"],
        directions=rng.normal(size=(n, 3)),
        normals=rng.normal(size=(n, 3)),
        normal_sds=rng.uniform(0.01, 0.1, n),
        sds=np.where(np.arange(n) % 2, np.nan, 1e-4),
        across_sds=np.where(np.arange(n) % 3, np.nan, 3e-4),
        radii=rng.uniform(0, 1e-3, n),
        features=["A", "A", "A", "", "", "B", "B", "B"],
        kinds=["plane"] * 3 + ["point"] * 2 + ["edge"] * 3,
        Ts_world_hand=SE3.exp(rng.normal(size=(n, 6))),
        ranges=np.where(free, np.nan, rng.uniform(0.1, 1, n)),
        sensors=["eye"] * n,
        is_free=free,
        max_ranges=np.where(free, 1.2, np.nan),
    )
    path = tmp_path / "out.csv"
    write_readings(r, path, unit=unit)
    back = read_readings(path)
    assert (back.ids, back.features, back.kinds, back.sensors) == (r.ids, r.features, r.kinds, r.sensors)
    np.testing.assert_array_equal(back.is_free, r.is_free)
    for name in (
        "points",
        "directions",
        "normals",
        "normal_sds",
        "sds",
        "across_sds",
        "Ts_world_hand",
        "ranges",
        "max_ranges",
    ):
        read, written = getattr(back, name), getattr(r, name)
        np.testing.assert_array_equal(read.given, written.given)
        np.testing.assert_allclose(read.values, written.values, rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(back.radii, r.radii, rtol=1e-14, atol=1e-14)


def test_writing_refuses_unknown_units(tmp_path):
    r = Readings.from_columns(np.zeros((1, 3)))
    with pytest.raises(UnitError, match="expected a unit of mm, m, um, in, got 'cm'"):
        write_readings(r, tmp_path / "o.csv", unit="cm")


@pytest.mark.skipif(not DATA.exists(), reason=f"no real data at {DATA}")
@pytest.mark.parametrize(("name", "n"), [("novice", 15), ("expert", 20)])
def test_real_touches(name, n):
    """The tip's offset in the hand's frame, stated in the file, is where the ball centres are."""
    r = read_readings(DATA / "fixture_touches" / f"{name}.csv")
    assert len(r) == n
    tip = SE3.apply(SE3.inverse(r.Ts_world_hand[:]), r.points[:])
    np.testing.assert_allclose(tip, np.tile([-0.623e-3, -0.398e-3, 49.169e-3], (n, 1)), atol=2e-6)
    assert (r.radii == 1.5e-3).all()
