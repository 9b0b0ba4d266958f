"""From an image to parts on a table, and what a touch should settle.

A camera over a table is placed by twelve marks on it. Three parts lie there; then one that a hand half covers; then one
of two that differ by three millimetres where the camera hardly looks. Needs ``pip install 'tanteo[step,vision]'``.

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
print(f"camera {1e3 * placed.T_world_camera[2, 3]:.0f} mm over the table, marks {placed.rms:.2f} px off")
camera = replace(camera, T_world_camera=placed.T_world_camera, covariance=placed.covariance)

# once for many images: edges, stable poses
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
