"""Implement ``tanteo bench``: compare programs that locate parts on the same readings, with the same scores."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tanteo.cli import arguments as args
from tanteo.cli import files, typed
from tanteo.cli.misuse import MisuseError
from tanteo.cli.printing import emit, layout, leave, print_text, progress
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.bench.scoring import Score
    from tanteo.bench.sets import BenchSet


def _seconds(value: float) -> float:
    if not 0 < value < float("inf"):
        raise InputError(f"--limit: expected a positive number of seconds, got {value:g}. Use 60.")
    return value


def bench(
    sets: Annotated[
        list[str] | None, typer.Argument(metavar="[SET...]", help="Names of sets from --list, or folders of sets.")
    ] = None,
    method: Annotated[
        list[str] | None,
        args.option("--method", "NAME", "Method from --list, or your own as FILE.py:function."),
    ] = None,
    scenes: Annotated[
        int,
        args.option("--scenes", "N", "Number of scenes of each generated set."),
        typed.Words(partial(typed.at_least, "--scenes", 1, "Use 50"), int),
    ] = 50,
    seed: Annotated[int, args.option("--seed", None, "Seed of the generated scenes."), args.SEED] = 0,
    parts: Annotated[
        list[str] | None,
        args.option("--parts", "FILE_OR_FOLDER...", "CAD files of the generated sets; those of the demo if not given."),
    ] = None,
    units: args.Units = None,
    limit: Annotated[
        float,
        args.option("--limit", "SECONDS", "Longest time for a scene."),
        typed.Words(_seconds, float),
    ] = 60.0,
    decide: Annotated[
        bool, args.option("--decide", None, "Also measure the number of readings until one answer remains.")
    ] = False,
    out: Annotated[str | None, args.option("--out", "FILE.json", "Write the scores.")] = None,
    picture: Annotated[
        str | None,
        args.option("--picture", "FILE.png", "Draw the fraction of right answers over their time."),
    ] = None,
    compare: Annotated[
        list[str] | None,
        args.option("--compare", "FILE.json", "Also show the scores of an earlier --out; may be repeated."),
    ] = None,
    write: Annotated[
        str | None, args.option("--write", "FOLDER", "Write the named set without running anything.")
    ] = None,
    which: Annotated[bool, args.option("--list", None, "List sets and methods.")] = False,
) -> None:
    """Compare programs that locate parts, on the same scenes.

    The scores are accuracy, consistency of the covariances, calibration of the probabilities, and time.
    """
    from tanteo.bench import write_set
    from tanteo.bench.tables import read_scores, write_scores

    if which:
        _list()
        return
    if write is not None:
        made = _sets(sets or ["points"], scenes, seed, parts, units)
        if len(made) != 1:
            raise MisuseError(f"--write: expected one set, got {len(made)}. Name one.")
        write_set(made[0], write)
        print_text(f"{write}: {len(made[0].scenes)} scenes of {len(made[0].parts)} parts.")
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
    from tanteo.bench.running import at_work, check_method, run
    from tanteo.bench.scoring import score, with_decisions

    for method in methods:
        check_method(method)
    out = []
    for one in sets:
        for method in methods:
            with progress(f"{one.name}, {method}", quiet=False) as done:
                scored = score(one, _short(method), run(method, one, patience=limit, progress=done))
                if decide and scored.claimed is not None:
                    with at_work(method, one, limit) as query:
                        scored = with_decisions(scored, one, query, done)
                out.append(scored)
    return out


def _short(method: str) -> str:
    return Path(method).name if ":" in method else method


def _show(scores: list[Score], picture: str | None) -> None:
    from tanteo.bench.tables import bench_picture, decision_table, score_table

    columns, *rows = score_table(scores)
    emit(layout().table(columns, rows, left=(0, 1)))
    columns, *rows = decision_table(scores)
    if rows:
        emit(["", *layout().table(columns, rows, left=(0, 1))])
    for one in scores:
        if one.why:
            print_text(f"{one.method}, {one.bench_set}: {one.failures} of {one.scenes} failed: {one.why}")
    if picture is not None:
        bench_picture(scores, picture)


def _list() -> None:
    from tanteo.bench import GENERATED
    from tanteo.bench.running import METHODS

    emit(layout().table(("set", "what"), [(name, recipe.words) for name, recipe in GENERATED.items()], left=(0, 1)))
    print_text(f"Methods: {', '.join(METHODS)}, FILE.py:function.")
