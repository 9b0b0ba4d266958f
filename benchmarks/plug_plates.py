"""Plug plates of a sky survey by their measured holes: ``python benchmarks/plug_plates.py FOLDER [holes]``.

FOLDER holds the files ``D*`` of the public repository csayres/fitPlugPlateMeas (``tests/testData`` and ``examples``):
aluminium plates of 0.8 m with holes drilled for fibres, measured by a coordinate measuring machine to some micrometres.
Each plate is made of its nominal positions and diameters. Its measured holes, all or a given number, identify it among
all plates in the machine's own frame. Eight points state the machine's plane z = 0, to which the files refer.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeWire
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
from OCP.gp import gp_Ax2, gp_Circ, gp_Dir, gp_Pln, gp_Pnt, gp_Vec
from OCP.Message import Message
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.TopoDS import TopoDS

from tanteo import Readings, identify, read_part
from tanteo.posterior import Priors

THICK, RIM = 3.2, 406.0
SD, MADE = 5e-6, 1e-5  # of the machine, and of the plates, which are drilled bent [m]


def table(path):
    """Measured x, y, nominal x, y, measured and nominal diameter of each hole ``(n, 6)`` [mm]."""
    rows = []
    for line in path.read_text(errors="replace").splitlines():
        words = line.split()
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            continue
        if len(numbers) == 9:
            rows.append([*numbers[:4], *numbers[6:8]])
    return np.array(rows)


def wire(x, y, radius):
    circle = gp_Circ(gp_Ax2(gp_Pnt(x, y, 0), gp_Dir(0, 0, 1)), radius)
    return BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(circle).Edge()).Wire()


def plate(name, rows, folder):
    """Return the plate as a part, its upper face at z = 0."""
    face = BRepBuilderAPI_MakeFace(gp_Pln(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), wire(0, 0, RIM))
    for x, y, diameter in rows[:, [2, 3, 5]]:
        face.Add(TopoDS.Wire(wire(x, y, diameter / 2).Reversed()))
    writer = STEPControl_Writer()
    writer.Transfer(BRepPrimAPI_MakePrism(face.Face(), gp_Vec(0, 0, -THICK)).Shape(), STEPControl_AsIs)
    path = Path(folder) / f"{name}.step"
    writer.Write(str(path))
    return read_part(path)


def readings(rows):
    """Centres as measured, and points of the machine's plane."""
    n = len(rows)
    turns = 2 * np.pi * np.arange(8) / 8
    on_plane = 0.395 * np.column_stack([np.cos(turns), np.sin(turns), 0 * turns])
    centres = np.column_stack([1e-3 * rows[:, :2], np.zeros(n)])
    down = np.concatenate([np.full((n, 3), np.nan), np.tile([0.0, 0.0, -1.0], (8, 1))])
    return Readings.from_columns(
        points=np.concatenate([centres, on_plane]), sds=np.full(n + 8, SD), kinds=["centre"] * n + ["plane"] * 8,
        features=[f"h{k}" for k in range(n)] + ["top"] * 8, directions=down,
    )  # fmt: skip


def residuals(answer, rows):
    """Measured less nominal holes at the pose of the answer, rms of a coordinate [um]."""
    T = answer.best.T_world_part
    nominal = np.column_stack([1e-3 * rows[:, 2:4], np.zeros(len(rows))]) @ T[:3, :3].T + T[:3, 3]
    return 1e6 * np.sqrt(np.mean((nominal[:, :2] - 1e-3 * rows[:, :2]) ** 2))


def main(folder, most=0):
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    tables = {path.name: table(path) for path in sorted(Path(folder).glob("D*"))}
    tables = {name: rows for name, rows in tables.items() if len(rows)}
    with tempfile.TemporaryDirectory() as there:
        parts, of = [], {}
        for name, rows in tables.items():
            same = [
                k for k, other in of.items() if other.shape == rows.shape and np.allclose(other[:, 2:4], rows[:, 2:4])
            ]
            if not same:  # measured again
                of[name] = rows
                parts.append(plate(name, rows, there))
    print(
        f"{len(parts)} plates\n\n| measured | holes | status | named | P | um rms | s |\n|---|---|---|---|---|---|---|"
    )
    for name, rows in tables.items():
        some = rows if not most else rows[np.random.default_rng(1).permutation(len(rows))[:most]]
        start = time.process_time()
        answer = identify(readings(some), parts, tolerance=MADE, priors=Priors(radius=0.5), conventions=False)
        taken = time.process_time() - start
        best, off = answer.best, residuals(answer, rows) if answer.best else np.nan
        named, p = (best.part, best.probability) if best else ("", 0.0)
        print(f"| {name} | {len(some)} | {answer.status} | {named} | {p:.3f} | {off:.1f} | {taken:.1f} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:]))
