"""Read PCD point clouds of PCL (ascii and binary); the column functions also serve PLY."""

from __future__ import annotations

import numpy as np

from tanteo.geometry.typing import FloatArray
from tanteo.io.logs.contents import Contents, is_whole
from tanteo.io.logs.log import Log, counted

PLACE, NORMALS = ("x", "y", "z"), (("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z"))
_LONGEST_HEADER = 10_000
_MOST_NUMBERS = 10_000
"""Largest accepted number of values per point; feature histograms have some hundreds."""

_LAST = 50
"""Number of rows whose decimals are compared with those of the last number."""

_KEYS = ("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")
_LETTERS = {"F": "f", "I": "i", "U": "u"}


def recognise(contents: Contents) -> bool:
    """Return whether the file starts with a PCD header.

    Args:
        contents: file to test.
    """
    start = contents.data[:400]
    return start.startswith((b"# .PCD", b"VERSION")) and b"FIELDS" in start


def read(contents: Contents) -> Log:
    """Return the finite points of a PCD file; a note counts the others, which are gaps in organized clouds.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: the file is malformed.
    """
    start, head = _header(contents)
    names, sizes, kinds = (head.get(key, []) for key in ("FIELDS", "SIZE", "TYPE"))
    counts = head.get("COUNT", ["1"] * len(names))
    words = [*sizes, *counts, *head.get("POINTS", [""])]
    if not len(names) == len(sizes) == len(kinds) == len(counts) or not all(is_whole(w) for w in words):
        contents.fail("FIELDS, SIZE, TYPE, COUNT and POINTS that agree", "others", "Export it again.")
    if sum(int(n) for n in counts) > _MOST_NUMBERS:
        contents.fail(f"a COUNT of up to {_MOST_NUMBERS} in all", " ".join(counts)[:60], "Export it again.")
    encoding = (head.get("DATA") or [""])[0]
    total = int(words[-1])
    if encoding == "ascii":
        wide = [f"{name}.{k}" if k else name for name, n in zip(names, counts, strict=True) for k in range(int(n))]
        values = text_columns(contents, contents.data[start:], wide, total)
    elif encoding == "binary":
        dtype = _dtype(contents, names, sizes, kinds, counts)
        values = columns(contents, contents.data[start:], dtype, total)
    else:
        contents.fail(
            "DATA ascii or binary", f"'{encoding}'", "Convert it: pcl_convert_pcd_ascii_binary in.pcd out.pcd 1."
        )
    notes = []
    if (viewpoint := head.get("VIEWPOINT", [])[:3]) and any(word.strip("0.-") for word in viewpoint):
        place = ",".join(viewpoint)
        notes.append(
            f"VIEWPOINT {place} was not used. Use --direction from:{place}UNIT if the points were seen from there."
        )
    return of_columns(contents, values, notes)


def _header(contents: Contents) -> tuple[int, dict[str, list[str]]]:
    head: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in head:
        end = contents.data.find(b"\n", start, _LONGEST_HEADER)
        if end < 0:
            contents.fail("a header that ends in DATA", "none", "Is this the whole file?")
        words = contents.data[start:end].decode("latin-1").split()
        start = end + 1
        if words and words[0] in _KEYS:
            head[words[0]] = words[1:]
    return start, head


def _dtype(contents: Contents, names: list[str], sizes: list[str], kinds: list[str], counts: list[str]) -> np.dtype:
    try:
        return np.dtype(
            [
                (
                    f"{name}#{i}" if names.count(name) > 1 else name,
                    f"<{_LETTERS[kind]}{size}",
                    (int(n),) if n != "1" else (),
                )
                for i, (name, size, kind, n) in enumerate(zip(names, sizes, kinds, counts, strict=True))
            ]
        )
    except (KeyError, TypeError, ValueError):
        contents.fail(
            "TYPE F, I or U with a SIZE of theirs", f"{' '.join(kinds)}, {' '.join(sizes)}", "Export it again."
        )


def columns(contents: Contents, body: bytes, dtype: np.dtype, count: int) -> dict[str, FloatArray]:
    """Return columns of binary rows.

    Args:
        contents: file, for messages.
        body: bytes after the header.
        dtype: type of a row.
        count: number of rows that the header states.

    Raises:
        ReadingsError: there are fewer rows.
    """
    if count * dtype.itemsize > len(body):
        contents.fail(f"{count} points of {dtype.itemsize} bytes", f"{len(body)} bytes", "Is this the whole file?")
    rows = np.frombuffer(body, dtype, count)
    wanted = [name for name in (*PLACE, *NORMALS[0], *NORMALS[1]) if name in (dtype.names or ())]
    return {name: np.asarray(rows[name], dtype=np.float64) for name in wanted}


def text_columns(contents: Contents, body: bytes, names: list[str], count: int) -> dict[str, FloatArray]:
    """Return columns of text rows; later lines are part of other elements and are ignored.

    Args:
        contents: file, for messages.
        body: bytes after the header.
        names: names of the columns.
        count: number of rows that the header states.

    Raises:
        ReadingsError: there are fewer rows, or a word is not a number.
    """
    if count > len(body):
        contents.fail(f"{count} points", f"{len(body)} bytes", "Is this the whole file?")
    lines = [line for line in body.decode("latin-1").split("\n", count)[:count] if line.strip()]
    if len(lines) < count:
        contents.fail(f"{count} points", f"{len(lines)} lines", "Is this the whole file?")
    wanted = [name for name in (*PLACE, *NORMALS[0], *NORMALS[1]) if name in names]
    try:
        values = np.loadtxt(lines, ndmin=2, comments=None, usecols=[names.index(name) for name in wanted])
    except ValueError as error:
        contents.fail(f"numbers ({' '.join(names)}) in each line", str(error)[:100], "Export it again.")
    if body.count(b"\n") < count:
        contents.check_last([line.split()[-1] for line in lines[-_LAST:]], len(contents.lines))
    return dict(zip(wanted, values.T, strict=True))


def of_columns(contents: Contents, values: dict[str, FloatArray], notes: list[str]) -> Log:
    """Return a log of a cloud's columns without points that are not finite.

    Args:
        contents: file, for messages.
        values: columns by name.
        notes: notes collected so far.

    Raises:
        ReadingsError: x, y or z is missing, or no point is finite.
    """
    if not set(PLACE) <= values.keys():
        contents.fail("fields x, y, z", f"{', '.join(values) or 'none'}", "Export it as a cloud.")
    points = np.stack([values[name] for name in PLACE], axis=-1)
    names = next((names for names in NORMALS if set(names) <= values.keys()), None)
    normals = None if names is None else np.stack([values[name] for name in names], axis=-1)
    good = np.isfinite(points).all(axis=1)
    if not good.any():
        contents.fail("at least one point with finite coordinates", f"{len(points)} points", "Is it the right file?")
    if lost := int(np.sum(~good)):
        notes = [*notes, f"{counted(lost, 'point')} without finite coordinates excluded."]
    if normals is not None:
        normals = np.where(np.linalg.norm(normals, axis=1, keepdims=True) > 0.5, normals, np.nan)[good]
        normals = None if np.isnan(normals).all() else normals
    return Log(points=points[good], normals=normals, notes=tuple(notes))
