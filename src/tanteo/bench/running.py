"""Run a method on the scenes of a set in a process of its own, so that a crash costs one scene only.

A method is a function that makes a solver of the candidates: ``method(candidates)`` returns ``solve(scene)``, which
returns placements, best first, or none for an unknown object. The solver does not receive the true pose.
"""

from __future__ import annotations

import importlib.util
import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from tanteo.bench import rivals
from tanteo.bench.sets import BenchScene, BenchSet, Candidate, Placement
from tanteo.errors import InputError, TanteoError

Solver: TypeAlias = Callable[[BenchScene], Sequence[Placement]]
Method: TypeAlias = Callable[[tuple[Candidate, ...]], Solver]

METHODS: dict[str, Method] = {
    "tanteo": rivals.tanteo,
    "small_gicp": rivals.small_gicp,
    "opencv": rivals.opencv,
    "open3d": rivals.open3d,
    "trimesh": rivals.trimesh,
}
"""Methods by name; others are given as ``FILE.py:function``."""

PATIENCE = 60.0
"""Default time limit of a scene [s]."""

_PREPARING = 10.0
"""Factor on the time limit of a scene for the preparation of the candidates."""

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """Result of a method on one scene.

    Attributes:
        placements: answers, best first.
        seconds: time without the preparation [s].
        failure: reason for a missing answer (exception, crash, time limit, wrong type); otherwise empty.
    """

    placements: tuple[Placement, ...]
    seconds: float
    failure: str = ""


def check_method(name: str) -> None:
    """Check that a text names a method of the benchmark or a function in a file.

    Args:
        name: name of a method, or ``FILE.py:function``.

    Raises:
        InputError: the text names neither; the message lists the methods.
    """
    if name in METHODS:
        return
    path, _, function = name.rpartition(":")
    if not path or not function.isidentifier() or not Path(path).is_file():
        raise InputError(
            f"--method: expected one of {', '.join(METHODS)} or FILE.py:function, got '{name}'. The function gets the "
            "candidates and returns a solver; docs/bench.md shows one."
        )


def run(
    name: str, bench_set: BenchSet, *, patience: float = PATIENCE, progress: Callable[[int, int], None] | None = None
) -> list[Outcome]:
    """Run a method on every scene of a set, on one thread, in a process of its own.

    Args:
        name: name of the method, or ``FILE.py:function``.
        bench_set: set of scenes.
        patience: time limit of a scene [s].
        progress: function called with the numbers of finished and of all scenes.

    Raises:
        InputError: the method is unknown.

    Example:
        >>> some = tanteo.bench.generate("normals", 1)
        >>> [outcome] = tanteo.bench.running.run("tanteo", some)
        >>> outcome.failure, outcome.placements[0].part == some.scenes[0].truth
        ('', True)
    """
    out: list[Outcome] = []
    with at_work(name, bench_set, patience) as solve_scene:
        for k, scene in enumerate(bench_set.scenes):
            out.append(solve_scene(scene))
            if progress is not None:
                progress(k + 1, len(bench_set.scenes))
    return out


@contextmanager
def at_work(name: str, bench_set: BenchSet, patience: float) -> Iterator[Callable[[BenchScene], Outcome]]:
    """Yield a function that runs a method on a scene; its process is restarted after it ended."""
    check_method(name)
    candidates = tuple(Candidate(part.name, part.vertices, part.triangles, part) for part in bench_set.parts)
    worker = _Worker(name, candidates, patience)

    def solve_scene(scene: BenchScene) -> Outcome:
        nonlocal worker
        if not worker.refused and not worker.alive:
            worker = _Worker(name, candidates, patience)
        return worker.solve_scene(replace(scene, truth=None, T_world_part=None), patience)

    try:
        yield solve_scene
    finally:
        worker.end()


class _Worker:
    """A process that has a method and its prepared candidates."""

    def __init__(self, name: str, candidates: tuple[Candidate, ...], patience: float) -> None:
        context = multiprocessing.get_context("spawn")
        self.mine, its = context.Pipe()
        self.process = context.Process(target=_work, args=(its, name, candidates), daemon=True)
        with _one_thread():
            self.process.start()
        its.close()
        self.refused = self._answer(_PREPARING * patience)

    @property
    def alive(self) -> bool:
        return self.process.is_alive()

    def solve_scene(self, scene: BenchScene, patience: float) -> Outcome:
        if self.refused:
            return Outcome((), 0.0, self.refused)
        self.mine.send(scene)
        start = time.perf_counter()
        answer = self._answer(patience)
        if isinstance(answer, str):
            if answer.startswith(("did not", "ended")):
                self.end()
            return Outcome((), time.perf_counter() - start, answer)
        return answer

    def _answer(self, patience: float) -> Any:
        try:
            if not self.mine.poll(patience):
                return f"did not end within {patience:g} s"
            return self.mine.recv()
        except (EOFError, OSError):
            self.process.join(5)
            return f"ended by itself (exit code {self.process.exitcode})"

    def end(self) -> None:
        self.mine.close()
        self.process.kill()
        self.process.join(5)


@contextmanager
def _one_thread() -> Iterator[None]:
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None) if value is None else os.environ.update({name: value})


def _work(pipe: Connection, name: str, candidates: tuple[Candidate, ...]) -> None:
    """Prepare the method, then solve scene by scene; this is the main function of the process."""
    _hush()
    try:
        solve = _loaded(name)(candidates)
    except Exception as error:  # noqa: BLE001 - any exception of a method is its result
        pipe.send(f"could not be prepared: {_reason(error)}")
        return
    pipe.send("")
    while True:
        try:
            scene = pipe.recv()
        except EOFError:
            return
        start = time.perf_counter()
        try:
            placements = tuple(solve(scene))
            seconds = time.perf_counter() - start
            _check(placements, candidates)
            pipe.send(Outcome(placements, seconds))
        except Exception as error:  # noqa: BLE001
            pipe.send(_reason(error))


def _hush() -> None:
    """Nothing of what a method or its libraries print: some print a line a call."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)


def _reason(error: Exception) -> str:
    return str(error) if isinstance(error, TanteoError) else f"{type(error).__name__}: {error}"


def _loaded(name: str) -> Method:
    if name in METHODS:
        return METHODS[name]
    path, _, function = name.rpartition(":")
    spec = importlib.util.spec_from_file_location("tanteo_bench_method", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    method: Method = getattr(module, function)
    return method


def _check(placements: tuple[Placement, ...], candidates: tuple[Candidate, ...]) -> None:
    """Refuse what is no answer: other types, poses that are none, covariances that are none."""
    names = {one.name for one in candidates}
    for one in placements:
        if not isinstance(one, Placement) or one.part not in names:
            raise InputError(f"answer: expected Placement of one of {', '.join(sorted(names))}, got {one!r}.")
        T = np.asarray(one.T_world_part, dtype=np.float64)
        R = T[:3, :3] if T.shape == (4, 4) else np.zeros((3, 3))
        if not (np.isfinite(T).all() and np.allclose(R.T @ R, np.eye(3), atol=1e-4) and np.linalg.det(R) > 0):
            raise InputError(f"answer: expected a rigid motion 4 x 4 [m], got {T.tolist()}.")
        if one.covariance is not None:
            C = np.asarray(one.covariance, dtype=np.float64)
            if C.shape != (6, 6) or not np.isfinite(C).all():
                raise InputError(f"answer: expected a finite covariance 6 x 6, got shape {C.shape}.")
        if one.probability is not None and not 0 <= one.probability <= 1 + 1e-9:
            raise InputError(f"answer: expected a probability from 0 to 1, got {one.probability}.")
