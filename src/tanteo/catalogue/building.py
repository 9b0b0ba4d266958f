"""Build or update a catalogue: unchanged files are not read again.

The old catalogue stays valid until the new one is complete.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

from tanteo.catalogue.cache import cache_key
from tanteo.catalogue.cluster.work import check_scheduler
from tanteo.catalogue.opened import Catalogue, open_catalogue
from tanteo.catalogue.plan import NO_KEY, Plan, by_source, named
from tanteo.catalogue.pool import Request, read_in_processes
from tanteo.catalogue.reading import Failure, read_inline, requested
from tanteo.catalogue.record import Record
from tanteo.catalogue.segment import MOST, SegmentWriter
from tanteo.catalogue.spreading import read_on_cluster
from tanteo.catalogue.store import LOCK, MANIFEST, is_catalogue, sweep, write_manifest, writer
from tanteo.catalogue.worker import attempt, read_record
from tanteo.errors import InputError, PartError

Paths: TypeAlias = Iterable[str | os.PathLike[str]] | str | os.PathLike[str]


@dataclass(frozen=True, slots=True, eq=False)
class Built:
    """Result of building a catalogue.

    Attributes:
        parts: number of parts in the catalogue.
        read: number of files that were read.
        kept: number of parts taken over from unchanged files.
        dropped: number of parts that were removed.
        failures: files that could not be read.
    """

    parts: int
    read: int
    kept: int
    dropped: int
    failures: tuple[Failure, ...]


def build_catalogue(
    paths: Paths,
    out: str | os.PathLike[str],
    *,
    unit: str | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Built:
    """Build a catalogue of CAD files, or update an existing one; parts of other files are removed.

    Args:
        paths: files, and folders whose readable files are used (without subfolders).
        out: folder of the catalogue; a new one, or one that contains a catalogue.
        unit: length unit of files that carry none (STL, OBJ, PLY, OFF); None if there are none.
        workers: number of reading processes; None for one per processor; 0 to read in this process.
        scheduler: address of a Dask scheduler whose workers read instead, ``tcp://HOST:PORT`` or ``local:N``; the
            workers must see the files under the same paths. None to read on this machine.
        progress: function called after each file with the number of files done and the total number.

    Raises:
        InputError: another process writes to the catalogue, the folder has other content, the disk is full, or the
            scheduler does not answer or has no workers.
        PartError: no file can be read.
        UnitError: the unit is unknown or missing, see :func:`tanteo.read_parts`.

    Example:
        >>> from tanteo.catalogue.building import build_catalogue
        >>> built = build_catalogue("parts/", "catalogue")
        >>> built.parts, built.read, build_catalogue("parts/", "catalogue").read
        (12, 12, 0)
    """
    return _written(paths, Path(out), unit, _Reader(workers, scheduler, progress), adding=False)


def add_to_catalogue(
    paths: Paths,
    out: str | os.PathLike[str],
    *,
    unit: str | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Built:
    """Add the parts of CAD files to a catalogue; a changed file replaces its old part.

    Args:
        paths: files and folders, see :func:`build_catalogue`.
        out: folder of an existing catalogue.
        unit: length unit of files that carry none.
        workers: number of reading processes.
        scheduler: address of a Dask scheduler whose workers read instead.
        progress: function called after each file with the number of files done and the total number.

    Raises:
        InputError: there is no catalogue, or see :func:`build_catalogue`.

    Example:
        >>> from tanteo.catalogue.building import add_to_catalogue, build_catalogue
        >>> built = build_catalogue("parts/block.step", "catalogue")
        >>> add_to_catalogue("parts/wedge.step", "catalogue").parts
        2
    """
    open_catalogue(out)
    return _written(paths, Path(out), unit, _Reader(workers, scheduler, progress), adding=True)


@dataclass(frozen=True, slots=True)
class _Reader:
    """Method of reading files: in this process, in worker processes, or on a cluster."""

    workers: int | None
    scheduler: str | None
    progress: Callable[[int, int], None] | None

    def read(self, todo: dict[int, Request], on_result: Callable[[int, Any], None]) -> None:
        """Read files in any order.

        Args:
            todo: requests by index.
            on_result: function called with index and result of each file.
        """
        if self.scheduler is not None and todo:
            read_on_cluster(todo, on_result, self.scheduler)
            return
        for index in sorted(read_inline(todo, self.workers)):
            one = todo.pop(index)
            on_result(index, attempt(partial(read_record, one.key), one.path, one.unit, one.name))
        if todo:
            read_in_processes(todo, on_result, workers=min(len(todo), self.workers or os.cpu_count() or 1))


def _written(paths: Paths, folder: Path, unit: str | None, reader: _Reader, *, adding: bool) -> Built:
    if reader.scheduler is not None:
        check_scheduler(reader.scheduler)
    _check_place(folder)
    with writer(folder), _disk_errors(folder):
        old = _old(folder, adding=adding)
        taken = old.names if adding and old is not None else ()
        known = by_source(old) if adding and old is not None else {}
        _, requests, failures = requested(paths, unit, () if adding else taken)
        # absolute paths keep their meaning when the next writer starts in another folder
        requests = [replace(one, path=os.path.abspath(one.path)) for one in named(requests, known, set(taken))]
        keys = [cache_key(Path(one.path), one.unit) or NO_KEY for one in requests]
        plan = Plan(old, requests, keys, adding=adding)
        stated = [os.path.abspath(path) for path in ([paths] if isinstance(paths, (str, os.PathLike)) else paths)]
        kept = old.manifest["segments"] if old is not None else []
        output = _Output(folder)
        try:
            lost = _read(plan, output, reader)
            failures += lost
            new = output.closed()
            count = plan.in_place + sum(segment["parts"] for segment in new)
            if not count:
                raise PartError(_nothing(folder, failures))
            dropped = (len(old) if old is not None else 0) - plan.kept
            if new or dropped or old is None:
                everywhere = dict.fromkeys([*(old.paths if adding and old is not None else ()), *stated])
                kept = [segment.known for segment in plan.whole] + new
                write_manifest(folder, kept, paths=list(everywhere))
        finally:
            output.drop()
            sweep(folder, kept)
    return Built(count, len(plan.todo) - len(lost), plan.kept, max(dropped, 0), tuple(failures))


class _Output:
    """Writer of consecutive segments."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._now: SegmentWriter | None = None
        self._done: list[dict[str, Any]] = []

    def add(self, record: Record, key: str) -> None:
        """Append a part.

        Args:
            record: part to write.
            key: hash of its file.
        """
        if self._now is None:
            self._now = SegmentWriter(self._folder)
        self._now.add(record, key)
        if len(self._now) == MOST:
            self._end()

    def closed(self) -> list[dict[str, Any]]:
        """Finish the last segment and return the manifest entries of all new segments."""
        self._end()
        return self._done

    def drop(self) -> None:
        """Discard the unfinished segment."""
        if self._now is not None:
            self._now.drop()

    def _end(self) -> None:
        if self._now is not None:
            self._done.append(self._now.close())
            self._now = None


