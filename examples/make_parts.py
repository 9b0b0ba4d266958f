"""Make the STEP files in ``examples/parts``: twelve plain industrial parts in millimetres.

Among them are a mirror pair (bracket_left, bracket_right), near twins (step_12mm, step_15mm), parts with symmetry
(block, square_post, hex_spacer, t_slot) and two with curved faces (flange, hex_spacer). Run it from anywhere:
``python examples/make_parts.py [folder]``. The files are reproducible byte for byte.
"""

import re
import sys
from pathlib import Path

from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakePolygon, BRepBuilderAPI_Transform
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakePrism
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.Interface import Interface_Static
from OCP.Message import Message, Message_Gravity
from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer


def box(low, high):
    """Return a block between two opposite corners."""
    return BRepPrimAPI_MakeBox(gp_Pnt(*low), gp_Pnt(*high)).Shape()


def bore(x, y, radius, low=-1.0, high=200.0):
    """Return a cylinder along z, to cut or to fuse."""
    return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(x, y, low), gp_Dir(0, 0, 1)), radius, high - low).Shape()


def prism(outline, along):
    """Return a polygon, given by its points, extruded along a vector."""
    polygon = BRepBuilderAPI_MakePolygon()
    for point in outline:
        polygon.Add(gp_Pnt(*map(float, point)))
    polygon.Close()
    return BRepPrimAPI_MakePrism(BRepBuilderAPI_MakeFace(polygon.Wire()).Face(), gp_Vec(*map(float, along))).Shape()


def cut(shape, *tools):
    """Cut tools from a shape."""
    for tool in tools:
        shape = BRepAlgoAPI_Cut(shape, tool).Shape()
    return shape


def fuse(shape, *others):
    """Fuse shapes."""
    for other in others:
        shape = BRepAlgoAPI_Fuse(shape, other).Shape()
    return shape


def mirrored(shape):
    """Mirror a shape in the plane x = 0."""
    flip = gp_Trsf()
    flip.SetMirror(gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(1, 0, 0)))
    return BRepBuilderAPI_Transform(shape, flip, True).Shape()


def bracket():
    """Return an angle with a rib on one side and a bevelled corner on the other, which is chiral."""
    angle = fuse(box((0, 0, 0), (120, 80, 12)), box((0, 0, 12), (12, 80, 90)))
    rib = prism([(12, 12, 12), (72, 12, 12), (12, 12, 66)], (0, 10, 0))
    bevel = prism([(120, 80, -1), (90, 80, -1), (120, 50, -1)], (0, 0, 20))
    return cut(fuse(angle, rib), bevel, box((-1, 48, 62), (13, 81, 91)))


def stairs(height):
    """Return a block with two steps; only the height of the first step discriminates the two variants."""
    return fuse(box((0, 0, 0), (100, 60, height)), box((40, 0, 0), (100, 60, 30)), box((75, 20, 0), (100, 60, 45)))


def square_post():
    """Return a square post on a square foot, with a four-fold axis."""
    return fuse(box((-45, -45, 0), (45, 45, 20)), box((-25, -25, 20), (25, 25, 110)))


def wedge():
    """Return a ramp with a flat top."""
    return prism([(0, 0, 0), (140, 0, 0), (140, 0, 15), (30, 0, 60), (0, 0, 60)], (0, 50, 0))


def t_slot():
    """Return a rail with a T-shaped slot, with a two-fold vertical axis."""
    return cut(box((0, 0, 0), (160, 60, 50)), box((-1, 22, 28), (161, 38, 51)), box((-1, 14, 14), (161, 46, 28)))


def housing():
    """Return a box with a stepped pocket and a window in one wall."""
    pockets = box((10, 10, 12), (100, 70, 61)), box((60, 10, 6), (100, 45, 13))
    return cut(box((0, 0, 0), (110, 80, 60)), *pockets, box((25, 65, 30), (55, 81, 61)))


def flange():
    """Return a rectangular flange with a hub, a bore and four holes."""
    plate = fuse(box((-70, -50, 0), (70, 50, 18)), bore(0, 0, 30, 0, 48))
    holes = [bore(x, y, 7) for x in (-52, 52) for y in (-34, 34)]
    return cut(plate, bore(0, 0, 17.5), *holes)


def clamp():
    """Return a jaw with a V groove and a slanted nose."""
    jaw = cut(box((0, 0, 0), (130, 50, 60)), box((45, -1, 22), (131, 51, 44)))
    groove = prism([(90, -1, 44.5), (100, -1, 54), (110, -1, 44.5), (110, -1, 43), (90, -1, 43)], (0, 52, 0))
    nose = prism([(131, -1, 61), (131, -1, 50), (105, -1, 61)], (0, 52, 0))
    return cut(jaw, groove, nose, box((-1, 30, -1), (20, 51, 61)))


def hex_spacer():
    """Return a hexagonal prism with a bore."""
    outline = [(40, 0, 0), (20, 34.6410161514, 0), (-20, 34.6410161514, 0)]
    outline += [(-x, -y, z) for x, y, z in outline]
    return cut(prism(outline, (0, 0, 65)), bore(0, 0, 18))


PARTS = {
    "block": lambda: box((0, 0, 0), (120, 80, 50)),
    "bracket_left": bracket,
    "bracket_right": lambda: mirrored(bracket()),
    "clamp": clamp,
    "flange": flange,
    "hex_spacer": hex_spacer,
    "housing": housing,
    "square_post": square_post,
    "step_12mm": lambda: stairs(12),
    "step_15mm": lambda: stairs(15),
    "t_slot": t_slot,
    "wedge": wedge,
}


def write(shape, path):
    """Write one solid; the header names no date, no author and no folder."""
    unify = ShapeUpgrade_UnifySameDomain(shape, True, True, False)
    unify.Build()
    writer = STEPControl_Writer()
    Interface_Static.SetCVal_s("write.step.unit", "MM")
    Interface_Static.SetIVal_s("write.surfacecurve.mode", 0)
    for printer in Message.DefaultMessenger_s().Printers():
        printer.SetTraceLevel(Message_Gravity.Message_Fail)
    writer.Transfer(unify.Shape(), STEPControl_AsIs)
    writer.Write(str(path))
    name = f"FILE_NAME('{path.name}','',(''),(''),'','tanteo examples','');"
    text = re.sub(r"FILE_NAME\(.*?\);", name, path.read_text(), count=1, flags=re.DOTALL)
    text = re.sub(r"'Open CASCADE STEP translator [^']*'", f"'{path.stem}'", text)
    path.write_text(text, newline="\n")


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "parts"
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in PARTS.items():
        write(make(), folder / f"{name}.step")
    print(f"{len(PARTS)} parts in {folder}", file=sys.stderr)
