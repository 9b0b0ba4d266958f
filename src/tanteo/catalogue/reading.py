"""Read parts from files and folders in parallel, with an error message for every file that could not be read."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import overload

from tanteo.catalogue import cache as remembered
from tanteo.catalogue.pool import Request, read_in_processes
from tanteo.catalogue.store import is_catalogue
from tanteo.catalogue.worker import attempt
from tanteo.errors import InputError, PartError, UnitError, check_kind
from tanteo.parts import Part, read_part
from tanteo.parts.readers import check_file, is_unitless, readable_suffixes, split_body, unit_name
from tanteo.values import FEW, Value, html_table

FEW_MESHES, SMALL_FILE = 16, 300_000
"""Largest number and size [bytes] of mesh files that are read in this process."""

_BYTES_PER_START = 2_000_000
"""Numerical: size of the STEP files that one process reads while another one starts [bytes], in 1 s of processor time
(``python benchmarks/reading.py``)."""

_SHOWN = 20
"""Number of parts or failures that a notebook shows: one screen."""

_MESHES = (".stl", ".obj", ".ply", ".off", ".3mf")
"""Suffixes of mesh files whose readers never crash or hang; readers of plug-ins may."""


@dataclass(frozen=True, slots=True, eq=False)
class Failure:
    """File that could not be read.

    Attributes:
        path: path as given or found.
        reason: error message for the user.
    """

    path: str
    reason: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Parts(Value, Sequence[Part]):
    """Parts read from files: a sequence of parts, which may also be found by name.

    Attributes:
        parts: parts in the order of the files, with unique names.
        failures: files that could not be read, in the same order.
    """

    parts: tuple[Part, ...]
    failures: tuple[Failure, ...]

    def __len__(self) -> int:
        return len(self.parts)

    def __iter__(self) -> Iterator[Part]:
        return iter(self.parts)

    def __contains__(self, part: object) -> bool:
        return any(one is part or one.name == part for one in self.parts)

    @overload
    def __getitem__(self, key: int | str) -> Part: ...

    @overload
    def __getitem__(self, key: slice) -> tuple[Part, ...]: ...

    def __getitem__(self, key: int | str | slice) -> Part | tuple[Part, ...]:
        """Return a part by its name or number, or several parts by a slice.

        Raises:
            InputError: there is no part with this name.
            IndexError: there is no part with this number.
        """
        if not isinstance(key, str):
            return self.parts[key]
        for part in self.parts:
            if part.name == key:
                return part
        known = ", ".join(part.name for part in self.parts[:10])
        raise InputError(f"name: expected one of {known}, got {key!r}. Check the names of the parts.")

    def __repr__(self) -> str:
        names = ", ".join(part.name for part in self.parts[:FEW])
        more = f", {len(self.parts) - FEW} more" if len(self.parts) > FEW else ""
        return f"Parts({names}{more}; failures: {len(self.failures)})"

    def _repr_html_(self) -> str:
        shown = self.parts[:_SHOWN]
        rows = [(part.name, *part.summary().values()) for part in shown]
        more = [f"{len(self) - len(shown)} more parts."] if len(self) > len(shown) else []
        notes = more + [f"{one.path}: {one.reason}" for one in self.failures[:_SHOWN]]
        headers = ["part", *(shown[0].summary() if shown else ())]
        return html_table(f"{len(self)} parts", headers, rows, " ".join(notes))


def read_parts(
    paths: Iterable[str | os.PathLike[str]] | str | os.PathLike[str],
    *,
    unit: str | None = None,
    workers: int | None = None,
    cache: bool = True,
    progress: Callable[[int, int], None] | None = None,
    time_limit: float | None = None,
) -> Parts:
    """Read CAD files and folders of CAD files.

    STEP, IGES and GLB files and large sets are read in worker processes, so that a file that crashes the CAD kernel,
    never ends or exhausts the memory does not affect the others.

    Args:
        paths: files, and folders whose readable files are used in alphabetical order (without subfolders).
        unit: length unit of files that carry none (STL, OBJ, PLY, OFF); required if there are such files. If there are
            none, it overrides the files' own units, and their repairs state that.
        workers: number of reading processes; None for one per processor, fewer for small files; 0 to read in this
            process.
        cache: whether to use the cache on disk.
        progress: function called after each file with the number of files done and the total number.
        time_limit: time limit for one file [s]; None for one by file size; not enforced with ``workers=0``.

    Returns:
        Parts and failures. Parts whose files have the same stem are named by more of their path.

    Raises:
        UnitError: the unit is unknown, or missing while some file needs one.

    Example:
        >>> found = tanteo.read_parts("parts/")
        >>> len(found), found["block"].name
        (12, 'block')
    """
    files, requests, failures = requested(paths, unit)
    results: dict[int, Part | str] = {}

    def on_result(index: int, result: Part | str) -> None:
        results[index] = result
        if progress is not None:
            progress(len(results), len(files))

    keys = [remembered.cache_key(Path(one.path), one.unit) if cache else None for one in requests]
    for index, (request, key) in enumerate(zip(requests, keys, strict=True)):
        found = remembered.load(key, name=request.name, source=request.path) if key else None
        if found is not None:
            on_result(index, found)
    todo = {index: request for index, request in enumerate(requests) if index not in results}

    def fresh(index: int, result: Part | str) -> None:
        key = keys[index]
        if key and isinstance(result, Part):
            remembered.store(key, result)
        on_result(index, result)

    for index in read_inline(todo, workers):
        fresh(index, _read_here(todo.pop(index)))
    if todo:
        read_in_processes(todo, fresh, workers=_worker_count(todo, workers), time_limit=time_limit)
    parts = [result for _, result in sorted(results.items()) if isinstance(result, Part)]
    failed = [Failure(str(files[i]), result) for i, result in sorted(results.items()) if isinstance(result, str)]
    return Parts(tuple(parts), (*failures, *failed))


def _worker_count(todo: Mapping[int, Request], workers: int | None) -> int:
    """Return the number of processes for some requests: by default, no more than their start is worth."""
    size = sum(split_body(request.path)[0].stat().st_size for request in todo.values())
    return min(len(todo), workers or min(os.cpu_count() or 1, 1 + size // _BYTES_PER_START))


def requested(
    paths: Iterable[str | os.PathLike[str]] | str | os.PathLike[str], unit: str | None, taken: Iterable[str] = ()
) -> tuple[list[Path], list[Request], list[Failure]]:
    """Return the files to read, a request for each, and failures for invalid paths.

    Args:
        paths: files and folders.
        unit: length unit of files that carry none.
        taken: names that other parts have.

    Raises:
        UnitError: the unit is unknown, or missing while some file needs one.
    """
    if not isinstance(paths, (str, os.PathLike)):
        check_kind("paths", paths, Iterable, "Name a file or a folder, or several.")
    files, failures = _collect([paths] if isinstance(paths, (str, os.PathLike)) else paths)
    short = None if unit is None else unit_name(unit)
    needy = {file for file in files if is_unitless(file.suffix)}
    if needy and short is None:
        first = next(file for file in files if file in needy)
        others = f" and {len(needy) - 1} more" if len(needy) > 1 else ""
        raise UnitError(
            f"unit: expected the length unit of {first.name}{others}, got none; its format states none. "
            "Pass unit='mm' (or um, cm, m, in, ft)."
        )
    # If some files need a unit, it applies only to them; the others keep their own.
    units = [short if file in needy or not needy else None for file in files]
    named = zip(files, units, _names(files, set(taken)), strict=True)
    return files, [Request(str(f), u, name) for f, u, name in named], failures


def _collect(paths: Iterable[str | os.PathLike[str]]) -> tuple[list[Path], list[Failure]]:
    """Return the files to read, each once, and failures for invalid paths."""
    files: dict[str, Path] = {}
    failures = []
    for given in map(Path, paths):
        if given.is_dir():
            try:
                found, nowhere = _inside(given)
            except OSError as error:
                why = error.strerror or error
                reason = f"{given}: expected a folder that may be read, got: {why}. Check its permissions."
                failures.append(Failure(str(given), reason))
                continue
            reason = "expected a file, got a broken link or a device. Repair or remove it."
            failures += [Failure(str(file), f"{file}: {reason}") for file in nowhere]
            for real, file in found.items():
                files.setdefault(real, file)
            if not found and not nowhere:
                kinds = ", ".join(readable_suffixes())
                reason = f"{given}: expected CAD files ({kinds}), got none in this folder{_deeper(given)}."
                if is_catalogue(given):
                    reason = f"{given}: expected CAD files, got a catalogue. tanteo.open_catalogue('{given}') opens it."
                failures.append(Failure(str(given), reason))
            continue
        try:
            check_file(given, str(given))
        except PartError as error:
            failures.append(Failure(str(given), str(error)))
        else:
            files.setdefault(os.path.realpath(given), given)
    return list(files.values()), failures


_WALKED = 1000
"""Largest number of folders searched for CAD files, for advice in a message."""


def _deeper(folder: Path) -> str:
    """Return advice for a folder without CAD files, which names a subfolder that has some."""
    readable = readable_suffixes()
    for path, _, names in islice(os.walk(folder), _WALKED):
        if any(os.path.splitext(name)[1].lower() in readable for name in names):
            return f", but in {path}: folders within a folder are not read. Name each of them, or their files"
    return ". Name files, or another"


def _inside(folder: Path) -> tuple[dict[str, Path], list[Path]]:
    """Return the readable files of a folder by real path, and the broken links and devices."""
    root = os.path.realpath(folder)
    readable = readable_suffixes()
    with os.scandir(folder) as every:
        named = [e for e in every if os.path.splitext(e.name)[1].lower() in readable]
    entries = [e for e in named if not os.path.isdir(e.path)]
    files: dict[str, Path] = {}
    nowhere = []
    for entry in sorted(entries, key=lambda e: e.name):
        if not os.path.isfile(entry.path):
            nowhere.append(folder / entry.name)
            continue
        real = os.path.realpath(entry.path) if entry.is_symlink() else os.path.join(root, entry.name)
        files.setdefault(real, folder / entry.name)
    return files, nowhere


def _stem(file: Path) -> str:
    """Return the stem of a file, with the body that its path selects."""
    whole, body = split_body(file)
    return f"{whole.stem}#{body}" if body else whole.stem


def _names(files: list[Path], others: set[str]) -> list[str]:
    """Return a unique name for each file: its stem, extended by as much of the path as necessary."""
    longer: list[Callable[[Path], str]] = [_stem, lambda file: file.name]
    longer += [lambda file: f"{file.resolve().parent.name}/{file.name}", lambda file: str(file.resolve())]
    names: dict[Path, str] = {}
    for naming in longer:
        waiting = {file: naming(file) for file in files if file not in names}
        counts = Counter(waiting.values())
        taken = others.union(names.values())
        names.update({file: name for file, name in waiting.items() if counts[name] == 1 and name not in taken})
    return [names.get(file) or str(file.resolve()) for file in files]


def read_inline(todo: dict[int, Request], workers: int | None) -> list[int]:
    """Return the requests to read in this process: all with ``workers=0``, otherwise a few small meshes.

    Args:
        todo: requests by number.
        workers: number of reading processes; None for one per processor.
    """
    if workers == 0:
        return list(todo)
    meshes = [index for index, request in todo.items() if request.path.lower().endswith(_MESHES)]
    small = [index for index in meshes if Path(todo[index].path).stat().st_size <= SMALL_FILE]
    return small if len(meshes) <= FEW_MESHES else []


def _read_here(request: Request) -> Part | str:
    return attempt(read_part, request.path, request.unit, request.name)
