"""What ``tanteo view`` does: make the session, open the page, play until it is interrupted."""

from __future__ import annotations

import sys
import webbrowser
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from tanteo.cli.options import misuse_of_options
from tanteo.cli.part_files import read_all_parts
from tanteo.cli.part_start import nothing_seen, start_of
from tanteo.cli.printing import emit, progress
from tanteo.cli.sensing_part import PartOptions, prepare_run
from tanteo.errors import InputError, MissingExtraError

if TYPE_CHECKING:
    from tanteo.active import Start
    from tanteo.answers import PosePrior
    from tanteo.cli.image_start import ImageOptions
    from tanteo.io import SceneFile
    from tanteo.viewer import Show

_PORTS = 65535
_TOLERANCE = 2e-3
"""Of the example's session, where none is given [m]."""


def check_view(
    record: str | None, scene: str | None, parts: Sequence[str], port: int, of_session: Mapping[str, object]
) -> None:
    """Whether what was typed can be meant, before anything is read.

    Args:
        record: of a session that is over.
        scene: of one that is played.
        parts: that it may be.
        port: of the page.
        of_session: options that a record has no use for, with what was typed for each, None or False for nothing.

    Raises:
        InputError: it cannot.
    """
    if not 0 < port <= _PORTS:
        raise InputError(f"--port: expected a number from 1 to {_PORTS}, got {port}. Use 8080.")
    if record is not None and scene is not None:
        raise InputError("--scene: expected a record or a scene, got both. Leave one out.")
    typed = [name for name, value in of_session.items() if value]
    if record is not None and typed:
        raise InputError(f"{typed[0]}: expected with a scene, got it with a record, which is over. Leave it out.")
    if scene is not None and not parts:
        raise InputError("--parts: expected the parts that it may be, got none. Name files or folders.")
    if scene is None and record is None and parts:
        raise InputError("--scene: expected one with --parts, got none. Name it, or leave out --parts for the example.")


def require_viser() -> None:
    """Whether the page can be opened, before anything is read.

    Raises:
        MissingExtraError: viser is not installed.
    """
    from tanteo.viewer import NEEDS_VISER

    if find_spec("viser") is None:
        raise MissingExtraError(NEEDS_VISER)


def view_scene(
    scene_path: str | None,
    part_paths: Sequence[str],
    options: PartOptions,
    known: PosePrior | None,
    image: ImageOptions | None,
    port: int,
    *,
    bare: bool,
    show: bool,
) -> None:
    """Play the session of a scene on a page, or that of the example."""
    from tanteo.cli.image_start import view_of
    from tanteo.io import read_scene
    from tanteo.viewer import play

    with _example(scene_path, part_paths, options) as (path, folders, chosen):
        scene = read_scene(path)
        seen = None if image is None else view_of(scene, image)
        parts = read_all_parts(folders, chosen.units, quiet=False)
    scene = replace(scene, standoff=chosen.standoff or scene.standoff)
    start = start_of(scene, parts, known, seen, chosen)
    if start is None:
        nothing_seen(as_json=False)
    make = _maker(scene, start, chosen, bare=bare)
    seed = scene.seed if chosen.seed is None else chosen.seed
    with suppress(KeyboardInterrupt):
        play(make, seed, chosen.policy, port=port, ready=lambda url: _ready(url, show=show))


def view_record(path: str, folders: Sequence[str], port: int, *, show: bool) -> None:
    """Show a record step by step."""
    from tanteo.io import load_record, parts_of, resumed
    from tanteo.viewer import replay

    record = load_record(path)
    parts = parts_of(record.parts, record.source, folders=folders)
    with progress("telling again", quiet=False) as tick:
        session = resumed(record, parts, tick)
    with suppress(KeyboardInterrupt):
        replay(session, port=port, ready=lambda url: _ready(url, show=show))


@contextmanager
def _example(
    scene: str | None, parts: Sequence[str], options: PartOptions
) -> Iterator[tuple[str | Path, Sequence[str], PartOptions]]:
    """What was named, or what is shown without."""
    if scene is not None:
        yield scene, parts, options
        return
    stop = replace(options.stop, tolerance=options.stop.tolerance or _TOLERANCE)
    with resources.as_file(resources.files("tanteo.demo")) as folder:
        yield folder / "scene.toml", [str(folder / "parts")], replace(options, stop=stop, units="mm")


def _maker(scene: SceneFile, start: Start, options: PartOptions, *, bare: bool) -> Callable[[int, str], Show]:
    def make(seed: int, policy: str) -> Show:
        now, chosen = replace(scene, seed=seed), replace(options, policy=policy)
        return (_by_probe if bare else _handed)(now, start, chosen)

    return make


def _handed(scene: SceneFile, start: Start, options: PartOptions) -> Show:
    from tanteo.execution import Furniture
    from tanteo.simulator import Scene
    from tanteo.viewer import hand_show

    with misuse_of_options():
        session, robot, rules = prepare_run(scene, start, options)
    known = Furniture(Scene.of(scene.furniture).surface) if scene.furniture else None
    truth = tuple(s for s in scene.scene.solids if s not in scene.furniture)
    return hand_show(session, robot, rules, truth, scene.furniture, known, scene.cell.robot)


def _by_probe(scene: SceneFile, start: Start, options: PartOptions) -> Show:
    from tanteo.active import policy_named
    from tanteo.session import Session
    from tanteo.simulator import Scene
    from tanteo.viewer import laser, probe_show, simulated

    probe, sensing = laser(scene.workspace)
    session = Session(start, probe, sensing, policy_named(options.policy), options.stop, scene.seed)
    truth = tuple(s for s in scene.scene.solids if s not in scene.furniture)
    furniture = Scene.of(scene.furniture).surface if scene.furniture else None
    return probe_show(session, simulated(Scene.of(truth).surface, furniture, scene.seed), truth, scene.furniture)


def _ready(url: str, *, show: bool) -> None:
    emit([f"Live page: {url} (Ctrl-C ends it)"])
    if show and sys.stdout.isatty():
        webbrowser.open(url)
