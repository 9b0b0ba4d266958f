"""Recognize parts on a table in an image, with the next touch if the image is ambiguous.

Twelve marks on the table locate a camera above it. The first image has three parts, the second one part that a hand
half covers. The third has one of two parts that differ by three millimetres in a dimension that the camera hardly
shows. Needs ``pip install 'tanteo[step,vision]'``.

    python examples/09_from_an_image.py
"""

from dataclasses import replace
from pathlib import Path

from tanteo import read_parts
from tanteo.io import read_camera, read_image, read_marks
from tanteo.vision import prepare_vision, see_table
from tanteo.vision.table import fit_camera

HERE = Path(__file__).parent
IMAGES = HERE / "images"

camera = read_camera(IMAGES / "camera.yaml")
placed = fit_camera(camera, *read_marks(IMAGES / "marks.csv"))
print(f"camera {1e3 * placed.T_world_camera[2, 3]:.0f} mm above the table, marks fit to {placed.rms:.2f} px")
camera = replace(camera, T_world_camera=placed.T_world_camera, covariance=placed.covariance)

# edges and stable poses, computed once for many images
models = [prepare_vision(part) for part in read_parts([HERE / "parts"])]

for name in ("three_parts", "half_hidden", "twins"):
    sight = see_table(read_image(IMAGES / f"{name}.png"), camera, models)
    print(f"\n{name}: {len(sight.objects)} object(s)")
    for seen in sight.objects:
        answer = seen.answer
        best = answer.hypotheses[0]
        x, y, z = 1e3 * best.T_world_part[:3, 3]
        print(f"  {answer.status}: {best.part} at x {x:.1f} y {y:.1f} z {z:.1f} mm, P = {best.probability:.2f}")
        if seen.question is not None:
            print(f"  {seen.question.words}")