def _read(plan: Plan, output: _Output, reader: _Reader) -> list[Failure]:
    """Write the copied and the read parts in the order of the requests; return the files that could not be read."""
    for (segment, row), request in plan.copied:
        record = segment.record(row)
        if request is not None:
            record = replace(record, name=request.name, source=request.path)
        output.add(record, segment.key(row))
    todo = dict(plan.todo)
    waiting = dict[int, Record | str]()
    failures = list[Failure]()
    order = iter(sorted(todo))
    done = len(plan.requests) - len(todo)
    following = next(order, None)

    def on_result(index: int, result: Record | str) -> None:
        nonlocal following, done
        waiting[index] = result
        done = done + 1
        while following in waiting:
            found = waiting.pop(following)
            if isinstance(found, str):
                failures.append(Failure(plan.requests[following].path, found))
            else:
                output.add(found, plan.keys[following])
            following = next(order, None)
        if reader.progress is not None:
            reader.progress(done, len(plan.requests))

    reader.read(todo, on_result)
    return failures


def _old(folder: Path, *, adding: bool) -> Catalogue | None:
    """Return the existing catalogue; None if there is none or it is unusable and will be rebuilt."""
    if not is_catalogue(folder):
        return None
    try:
        return open_catalogue(folder)
    except InputError:
        if adding:
            raise
        return None


def _check_place(folder: Path) -> None:
    """Refuse a folder with other content: a catalogue needs its own folder."""
    if not folder.is_dir() or is_catalogue(folder):
        return
    own = {MANIFEST, LOCK}
    others = [
        one.name for one in folder.iterdir() if one.name not in own and not one.name.startswith(("segment-", "."))
    ]
    if others:
        raise InputError(
            f"{folder}: expected a catalogue or an empty folder to make one in, got '{sorted(others)[0]}' in it. "
            "Choose another folder."
        )


def _nothing(folder: Path, failures: list[Failure]) -> str:
    if len(failures) == 1:
        return failures[0].reason
    return f"{folder}: expected at least one part that can be read, got none of {len(failures)}. Check their files."


@contextmanager
def _disk_errors(folder: Path) -> Iterator[None]:
    """Convert errors of the operating system to advice; the old catalogue is unchanged."""
    try:
        yield
    except OSError as error:
        why = error.strerror or error
        raise InputError(f"{folder}: expected space to write a catalogue, got: {why}. Nothing was changed.") from None
