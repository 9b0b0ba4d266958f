"""``tanteo bench``: programs that place parts by touch, on the same readings, scored by one code."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tanteo.cli import arguments as args
from tanteo.cli import files, typed
from tanteo.cli.misuse import MisuseError
from tanteo.cli.printing import emit, layout, leave, progress, say
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.bench import BenchSet, Score


def _seconds(value: float) -> float:
    if not 0 < value < float("inf"):
        raise InputError(f"--limit: expected a positive number of seconds, got {value:g}. Use 60.")
    return value


def bench(
    sets: Annotated[
        list[str] | None, typer.Argument(metavar="[SET...]", help="Names of sets that --list has, or folders of sets.")
    ] = None,
    method: Annotated[
        list[str] | None,
        args.option("--method", "NAME", "One of --list, or FILE.py:function of your own."),
    ] = None,
    scenes: Annotated[
        int,
        args.option("--scenes", "N", "Scenes of each set that is made."),
        typed.Words(partial(typed.at_least, "--scenes", 1, "Use 50"), int),
    ] = 50,
    seed: Annotated[int, args.option("--seed", None, "Seed of the scenes that are made."), args.SEED] = 0,
    parts: Annotated[
        list[str] | None,
        args.option("--parts", "FILE_OR_FOLDER...", "CAD files of the sets that are made; the demo's if not given."),
    ] = None,
    units: args.Units = None,
    limit: Annotated[
        float,
        args.option("--limit", "SECONDS", "End a scene after so long."),
        typed.Words(_seconds, float),
    ] = 60.0,
    decide: Annotated[
        bool, args.option("--decide", None, "Measure also how many readings it takes until one answer is left.")
    ] = False,
    out: Annotated[str | None, args.option("--out", "FILE.json", "Write the scores.")] = None,
    picture: Annotated[
        str | None,
        args.option("--picture", "FILE.png", "Draw the share of right answers over the time that they took."),
    ] = None,
    compare: Annotated[
        list[str] | None,
        args.option("--compare", "FILE.json", "Show the scores of an earlier --out beside these; may be repeated."),
    ] = None,
    write: Annotated[
        str | None, args.option("--write", "FOLDER", "Write the one set that is named; run nothing.")
    ] = None,
    which: Annotated[bool, args.option("--list", None, "List sets and methods.")] = False,
) -> None:
    """Compare programs that find parts, on the same scenes.

    Scores say how often they are right, whether their covariances are true, how honest and how fast they are.
    """
    from tanteo.bench import read_scores, write_scores, write_set

    if which:
        _list()
        return
    if write is not None:
        made = _sets(sets or ["points"], scenes, seed, parts, units)
        if len(made) != 1:
            raise MisuseError(f"--write: expected one set, got {len(made)}. Name one.")
        write_set(made[0], write)
        say(f"{write}: {len(made[0].scenes)} scenes of {len(made[0].parts)} parts.")
        return
    files.check_target("--out", out, (".json",))
    files.check_target("--picture", picture, (".png", ".svg", ".pdf"))
    kept = [one for path in compare or () for one in read_scores(path)]
    fresh: list[Score] = []
    if sets or method or not kept:
        fresh = _run(
            _sets(sets or ["points", "normals", "few"], scenes, seed, parts, units),
            method or ["tanteo"],
            limit,
            decide=decide,
        )
    if out is not None:
        write_scores(fresh, out)
    _show(fresh + kept, picture)
    leave(decided=all(one.failures < one.scenes for one in fresh))


def _sets(names: list[str], count: int, seed: int, parts: list[str] | None, units: str | None) -> list[BenchSet]:
    from tanteo.bench import GENERATED, generate, read_set
    from tanteo.catalogue import read_parts

    own = None if parts is None else list(read_parts(parts, unit=units))
    return [
        generate(name, count, seed, own) if name in GENERATED or not os.path.isdir(name) else read_set(name)
        for name in names
    ]


def _run(sets: list[BenchSet], methods: list[str], limit: float, *, decide: bool) -> list[Score]:
    from tanteo.bench import at_work, check_method, run, score, with_decisions

    for method in methods:
        check_method(method)
    out = []
    for one in sets:
        for method in methods:
            with progress(f"{one.name}, {method}", quiet=False) as done:
                scored = score(one, _short(method), run(method, one, patience=limit, progress=done))
                if decide and scored.claimed is not None:
                    with at_work(method, one, limit) as ask:
                        scored = with_decisions(scored, one, ask, done)
                out.append(scored)
    return out


def _short(method: str) -> str:
    return Path(method).name if ":" in method else method


def _show(scores: list[Score], picture: str | None) -> None:
    from tanteo.bench import bench_picture, decision_table, score_table

    columns, *rows = score_table(scores)
    emit(layout().table(columns, rows, left=(0, 1)))
    columns, *rows = decision_table(scores)
    if rows:
        emit(["", *layout().table(columns, rows, left=(0, 1))])
    for one in scores:
        if one.why:
            say(f"{one.method}, {one.bench_set}: {one.failures} of {one.scenes} failed: {one.why}")
    if picture is not None:
        bench_picture(scores, picture)


def _list() -> None:
    from tanteo.bench import GENERATED, METHODS

    emit(layout().table(("set", "what"), [(name, recipe.words) for name, recipe in GENERATED.items()], left=(0, 1)))
    say(f"Methods: {', '.join(METHODS)}, FILE.py:function.")
