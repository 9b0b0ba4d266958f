"""Prior knowledge of a pose, typed or in a file: it becomes a prior, and invalid text is refused."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.errors import InputError, TanteoError
from tanteo.geometry import ROS, SE3
from tanteo.geometry.named import name_covariance
from tanteo.io import pose_as_brand, read_prior
from tanteo.io.poses import parse_box, parse_pose_prior, parse_table


def read(tmp_path, text):
    path = tmp_path / "prior.toml"
    path.write_text(text, encoding="utf-8")
    return read_prior(path)


@pytest.mark.parametrize("text", ["-5+-1mm", "-5mm +- 1mm", "-0.5e1mm ± 1000um", "-5 +/- 1 mm"])
def test_tables(text):
    table = parse_table(text)
    np.testing.assert_allclose(table.point, [0, 0, -5e-3])
    np.testing.assert_array_equal(table.normal, [0, 0, 1])
    assert table.sd == pytest.approx(1e-3)


def test_boxes():
    np.testing.assert_allclose(parse_box("0,-100,0, 500,400,200mm"), [[0, -0.1, 0], [0.5, 0.4, 0.2]])


@pytest.mark.parametrize(
    "text",
    [
        "400,200,-10mm 10,20,90deg +- 5mm 3deg",
        "400, 200, -10 mm, 10, 20, 90 deg ± 5 mm, 3 deg",
        "0.4m 0.2m -0.01m 10deg 20deg 90deg+-5,5,5mm 3,3,3deg",
        "fanuc 400,200,-10,10,20,90 +- 5mm 3deg",
        "kuka: 400 200 -10 90 20 10 +- 5000um,3deg",
        "paper 0.4,0.2,-0.01,0.17453292519943295,0.3490658503988659,1.5707963267948966 +- 5mm 3deg",
    ],
)
def test_prior_poses(text):
    near = parse_pose_prior(text)
    np.testing.assert_allclose(pose_as_brand("fanuc", near.T), [400, 200, -10, 10, 20, 90], atol=1e-9)
    np.testing.assert_allclose(near.C, np.diag(np.r_[np.full(3, 5e-3), np.full(3, np.radians(3))] ** 2), atol=1e-12)


def test_three_sds_are_along_and_about_axes_of_world():
    """A part that lies on its side, known well in the world's height and badly about the world's vertical."""
    near = parse_pose_prior("400,200,0mm 90,0,0deg +- 5,5,1mm 1,1,10deg")
    world = name_covariance(near, ROS).covariance
    np.testing.assert_allclose(np.sqrt(np.diag(world)), [5e-3, 5e-3, 1e-3, *np.radians([1, 1, 10])])
    # turned by 90 degrees about x, the part's y is the world's z
    np.testing.assert_allclose(np.sqrt(np.diag(near.C)), [5e-3, 1e-3, 5e-3, *np.radians([1, 10, 1])])


@pytest.mark.parametrize(
    ("parse", "text", "message"),
    [
        (parse_table, "0mm", "expected a value and its standard deviation such as 0+-1mm"),
        (parse_table, "", "expected a value and its standard deviation"),
        (parse_table, "0+-", "expected a value and its standard deviation"),
        (parse_table, "0+-1+-2mm", "expected a value and its standard deviation"),
        (parse_table, "0+-1", "expected a unit"),
        (parse_table, "0+-0mm", "a positive sd"),
        (parse_table, "0+--1mm", "a positive sd"),
        (parse_table, "0,1+-1mm", "expected one height"),
        (parse_table, "0+-1deg", "expected a unit of mm"),
        (parse_table, "low+-1mm", "expected a number"),
        (parse_box, "0,0,0mm", "expected six lengths"),
        (parse_box, "0,0,0,1,1,0mm", "expected six lengths, the lowest x, y, z and then the highest"),
        (parse_box, "0,0,0,1,1,1", "expected a unit"),
        (parse_pose_prior, "1,2,3mm 0,0,90deg", "expected a value and its standard deviation"),
        (parse_pose_prior, "1,2mm 0,0,90deg +- 5mm 3deg", "got 2 lengths and 3 angles"),
        (parse_pose_prior, "1,2,3mm +- 5mm 3deg", "got 3 lengths and 0 angles"),
        (parse_pose_prior, "1,2,3mm 0,0,90 +- 5mm 3deg", "expected a unit behind the numbers"),
        (parse_pose_prior, "0,0,90deg 1,2,3mm +- 5mm 3deg", "expected lengths before angles"),
        (parse_pose_prior, "1,2,3mm 0,0,90deg +- 5mm", "one length or three and one angle or three"),
        (parse_pose_prior, "1,2,3mm 0,0,90deg +- 5,5mm 3deg", "got 2 and 1"),
        (parse_pose_prior, "1,2,3mm 0,0,90deg +- 0mm 3deg", "of the world), got 0 mm and 3 deg. Write"),
        (parse_pose_prior, "1,2,3mm 0,0,90deg +- 5mm -3deg", "of the world), got 5 mm and -3 deg. Write"),
        (
            parse_pose_prior,
            "1;2;3mm 0;0;90deg +- 5mm 3deg",
            "--known: expected commas between the numbers, got '1;2;3mm",
        ),
        (parse_pose_prior, "ros 1,2,3,0,0,0,2 +- 5mm 3deg", "--known: quaternion: expected a length of 1"),
        (parse_pose_prior, "1,2,3mm 0,0,90deg +- 5mm 90deg", "known to 60 degrees"),
        (parse_pose_prior, "1,2,3mm 0,0,90deg +- 5mm 3grad", "Did you mean 'rad'"),
        (parse_pose_prior, "kuka 1,2,3 +- 5mm 3deg", "expected 6 finite numbers (X Y Z A B C)"),
        (parse_pose_prior, "kuka 1,2,3,a,5,6 +- 5mm 3deg", "expected plain numbers behind 'kuka'"),
        (parse_pose_prior, "kuka 1mm,2,3,4,5,6 +- 5mm 3deg", "expected plain numbers behind 'kuka'"),
        (parse_pose_prior, "ur 420,0,0,0,0,0 +- 5mm 3deg", "'420,0,0,0,0,0', which ur writes in metres"),
        (parse_pose_prior, "kukka 1,2,3,4,5,6 +- 5mm 3deg", "Did you mean 'kuka'"),
        (parse_pose_prior, "1,2,3mm 0,0,1e999deg +- 5mm 3deg", "expected a finite number"),
    ],
)
def test_typed_refusals(parse, text, message):
    with pytest.raises(InputError) as caught:
        parse(text, "--known")
    assert message in str(caught.value)
    assert "expected" in str(caught.value)


WHOLE = """
[table]
top_mm = -2
sd_mm = 0.5
[box]
low_mm = [0, 0, 0]
high_in = [10, 10, 4]
[pose_prior]
kuka = [400, 200, 0, 90, 0, 0]
sd_mm = [5, 5, 1]
turn_sd_deg = 3
"""


def test_all_of_a_file(tmp_path):
    prior = read(tmp_path, WHOLE)
    np.testing.assert_allclose(prior.table.point, [0, 0, -2e-3])
    assert prior.table.sd == pytest.approx(5e-4)
    np.testing.assert_allclose(prior.box, [[0, 0, 0], [0.254, 0.254, 0.1016]])
    near = parse_pose_prior("400,200,0mm 0,0,90deg +- 5,5,1mm 3deg")
    np.testing.assert_allclose(prior.T_world_part, near.T, atol=1e-15)
    np.testing.assert_allclose(prior.covariance, near.C, atol=1e-15)


def test_a_table_may_be_inclined(tmp_path):
    prior = read(tmp_path, "[table]\npoint_mm = [1, 2, 3]\nnormal = [0, 3, 4]\nsd_um = 100\n")
    np.testing.assert_allclose(prior.table.normal, [0, 0.6, 0.8])
    np.testing.assert_allclose(prior.table.point, [1e-3, 2e-3, 3e-3])
    assert prior.T_world_part is None
    assert prior.box is None


@pytest.mark.parametrize("rows", [True, False])
def test_covariances_by_two_conventions(tmp_path, rows):
    rng = np.random.default_rng(1)
    A = rng.normal(size=(6, 6)) * np.r_[np.full(3, 1e-2), np.full(3, 0.1)][:, None]
    near = parse_pose_prior("400,200,0mm 10,20,30deg +- 5mm 3deg")
    head = f"[pose_prior]\nposition_mm = [400, 200, 0]\nquaternion_wxyz = {quaternion(near.T)}\n"
    C = A @ A.T
    for key in ("covariance_m_rad", "ros_covariance_m_rad"):
        numbers = C.tolist() if rows else C.ravel().tolist()
        prior = read(tmp_path, f"{head}{key} = {numbers}\n")
        R = np.kron(np.eye(2), near.T[:3, :3])
        expected = C if key == "covariance_m_rad" else R.T @ C @ R
        np.testing.assert_allclose(prior.T_world_part, near.T, atol=1e-9)
        np.testing.assert_allclose(prior.covariance, expected, rtol=1e-6, atol=1e-12)


def quaternion(T):
    x, y, z, w = pose_as_brand("ros", T)[3:]
    return [w.item(), x.item(), y.item(), z.item()]


NEAR = "[pose_prior]\nposition_mm = [1, 2, 3]\nturn_deg = [0, 0, 90]\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "got an empty file"),
        ("tabel = 1\n", "expected one of table, rests, box, pose_prior, got 'tabel'"),
        ("table = 0\n", "prior.toml, table: expected a table"),
        ("[table]\nsd_mm = 1\n", "expected top_mm or point_mm with normal"),
        ("[table]\ntop_mm = 1\npoint_mm = [1, 2, 3]\nsd_mm = 1\n", "got both"),
        ("[table]\ntop_mm = 1\n", "expected 'sd_mm', got nothing"),
        ("[table]\ntop_mm = 1\nsd_mm = 0\n", "table, sd_mm: expected a positive length"),
        ("[table]\ntop = 1\nsd_mm = 1\n", "Write the unit in the name"),
        ("[box]\nlow_mm = [0, 0, 0]\n", "expected 'high_mm'"),
        ("[box]\nlow_mm = [0, 0, 0]\nhigh_mm = [1, 1, -1]\n", "expected low below high"),
        (NEAR, "expected the uncertainty once"),
        (NEAR + "sd_mm = 1\n", "expected 'turn_sd_deg'"),
        (NEAR + "turn_sd_deg = 1\n", "expected 'sd_mm'"),
        (
            NEAR + "sd_mm = [1, 2]\nturn_sd_deg = 1\n",
            "pose_prior, sd_mm: expected one positive number or three, got [1, 2]",
        ),
        (NEAR + "sd_mm = 0\nturn_sd_deg = 1\n", "pose_prior, sd_mm: expected one positive number or three, got 0"),
        (
            NEAR + "sd_mm = 1\nturn_sd_deg = [1, -2, 1]\n",
            "pose_prior, turn_sd_deg: expected one positive number or three, got",
        ),
        (
            "[table]\ntop_mm = 1\nsd_mm = 1\nnormal = [0, 0, 0]\n",
            "table, normal: expected a direction that is not zero, got [0, 0, 0]",
        ),
        (
            "[pose_prior]\nros = [1, 2, 3, 0, 0, 0, 2]\nsd_mm = 1\nturn_sd_deg = 1\n",
            "pose_prior, ros: quaternion: expected",
        ),
        (NEAR + "sd_mm = 1\nturn_sd = 1\n", "expected one of turn_sd_deg, turn_sd_rad"),
        (NEAR + "covariance_m_rad = [1, 2]\n", "expected 6 x 6 numbers, got 2"),
        (NEAR + f"covariance_m_rad = {np.zeros((6, 6)).tolist()}\n", "expected a positive variance"),
        (NEAR + f"covariance_m_rad = {(-np.eye(6)).tolist()}\n", "pose_prior, covariance_m_rad"),
        (NEAR + f"ros_covariance_m_rad = {np.eye(6).tolist()}\nturn_sd_deg = 3\n", "got sd_mm and turn_sd_deg and ros"),
        (NEAR + "kuka = [1, 2, 3, 4, 5, 6]\nsd_mm = 1\nturn_sd_deg = 1\n", "expected one pose"),
        ("[pose_prior]\nsd_mm = 1\nturn_sd_deg = 1\n", "expected one pose"),
        ("[pose_prior]\nposition_mm = [1, 2, 3]\nsd_mm = 1\nturn_sd_deg = 1\n", "expected a position and an attitude"),
        ("[pose_prior]\nkuka = [1, 2, 3]\nsd_mm = 1\nturn_sd_deg = 1\n", "kuka: expected 6 numbers, got 3"),
        ("[pose_prior]\nkuca = [1, 2, 3]\nsd_mm = 1\nturn_sd_deg = 1\n", "Did you mean 'kuka'"),
    ],
)
def test_refusals_of_files(tmp_path, text, message):
    with pytest.raises(TanteoError) as caught:
        read(tmp_path, text)
    assert str(caught.value).startswith(str(tmp_path / "prior.toml"))
    assert message in str(caught.value)


def test_a_prior_pose_is_at_its_stated_place(tmp_path):
    prior = read(tmp_path, NEAR + "sd_mm = 1\nturn_sd_deg = 1\n")
    np.testing.assert_allclose(SE3.apply(prior.T_world_part, np.array([1.0, 0, 0])), [0.001, 1.002, 0.003], atol=1e-12)
