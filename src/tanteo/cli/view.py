"""Implement ``tanteo view``: show a session or a record on a live page until Ctrl-C."""

from __future__ import annotations

import sys
import webbrowser
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tanteo import io
from tanteo.cli import arguments as args
from tanteo.cli.misuse import misuse
from tanteo.cli.printing import emit
from tanteo.cli.replay import resume
from tanteo.cli.sense_part import start_of
from tanteo.cli.session_options import SessionOptions
from tanteo.errors import InputError, MissingExtraError

if TYPE_CHECKING:
    from tanteo.render.live import Show

_PORTS = 65535
_TOLERANCE = 2e-3
"""Default tolerance of the example's session [m]."""

_OF_SESSIONS = (
    "bare", "goal", "feature", "standoff", "pose_prior", "prior", "outlier_rate", "unknown_prior", "image",
    "camera", "marks",
)  # fmt: skip
"""Options that are refused with a record."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Options(SessionOptions):
    """Options of a session with a hand, or with a laser that needs no hand."""

    standoff: Annotated[
        float | None,
        args.option(
            "--standoff", "LENGTH", "Distance of the sensors from the surface, as 40mm; the scene's if not given."
        ),
        args.STANDOFF,
    ] = None


def check_view(typed: Mapping[str, Any]) -> None:
    """Check that the options of a view are consistent.

    Args:
        typed: typed values by parameter name.

    Raises:
        InputError: options exclude each other, or a required one is missing.
    """
    port, record, scene, parts = (typed[name] for name in ("port", "record", "scene", "parts"))
    if not 0 < port <= _PORTS:
        raise InputError(f"--port: expected a number from 1 to {_PORTS}, got {port}. Use 8080.")
    if record is not None and scene is not None:
        raise InputError("--scene: expected a record or a scene, got both. Drop one.")
    unused = [f"--{name.replace('_', '-')}" for name in _OF_SESSIONS if typed[name]]
    unused += ["--seed"] if typed["seed"] is not None else []
    if record is not None and unused:
        raise InputError(f"{unused[0]}: expected with a scene, got it with a record. Drop it.")
    if scene is not None and not parts:
        raise InputError("--parts: expected the candidate parts, got none. Name files or folders.")
    if scene is None and record is None and parts:
        raise InputError("--scene: expected one with --parts, got none. Name it, or drop --parts for the example.")


def view(
    *,
    record: Annotated[
        str | None,
        typer.Argument(metavar="[RECORD]", help="Record of a session (JSON, or .mcap) to show step by step."),
    ] = None,
    scene: Annotated[
        str | None, args.option("--scene", "FILE", "Scene: parts, table, hand (TOML); an example if not given.")
    ] = None,
    parts: Annotated[
        list[str] | None, args.option("--parts", "FILE_OR_FOLDER...", "CAD files (STEP, STL) or folders of them.")
    ] = None,
    bare: Annotated[bool, args.option("--bare", None, "Sense with a laser at any pose, without a hand.")] = False,
    options: Options,
    port: Annotated[int, args.option("--port", None, "Port of the page; the next free one if it is taken.")] = 8080,
    no_open: Annotated[bool, args.option("--no-open", None, "Do not open the page in a browser.")] = False,
) -> None:
    """Show a running session or a record in a browser.

    The page steps through the session, and lets the user choose readings.
    """
    from tanteo.render.live import NEEDS_VISER, replay

    if find_spec("viser") is None:
        raise MissingExtraError(NEEDS_VISER)
    if record is not None:
        _, session, _ = resume(record, parts or [], quiet=False)
        with suppress(KeyboardInterrupt):
            replay(session, port=port, ready=lambda url: ready(url, show=not no_open))
        return
    with _example(scene, parts or [], options) as (path, folders, chosen):
        _play(path, folders, chosen, port, bare=bare, show=not no_open)


@contextmanager
def _example(
    scene: str | None, parts: Sequence[str], options: Options
) -> Iterator[tuple[str | Path, Sequence[str], Options]]:
    """Yield the named scene, parts and options, or those of the example."""
    if scene is not None:
        yield scene, parts, options
        return
    with resources.as_file(resources.files("tanteo.bench.demo")) as folder:
        chosen = replace(options, goal=options.goal or _TOLERANCE, units="mm")
        yield folder / "scene.toml", [str(folder / "parts")], chosen


def _play(path: str | Path, folders: Sequence[str], options: Options, port: int, *, bare: bool, show: bool) -> None:
    """Play the session of a scene on a live page."""
    from tanteo.render.live import play, scene_show

    scene = io.read_scene(path)
    start = start_of(scene, folders, options)
    scene = replace(scene, standoff=options.standoff or scene.standoff)

    def make(seed: int, policy: str) -> Show:
        with misuse(always=False):
            return scene_show(
                replace(scene, seed=seed),
                start,
                options.stop(),
                policy,
                options.form_sd,
                options.stated_errors,
                bare=bare,
            )

    seed = scene.seed if options.seed is None else options.seed
    with suppress(KeyboardInterrupt):
        play(make, seed, options.policy, port=port, ready=lambda url: ready(url, show=show))


def ready(url: str, *, show: bool) -> None:
    """Print the address of the live page, and open it in a browser on a terminal.

    Args:
        url: address of the page.
        show: whether to open it.
    """
    emit([f"Live page: {url} (Ctrl-C ends it)"])
    if show and sys.stdout.isatty():
        webbrowser.open(url)
