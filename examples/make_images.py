"""Render the images in ``examples/images``: parts of ``examples/parts`` on a table below a camera.

``python examples/make_images.py [folder]``. Light, shadows, blur and noise are drawn by ``tanteo.vision.rendering``;
every file has a fixed seed. ``truth.csv`` has the true parts and poses, so that answers can be checked.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from rendered import rendered_slab, table_camera
from tanteo.catalogue import stable_poses
from tanteo.geometry import SE3, SO3
from tanteo.io import write_image
from tanteo.parts import read_part
from tanteo.vision import render
from tanteo.vision.camera import project
from tanteo.vision.rendering import Appearance, Stage, rendered_part

HERE = Path(__file__).resolve().parent
CAMERA = table_camera(distance=0.62, tilt=22.0, turn=30.0)

MARKS = np.array([[x, y, 0.0] for x in (-0.15, -0.05, 0.05, 0.15) for y in (-0.1, 0.0, 0.1)])
"""Positions of the crosses on the table [m]."""

SCENES = {
    "three_parts": [("flange", 1, 0.02, -0.10, 0, 90), ("bracket_left", 0, -0.09, 0.06, 23, 110),
                    ("housing", 1, 0.10, 0.05, 115, 140)],
    "half_hidden": [("clamp", 0, 0.0, 0.0, 70, 120)],
    "twins": [("step_12mm", 0, 0.0, 0.0, 150, 120)],
}  # fmt: skip
"""Contents of each image: part, number of its stable pose, x and y of its middle [m], yaw [deg], brightness."""

HAND = np.array([[0.0, -0.05], [0.09, -0.06], [0.12, 0.01], [0.08, 0.07], [0.0, 0.05], [-0.006, 0.02], [0.004, -0.02]])
"""Outline of the occluder in ``half_hidden`` [m]."""


def camera_text():
    """Return the calibration in the format of ROS, without the camera's pose, which the marks determine."""
    K, k = CAMERA.K.ravel(), CAMERA.distortion
    return (
        f"image_width: {CAMERA.size[0]}\nimage_height: {CAMERA.size[1]}\ncamera_name: over_the_table\n"
        f"camera_matrix:\n  rows: 3\n  cols: 3\n  data: [{', '.join(f'{v:g}' for v in K)}]\n"
        f"distortion_model: plumb_bob\n"
        f"distortion_coefficients:\n  rows: 1\n  cols: {len(k)}\n  data: [{', '.join(f'{v:g}' for v in k)}]\n"
    )


def main():
    """Render all images, and write camera, marks and true poses."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "images"
    folder.mkdir(exist_ok=True)
    rng = np.random.default_rng(1991)
    (folder / "camera.yaml").write_text(camera_text())
    seen = project(CAMERA, SE3.apply(SE3.inverse(CAMERA.T_world_camera), MARKS)) + rng.normal(0, 0.1, (len(MARKS), 2))
    rows = [f"{u:.2f},{v:.2f},{1e3 * x:g},{1e3 * y:g}" for (u, v), (x, y, _) in zip(seen, MARKS, strict=True)]
    (folder / "marks.csv").write_text("\n".join(["u_px,v_px,x_mm,y_mm", *rows, ""]))
    truth = ["image,part,x_mm,y_mm,z_mm,qw,qx,qy,qz"]
    for name, contents in SCENES.items():
        drawn = []
        for part_name, k, x, y, yaw, paint in contents:
            part = read_part(HERE / "parts" / f"{part_name}.step")
            T = (
                SE3.from_parts(SO3.axis_rotation(2, np.radians(yaw)), np.array([x, y, 0.0]))
                @ stable_poses(part)[k].T_table_part
            )
            drawn.append(rendered_part(part, T, paint))
            numbers = [*(1e3 * T[:3, 3]), *SO3.as_quaternion(T[:3, :3])]
            truth.append(",".join([name, part_name, *(f"{v:.4f}" for v in numbers)]))
        if name == "half_hidden":
            place = SE3.from_parts(SO3.axis_rotation(2, 0.6), np.array([0.005, 0.0, 0.09]))
            drawn.append(rendered_slab(HAND, 0.012, place, 160))
        image, _ = render(Stage(CAMERA, drawn, Appearance(noise=2.0)), rng)
        write_image(folder / f"{name}.png", image)
    (folder / "truth.csv").write_text("\n".join([*truth, ""]))


if __name__ == "__main__":
    main()
