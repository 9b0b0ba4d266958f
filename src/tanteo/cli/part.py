"""Implement ``tanteo part show``: the content of a CAD file."""

from __future__ import annotations

from typing import Annotated

import typer

from tanteo import io, render
from tanteo.cli import arguments as args
from tanteo.cli import files
from tanteo.cli.printing import emit, layout, put


def show(
    file: Annotated[str, typer.Argument(metavar="FILE", help="CAD file (STEP, STL, ...).")],
    units: args.Units = None,
    json: args.Json = False,
    verbose: args.Verbose = False,
) -> None:
    """Show the content of a CAD file.

    Lists planes, edges, vertices, curved faces, symmetry, box and repairs.
    """
    files.require_file("FILE", file)
    (part,) = files.read_all_parts([file], units, quiet=json)
    if json:
        put(io.documents.part_json(part))
    else:
        emit(render.text.part_lines(part, verbose=verbose, layout=layout()))
