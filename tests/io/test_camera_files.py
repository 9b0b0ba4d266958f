"""Calibration files of OpenCV and ROS, marks, images: what they say, and what is refused."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.io import read_camera, read_image, read_marks, write_image
from tanteo.vision.camera import USUAL_EDGE_SD

WRITE_IT = "Write distortion_coefficients: [k1, k2, p1, p2, k3]"
"""What each refusal of a distortion advises."""

OPENCV_YAML = """%YAML:1.0
---
calibration_time: "Mon 02 Mar 2026"
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 6.2e+02, 0., 317., 0., 615., 243., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.12, 0.05, 4.e-4, -3.e-4, 0. ]
avg_reprojection_error: 0.21
"""
ROS_YAML = """image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [620.0, 0.0, 317.0, 0.0, 615.0, 243.0, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.12, 0.05, 0.0004, -0.0003, 0.0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
projection_matrix:
  rows: 3
  cols: 4
  data: [620.0, 0.0, 317.0, 0.0, 0.0, 615.0, 243.0, 0.0, 0.0, 0.0, 1.0, 0.0]
"""
KALIBR = """cam0:
  T_cam_imu:
  - [0.0, 1.0, 0.0, 0.07]
  - [-1.0, 0.0, 0.0, -0.02]
  - [0.0, 0.0, 1.0, 0.004]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: []
  camera_model: pinhole
  distortion_coeffs: [-0.12, 0.05, 0.0004, -0.0003]
  distortion_model: radtan
  intrinsics: [620.0, 615.0, 317.0, 243.0]
  resolution: [640, 480]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: 0.08
"""
EUROC = """# General sensor definitions.
sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: [0.0, -1.0, 0.0, -0.02, 1.0, 0.0, 0.0, -0.06, 0.0, 0.0, 1.0, 0.01, 0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [640, 480]
camera_model: pinhole
intrinsics: [620.0, 615.0, 317.0, 243.0] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.12, 0.05, 0.0004, -0.0003]
"""
FOUR = """image_width: 640
image_height: 480
intrinsics: {fx: 620.0, fy: 615.0, cx: 317.0, cy: 243.0}
distortion: [-0.12, 0.05, 0.0004, -0.0003, 0]
"""
OPENCV_XML = """<?xml version="1.0"?>
<opencv_storage>
<!-- a comment -->
<calibration_Time>"Mon Mar 2 2026"</calibration_Time>
<image_Width>640</image_Width>
<image_Height>480</image_Height>
<Camera_Matrix type_id="opencv-matrix">
  <rows>3</rows><cols>3</cols><dt>d</dt>
  <data>
    6.2e+02 0. 317. 0. 615. 243. 0. 0. 1.</data></Camera_Matrix>
<Distortion_Coefficients type_id="opencv-matrix">
  <rows>5</rows><cols>1</cols><dt>d</dt>
  <data>
    -0.12 0.05 4.e-4 -3.e-4 0.</data></Distortion_Coefficients>
</opencv_storage>
"""
ROS_INI = """# Camera intrinsics

[image]

width
640

height
480

[narrow_stereo/left]

camera matrix
620.0 0.0 317.0
0.0 615.0 243.0
0.0 0.0 1.0

distortion
-0.12 0.05 0.0004 -0.0003 0.0

rectification
1 0 0
0 1 0
0 0 1

projection
500.0 0.0 320.0 0.0
0.0 500.0 240.0 0.0
0.0 0.0 1.0 0.0
"""
BINNED = """height: 980
width: 1300
distortion_model: plumb_bob
d: [-0.12, 0.05, 0.0004, -0.0003, 0.0]
k: [1240.0, 0.0, 644.0, 0.0, 1230.0, 492.0, 0.0, 0.0, 1.0]
binning_x: 2
binning_y: 2
roi: {x_offset: 10, y_offset: 6, height: 960, width: 1280, do_rectify: false}
"""
NO_LENS = """image_width: 640
image_height: 480
camera_matrix: [[620.0, 0.0, 317.0], [0.0, 615.0, 243.0], [0.0, 0.0, 1.0]]
"""
UNIT = "[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]"
ROS_MESSAGE = """header:
  frame_id: camera
height: 480
width: 640
distortion_model: plumb_bob
d: [-0.12, 0.05, 0.0004, -0.0003, 0.0]
k: [620.0, 0.0, 317.0, 0.0, 615.0, 243.0, 0.0, 0.0, 1.0]
r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
p: [620.0, 0.0, 317.0, 0.0, 0.0, 615.0, 243.0, 0.0, 0.0, 0.0, 1.0, 0.0]
"""
OPENCV_JSON = json.dumps(
    {
        "image_size": [640, 480],
        "cameraMatrix": {
            "type_id": "opencv-matrix", "rows": 3, "cols": 3, "dt": "d",
            "data": [620.0, 0, 317.0, 0, 615.0, 243.0, 0, 0, 1],
        },
        "distCoeffs": [[-0.12, 0.05, 0.0004, -0.0003, 0.0, 0, 0, 0, 0, 0, 0, 0]],
    }
)  # fmt: skip


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("opencv.yaml", OPENCV_YAML),
        ("ros.yaml", ROS_YAML),
        ("message.yaml", ROS_MESSAGE),
        ("opencv.json", OPENCV_JSON),
        ("camchain.yaml", KALIBR),
        ("sensor.yaml", EUROC),
        ("four.yaml", FOUR),
        ("camera.xml", OPENCV_XML),
        ("left.ini", ROS_INI),
        ("binned.yaml", BINNED),
    ],
)
def test_every_format_gives_the_same_camera(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    camera = read_camera(path)
    assert camera.K.tolist() == [[620, 0, 317], [0, 615, 243], [0, 0, 1]]
    assert camera.size == (640, 480)
    assert camera.distortion[:4] == pytest.approx([-0.12, 0.05, 4e-4, -3e-4])
    assert not camera.distortion[4:].any()
    assert camera.T_world_camera is None


def written(tmp_path, text):
    path = tmp_path / "camera.txt"
    path.write_text(text, encoding="utf-8")
    return path


def test_no_distortion_is_none(tmp_path):
    none = "distortion_model: none\n"
    for lens in ("", "distortion_coefficients: {rows: 1, cols: 0, data: []}\n", "D: [0, 0, 0, 0, 0]\n"):
        assert not len(read_camera(written(tmp_path, NO_LENS + none + lens)).distortion)


def test_a_small_skew_counts_as_noise(tmp_path):
    camera = read_camera(written(tmp_path, ROS_YAML.replace("620.0, 0.0, 317", "620.0, -0.9, 317", 1)))
    assert camera.K[0, 1] == 0
    v = np.linspace(0, 480, 1001)
    moved = -0.9 * (v - 243) / 615
    assert camera.edge_sd == pytest.approx(np.hypot(USUAL_EDGE_SD, moved.std()), rel=0.01)
    assert "skew" in camera.notes[0]
    assert read_camera(written(tmp_path, ROS_YAML)).notes == ()


def test_a_rectified_image_has_the_projection(tmp_path):
    """The pixel of a point is that of the matrices of the file; a stereo base line moves the frame, not the rays."""
    turn = SO3.exp(np.array([0.02, -0.03, 0.01]))
    rows = ", ".join(f"{v:.12f}" for v in turn.ravel())
    text = ROS_YAML.replace("1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\nprojection", f"{rows}]\nprojection")
    text = text.replace("[620.0, 0.0, 317.0, 0.0, 0.0, 615", "[500.0, 0.0, 320.0, -60.0, 0.0, 505")
    camera = read_camera(written(tmp_path, text + f"T_world_camera: {UNIT}\n"), rectified=True)
    assert camera.K.tolist() == [[500, 0, 320], [0, 505, 243], [0, 0, 1]]
    assert not len(camera.distortion)
    np.testing.assert_allclose(camera.T_world_camera[:3, :3], turn.T, atol=1e-9)
    fisheye = read_camera(written(tmp_path, text.replace("plumb_bob", "equidistant")), rectified=True)
    assert fisheye.K.tolist() == camera.K.tolist()
    ini = read_camera(written(tmp_path, ROS_INI), rectified=True)
    assert ini.K.tolist() == [[500, 0, 320], [0, 500, 240], [0, 0, 1]]


def test_rectified_without_a_projection_is_reported(tmp_path):
    camera = read_camera(written(tmp_path, NO_LENS), rectified=True)
    assert camera.K[0].tolist() == [620, 0, 317]
    assert "no projection_matrix" in camera.notes[0]


def test_a_file_without_size_takes_that_of_the_image(tmp_path):
    path = written(tmp_path, FOUR.split("\n", 2)[2])
    camera = read_camera(path, shape=(480, 640))
    assert camera.size == (640, 480)
    assert "640 x 480 pixels, as the image" in camera.notes[0]
    with pytest.raises(InputError, match="image_width"):
        read_camera(path)


def test_other_keys_of_stereo_files_are_not_read(tmp_path):
    """``R`` and ``P`` may be anything where the image is not rectified."""
    assert read_camera(written(tmp_path, ROS_YAML + "R: [1, 2]\nP: there\n")).size == (640, 480)


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
def test_what_opencv_writes_is_read(tmp_path, suffix):
    path = tmp_path / f"camera.{suffix}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    K, k = np.array([[700.5, 0, 320.25], [0, 701.5, 239.75], [0, 0, 1]]), np.array([[0.1, -0.2, 1e-3, 2e-3, 0.05]])
    storage.write("image_width", 1280)
    storage.write("image_height", 720)
    storage.write("camera_matrix", K)
    storage.write("distortion_coefficients", k)
    storage.release()
    camera = read_camera(path)
    assert pytest.approx(K) == camera.K
    assert camera.distortion == pytest.approx(k.ravel())
    assert camera.size == (1280, 720)


LENS = (-0.12, 0.05, 4e-4, -3e-4, 0.01)


@pytest.mark.parametrize(
    "line",
    [
        *(
            f"{key}: {list(LENS)}"
            for key in (
                "dist_coeff",
                "dist",
                "distortion",
                "distortion_coeffs",
                "dist_coef",
                "DistCoeffs",
                "dist_coefs",
            )
        ),
        "dist: [[-0.12, 0.05, 4.0e-4, -3.0e-4, 0.01]]",
        "Distortion Coefficients: [[-0.12], [0.05], [4.0e-4], [-3.0e-4], [0.01]]",
        "distortion_parameters: {k1: -0.12, k2: 0.05, k3: 0.01, p1: 4.0e-4, p2: -3.0e-4}",
        "k1: -0.12\nk2: 0.05\nk3: 0.01\np1: 4.0e-4\np2: -3.0e-4",
        f"D: {list(LENS)}\ndist: {[*LENS, 0, 0, 0]}",  # twice the same
        f"dist: {list(LENS)}\nundistorted_camera_matrix: [1, 2]\nfocus_distance_mm: 300\nundistorted: false",
        f"dist: {list(LENS)}\nrvecs: [[1, 2, 3]]\ntvecs: [[1, 2, 3]]\nextrinsic_parameters: [1, 2, 3, 4, 5, 6]",
    ],
)
def test_the_distortion_has_many_names(tmp_path, line):
    path = tmp_path / "camera.yaml"
    path.write_text(f"{NO_LENS}{line}\n")
    camera = read_camera(path)
    assert camera.distortion[:5] == pytest.approx(LENS)
    assert not camera.distortion[5:].any()


def test_coefficients_that_are_not_named_are_zero(tmp_path):
    path = tmp_path / "camera.yaml"
    path.write_text(NO_LENS + "distortion_parameters: {k1: -0.12, k2: 0.05}\n")
    assert read_camera(path).distortion.tolist() == [-0.12, 0.05, 0, 0]
    path.write_text(NO_LENS + "k1: -0.12\nk6: 0.05\n")
    assert read_camera(path).distortion.tolist() == [-0.12, 0, 0, 0, 0, 0, 0, 0.05]
    path.write_text(NO_LENS + "k1: -0.12\ns1: 0.05\n")
    with pytest.raises(InputError, match="no thin prism"):
        read_camera(path)
    path.write_text(NO_LENS + "D: []\n")
    assert not read_camera(path).distortion.any()


def test_the_inverse_of_the_camera_s_place_is_inverted(tmp_path):
    T = SE3.exp(np.random.default_rng(1).normal(size=6))
    path = tmp_path / "camera.yaml"
    for key, value in {
        "T_world_camera": T,
        "T_world_cam": T,
        "T_camera_world": SE3.inverse(T),
        "T_cam_world": SE3.inverse(T),
    }.items():
        path.write_text(f"{ROS_YAML}{key}: {value.tolist()}\n")
        assert read_camera(path).T_world_camera == pytest.approx(T, abs=1e-9)


def test_the_camera_s_place_is_read_in_metres(tmp_path):
    path = tmp_path / "camera.yaml"
    path.write_text(ROS_YAML + "T_world_camera: [1, 0, 0, 0.1, 0, -1, 0, 0.2, 0, 0, -1, 0.7, 0, 0, 0, 1]\n")
    assert read_camera(path).T_world_camera[:3, 3] == pytest.approx([0.1, 0.2, 0.7])


@pytest.mark.parametrize(("line", "sd"), [("", USUAL_EDGE_SD), ("edge_sd_px: 0\n", 0.0), ("edge_sd_px: 0.15\n", 0.15)])
def test_the_accuracy_of_the_camera_may_be_stated(tmp_path, line, sd):
    path = tmp_path / "camera.yaml"
    path.write_text(ROS_YAML + line)
    assert read_camera(path).edge_sd == sd


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("image_width: 640\nimage_height: 480\n", ("camera_matrix",)),
        (ROS_YAML.replace("image_width: 640\n", ""), ("image_width",)),
        (ROS_YAML.replace("plumb_bob", "equidistant"), ("distortion_model", "equidistant")),
        (ROS_YAML.replace("[620.0, 0.0, 317.0", "[620.0, 317.0", 1), ("camera_matrix", "9")),
        (ROS_YAML.replace("-0.12", "minus"), ("distortion_coefficients", "minus")),
        (ROS_YAML.replace("-0.12", ".nan"), ("finite",)),
        (ROS_YAML + "T_world_camera: [1, 2]\n", ("T_world_camera", "16")),
        (ROS_YAML + "T_camera_world: [2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n", ("T_camera_world", "rigid")),
        (ROS_YAML + f"T_world_camera: {UNIT}\nT_cam_world: {UNIT}\n", ("T_world_camera and T_cam_world", "Keep one")),
        (ROS_YAML + f"T_world_to_camera: {UNIT}\n", ("T_world_to_camera", "the inverse", "Name it T_camera_world")),
        (ROS_YAML + f"T_camera_to_world: {UNIT}\n", ("T_camera_to_world", "Name it T_world_camera")),
        (ROS_YAML + f"Tcw: {UNIT}\n", ("Tcw", "the inverse", "Name it T_camera_world")),
        (ROS_YAML + f"c2w: {UNIT}\n", ("c2w", "Name it T_world_camera")),
        (ROS_YAML + f"T_wold_camera: {UNIT}\n", ("T_wold_camera", "T_world_camera", "its inverse")),
        (ROS_YAML + f"world_frame_of_cam: {UNIT}\n", ("world_frame_of_cam", "may be either")),
        (ROS_YAML + f"extrinsics: {UNIT}\n", ("extrinsics", "mostly the inverse", "name it T_camera_world")),
        (ROS_YAML + "rvec: [0, 0, 1]\ntvec: [[0.1], [0.2], [0.7]]\n", ("rvec", "solvePnP", "cv2.Rodrigues")),
        (NO_LENS, ("expected the distortion of the lens", WRITE_IT, "[0, 0, 0, 0, 0] if the image is rectified")),
        (NO_LENS + "lens_dist: [0.1, 0, 0, 0]\n", ("lens_dist", "Write distortion_coefficients: [k1, k2, p1, p2, k3]")),
        (NO_LENS + "RadialDistortion: [0.1, 0]\n", ("RadialDistortion", WRITE_IT)),
        (ROS_YAML + "lens_dist: [0.1, 0, 0, 0]\n", ("lens_dist", "if it is no distortion, leave it out")),
        (ROS_YAML + "dist: [0.1, 0, 0, 0]\n", ("distortion_coefficients and dist", "Keep one")),
        (NO_LENS + "dist: plumb_bob\n", ("dist:", "plumb_bob", WRITE_IT)),
        (NO_LENS + "dist: 0.1\n", ("dist:", "numbers in a row")),
        (NO_LENS + "distortion: {radial: [0.1, 0.2]}\n", ("distortion:", "'radial'", WRITE_IT)),
        (NO_LENS + "distortion: {}\n", ("distortion:", "an empty table")),
        (NO_LENS + "dist: [0.1, 0, 0]\n", ("0, 4, 5 or 8 coefficients",)),
        (ROS_YAML + "T_world_camera: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.1, 0, 0.5, 1]\n", ("0 0 0 1",)),
        (ROS_YAML + "edge_sd_mm: 1\n", ("edge_sd_px", "edge_sd_mm")),
        (ROS_YAML + "fisheye_model: 1\n", ("fisheye_model", "Undistort the image first")),
        (ROS_YAML + "camera_model: fisheye\n", ("camera_model", "the fisheye model", "--rectified")),
        (ROS_YAML + "edge_sd_px: -1\n", ("edge_sd", "0 or more")),
        (ROS_YAML + "edge_sd_px: about one\n", ("edge_sd_px", "about one")),
        (ROS_YAML + "T_world_camera: [2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n", ("rigid",)),
        (ROS_YAML.replace("plumb_bob", "none"), ("no distortion of the model 'none'",)),
        (ROS_YAML.replace("620.0, 0.0, 317", "620.0, 9.0, 317", 1), ("skew", "got 9", "--rectified")),
        (KALIBR + KALIBR.replace("cam0", "cam1"), ("expected one camera, got cam0, cam1",)),
        (KALIBR.replace("pinhole", "omni"), ("camera_model", "omni", "Undistort")),
        (KALIBR.replace("radtan", "equidistant"), ("distortion_model", "equidistant", "fisheye")),
        (KALIBR.replace("[620.0", "[0.9, 620.0"), ("intrinsics", "5 numbers")),
        (OPENCV_XML.replace("opencv_storage", "storage"), ("<opencv_storage>",)),
        (OPENCV_XML.replace("<opencv", "<!DOCTYPE x [<!ENTITY a 'b'>]><opencv"), ("document type",)),
        (OPENCV_XML[:-12], ("expected XML",)),
        (ROS_INI + "camera matrix\n1 0 0\n", ("expected one camera, got 'camera matrix' twice",)),
        (ROS_INI.replace("0.0 615.0", "0.0 615..0"), ("camera_matrix", "615..0")),
        ("<opencv_storage>" + "<a>" * 5000 + "</a>" * 5000 + "</opencv_storage>", ("levels",)),
        ("a: " + "[" * 5000, ("levels",)),
        ("a: &-a [x]\nb: [" + "*-a, " * 30 + "]\n", ("references",)),
        (ROS_YAML + "seen: 2001-13-45\n", ("plain numbers", "month")),
        (ROS_YAML + "x: !!float y\n", ("plain numbers", "'y'")),
        (ROS_YAML + f"x: {'9' * 5000}\n", ("plain numbers",)),
        (ROS_YAML + "image_width: 3\n", ("the key 'image_width' twice",)),
        ('{"a": ' + "[" * 5000, ("levels",)),
        ("{", ("JSON",)),
        ("a: [", ("YAML",)),
        ("- 1\n- 2\n", ("keys",)),
        ("x: !!python/object/apply:os.system ['true']\n", ("YAML",)),
    ],
)
def test_what_is_no_camera_is_refused_by_name(tmp_path, text, words):
    path = tmp_path / "camera.yaml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_camera(path)
    for word in ("camera.yaml", *words):
        assert word in str(caught.value)


def test_a_camera_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match="Check the path"):
        read_camera(tmp_path / "none.yaml")


def test_marks_come_in_metres(tmp_path):
    path = tmp_path / "marks.csv"
    path.write_text("# crosses on the table\nu_px,v_px,x_mm,y_mm\n10.5,20,100,-50\n30,40,0,25\n")
    pixels, points = read_marks(path)
    assert pixels.tolist() == [[10.5, 20], [30, 40]]
    assert points == pytest.approx(np.array([[0.1, -0.05, 0], [0, 0.025, 0]]))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ("empty",)),
        ("u_px,v_px,x_mm\n1,2,3\n", ("u, v, x, y",)),
        ("u_px,v_px,x_mm,y\n1,2,3,4\n", ("'y'",)),
        ("u_px,v_px,x_mm,y_mm\n1,2,three,4\n", ("line 2", "three")),
        ("u_px,v_px,x_mm,y_mm\n1,2,3\n", ("line 2", "4 cells")),
        ("u_px,v_px,x_mm,x_m,y_mm\n1,2,3,4,5\n", ("once",)),
        (f"u_px,v_px,x_mm,y_mm\n1,2,3,{'4' * 200_000}\n", ("comma-separated cells", "131072")),
    ],
)
def test_marks_that_cannot_be_read_are_refused_by_place(tmp_path, text, words):
    path = tmp_path / "marks.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_marks(path)
    for word in ("marks.csv", *words):
        assert word in str(caught.value)


def test_images_come_as_grey_levels(tmp_path):
    grey = np.random.default_rng(1).integers(0, 256, (40, 50))
    write_image(tmp_path / "grey.png", grey)
    assert read_image(tmp_path / "grey.png").tolist() == grey.tolist()
    cv2.imwrite(str(tmp_path / "deep.png"), (grey * 257).astype(np.uint16))
    assert read_image(tmp_path / "deep.png") == pytest.approx(grey)
    colour = np.zeros((40, 50, 3))
    colour[..., 0] = 255  # red
    write_image(tmp_path / "red.png", colour)
    assert read_image(tmp_path / "red.png")[0, 0] == pytest.approx(76, abs=1)


def test_what_is_no_image_is_refused(tmp_path):
    (tmp_path / "words.png").write_text("not an image")
    (tmp_path / "empty.png").write_bytes(b"")
    for name in ("words.png", "empty.png", "none.png"):
        with pytest.raises(InputError, match=name):
            read_image(tmp_path / name)
    cv2.imwrite(str(tmp_path / "float.tiff"), np.full((40, 50), 0.5, dtype=np.float32))
    with pytest.raises(InputError, match="16 bits"):
        read_image(tmp_path / "float.tiff")
    with pytest.raises(InputError, match="suffix"):
        write_image(tmp_path / "picture.xyz", np.zeros((40, 40)))
    with pytest.raises(InputError, match="place to write"):
        write_image(tmp_path / "none" / "picture.png", np.zeros((40, 40)))


def test_a_long_list_of_coefficients_is_cut_in_its_message(tmp_path):
    path = tmp_path / "camera.yaml"
    numbers = ", ".join(["1.0"] * 2000)
    path.write_text(f"image_size: [640, 480]\nK: [800, 0, 320, 0, 800, 240, 0, 0, 1]\nD: [{numbers}]\n")
    with pytest.raises(InputError) as caught:
        read_camera(path)
    assert len(str(caught.value)) < 1000
