"""OBJ files as programs write them, and damaged ones."""

import numpy as np
import pytest

from tanteo.errors import PartError
from tanteo.parts import read_part

CORNERS = [(x, y, z) for x in (0, 60) for y in (0, 40) for z in (0, 20)]
FACES = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]


def lines(corner="v {} {} {}", face="f {} {} {} {}", shift=0):
    rows = [corner.format(*c) for c in CORNERS]
    return [*rows, *(face.format(*(k + shift for k in ring)) for ring in FACES)]


def read(tmp_path, text):
    path = tmp_path / "part.obj"
    path.write_bytes(text.encode())
    return read_part(path, unit="mm")


@pytest.mark.parametrize(
    "text",
    [
        "\n".join(lines()),
        "\r".join(lines()) + "\r",
        "\r\n".join(lines()),
        "\n".join(lines(shift=-9)),
        "\n".join(lines("v {} {} {} 1.0")),
        "\n".join(lines("v {} {} {} 0.2 0.4 0.6")),
        "\n".join(lines("v {} {} \\\n {}")),
        "\n".join(["mtllib none.mtl", "g a b", "vn 0 0 1", "vt 0 0", *lines(face="f {}/1/1 {}//1 {}/1 {}"), "l 1 2"]),
        "# \u00e4\n" + "\n".join(lines()),
    ],
    ids=["plain", "old Mac", "Windows", "negative", "w", "colours", "continued", "all else", "other letters"],
)
def test_obj_files_of_every_kind_give_one_box(tmp_path, text):
    part = read(tmp_path, text)
    assert (len(part.planes), len(part.edges), len(part.corners)) == (6, 12, 8)
    np.testing.assert_allclose(part.box[1], [0.06, 0.04, 0.02])
    assert part.repairs == ()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("\n".join(lines()[:8]), r"expected faces \(lines that begin with f\), got vertices alone"),
        ("vn 0 0 1\n", "got no vertices"),
        ("\n".join([*lines()[:8], "surf 0 1 0 1 1 2 3"]), "got surfaces or curves of splines"),
        ("\n".join([*lines(), "f 1 2 99"]), "expected corners among the vertices 0 to 7"),
        ("\n".join([*lines(), "v 1 x 2"]), "coordinates as numbers"),
        ("\n".join([*lines(), "v 1 2"]), "got 'v 1 2' in line 15"),
        ("\n".join([*lines(), "v 1 2 3 0.5"]), "got 'v 1 2 3 0.5' in line 15"),
        ("\n".join([*lines(), "f 1 2 1e400000"]), "in line 15"),
    ],
)
def test_broken_obj_files_are_refused_in_a_sentence(tmp_path, text, message):
    with pytest.raises(PartError, match=rf"part\.obj: {message}|part\.obj: .*{message}"):
        read(tmp_path, text)


def test_a_polygon_without_a_star_corner_is_filled(tmp_path):
    # a square ring, as one polygon with a slit
    ring = [(0, 0), (60, 0), (60, 60), (0, 60), (0, 50), (50, 50), (50, 10), (10, 10), (10, 45), (0, 45)]
    bottom = [f"v {x} {y} 0" for x, y in ring]
    top = [f"v {x} {y} 10" for x, y in ring]
    n = len(ring)
    sides = [f"f {i + 1} {(i + 1) % n + 1} {(i + 1) % n + n + 1} {i + n + 1}" for i in range(n)]
    caps = ["f " + " ".join(str(n - i) for i in range(n)), "f " + " ".join(str(n + 1 + i) for i in range(n))]
    part = read(tmp_path, "\n".join([*bottom, *top, *sides, *caps]))
    x, y = np.array(ring, float).T
    area = 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    assert part.volume == pytest.approx(area * 10 * 1e-9)


@pytest.mark.slow
def test_a_polygon_of_thousands_of_corners_is_triangulated_whole(tmp_path):
    """A star-shaped outline without symmetry or a central corner: the volume is the polygon's area times the height."""
    count = 4000
    angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
    radii = 30.0 + np.where(np.arange(count) % 2, 0.5, 0.0) + 5.0 * (angles > 1.0)
    x, y = radii * np.cos(angles), radii * np.sin(angles)
    rows = [f"v {a:.9f} {b:.9f} {z}" for z in (0, 5) for a, b in zip(x, y, strict=True)]
    rows.append("f " + " ".join(map(str, range(count, 0, -1))))
    rows.append("f " + " ".join(map(str, range(count + 1, 2 * count + 1))))
    ring = [(k + 1, (k + 1) % count + 1) for k in range(count)]
    rows += [f"f {a} {b} {b + count} {a + count}" for a, b in ring]
    part = read(tmp_path, "\n".join(rows))
    area = 0.5 * abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    assert part.volume == pytest.approx(5e-9 * area, rel=1e-6)
