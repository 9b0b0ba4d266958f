"""The option ``--report``. Only the parser is imported here."""

from __future__ import annotations

from typing import Annotated

import typer

Report = Annotated[
    str | None, typer.Option("--report", metavar="FILE.html", help="Write a report that any browser opens, offline.")
]
