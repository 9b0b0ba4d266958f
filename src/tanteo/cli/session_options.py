"""Options of commands that run a session: ``tanteo sense part``, ``tanteo view``. Only the parser is imported here."""

from __future__ import annotations

from typing import Annotated

import typer

from tanteo.cli.completing import policy_names

PolicyName = Annotated[
    str,
    typer.Option("--policy", metavar="NAME", help="How the next reading is chosen.", autocompletion=policy_names),
]
Probability = Annotated[float, typer.Option("--probability", help="Of the part, at which to stop.")]
Tolerance = Annotated[
    str | None,
    typer.Option("--tolerance", metavar="LENGTH", help="Go on until all corners are placed within it, as 2mm."),
]
Feature = Annotated[
    str | None,
    typer.Option(
        "--feature", metavar="NAME", help="Place this instead of the corners: 'face 3', 'edge 4' or 'vertex 2'."
    ),
]
Confidence = Annotated[float, typer.Option("--confidence", help="With which they are.")]
Most = Annotated[int, typer.Option("--max-measurements", help="Readings after which to stop in any case.")]
MeshUnits = Annotated[
    str | None,
    typer.Option("--units", metavar="UNIT", help="Unit of STL, OBJ, PLY and OFF: mm, cm, m, um, in, ft."),
]
ImageFile = Annotated[
    str | None,
    typer.Option("--image", metavar="IMAGE", help="Start from an image of the table; render: of the scene itself."),
]
CameraFile = Annotated[
    str | None, typer.Option("--camera", metavar="FILE", help="Its calibration (YAML, JSON); else the scene's.")
]
MarksFile = Annotated[
    str | None,
    typer.Option("--marks", metavar="FILE", help="Known points of the table, to place the camera (CSV)."),
]
SceneSeed = Annotated[int | None, typer.Option("--seed", help="Of all simulated errors; else the scene's.")]
