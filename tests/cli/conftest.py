"""The command line in this process, and small parts to run it on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from tanteo.cli import main


class Run(NamedTuple):
    code: int
    out: str
    err: str


@pytest.fixture
def run(capsys):
    """Run the command line; gives exit code, standard output and standard error."""

    def call(*args):
        capsys.readouterr()
        with pytest.raises(SystemExit) as caught:
            main([str(a) for a in args])
        captured = capsys.readouterr()
        return Run(caught.value.code or 0, captured.out, captured.err)

    return call


def prism(corners, height):
    """Triangles ``(n, 3, 3)`` of a right prism over a convex polygon given counter-clockwise."""
    base = np.array([[x, y, 0.0] for x, y in corners])
    top = base + np.array([0.0, 0.0, height])
    n = len(base)
    sides = [
        t for i in range(n) for j in [(i + 1) % n] for t in ((base[i], base[j], top[j]), (base[i], top[j], top[i]))
    ]
    lids = [t for i in range(1, n - 1) for t in ((base[0], base[i + 1], base[i]), (top[0], top[i], top[i + 1]))]
    return np.array(sides + lids)


def stl(triangles):
    """Text of an STL file."""
    lines = ["solid made"]
    for a, b, c in triangles:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += ["vertex {:.9g} {:.9g} {:.9g}".format(*p) for p in (a, b, c)]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid made", ""])


@pytest.fixture(scope="session")
def wedge():
    """A 60 x 40 x 30 mm block with one slanted side: no symmetry [mm]."""
    triangles = prism([(0, 0), (60, 0), (45, 40), (0, 40)], 30)
    triangles.setflags(write=False)
    return triangles


def parts_folder(where, wedge):
    """Make a folder with two parts in millimetres."""
    folder = where / "parts"
    folder.mkdir()
    (folder / "wedge.stl").write_text(stl(wedge))
    (folder / "block.stl").write_text(stl(prism([(0, 0), (90, 0), (90, 50), (0, 50)], 20)))
    return folder


@pytest.fixture
def parts(tmp_path, wedge):
    """A folder with two parts in millimetres."""
    return parts_folder(tmp_path, wedge)


@pytest.fixture(scope="module")
def module_parts(tmp_path_factory, wedge):
    """The same folder, for tests of one module that do not change it."""
    return parts_folder(tmp_path_factory.mktemp("made"), wedge)
