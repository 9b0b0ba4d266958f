"""Read PLY point clouds (ascii and binary): x y z, and nx ny nz if present. A mesh contributes its vertices.

Mesh libraries take a cloud for a mesh without faces, and fail in undocumented ways on truncated files.
"""

from __future__ import annotations

import numpy as np

from tanteo.io.logs.cloud import PLACE, columns, of_columns, text_columns
from tanteo.io.logs.contents import Contents, is_whole
from tanteo.io.logs.log import Log

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST_HEADER = 100_000


def recognise(contents: Contents) -> bool:
    """Return whether the file starts with the PLY signature.

    Args:
        contents: file to test.
    """
    return contents.data.startswith((b"ply\n", b"ply\r"))


def read(contents: Contents) -> Log:
    """Return the vertices.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: the file is malformed.
    """
    start, encoding, elements = _header(contents)
    if not elements or elements[0][0] != "vertex":
        contents.fail(
            "the element vertex first", f"'{elements[0][0] if elements else 'none'}'", "Export it as a cloud."
        )
    _, count, properties = elements[0]
    missing = [name for name in PLACE if name not in properties]
    if missing:
        contents.fail("properties x, y, z of a vertex", f"none of {', '.join(missing)}", "Export it as a cloud.")
    body = contents.data[start:]
    if encoding == "ascii":
        values = text_columns(contents, body, list(properties), count)
    else:
        if "list" in properties.values():
            contents.fail("vertices of numbers", "a list in them", "Export it as a cloud.")
        dtype = np.dtype([(name, _ORDERS[encoding] + _TYPES[kind]) for name, kind in properties.items()])
        values = columns(contents, body, dtype, count)
    faces = next((n for name, n, _ in elements if name == "face"), 0)
    notes = [f"It is a mesh of {faces} faces: its vertices are taken as points."] if faces else []
    return of_columns(contents, values, notes)


def _header(contents: Contents) -> tuple[int, str, list[tuple[str, int, dict[str, str]]]]:
    """Return the offset of the body, its encoding, and the elements with their properties."""
    end = contents.data.find(b"end_header", 0, _LONGEST_HEADER)
    line_end = contents.data.find(b"\n", end)
    if end < 0 or line_end < 0:
        contents.fail("a header that ends in end_header", "none", "Is this the whole file?")
    encoding = ""
    elements = list[tuple[str, int, dict[str, str]]]()
    for line in contents.data[:end].decode("latin-1").splitlines():
        words = line.split()
        if words[:1] == ["format"] and len(words) > 1:
            encoding = words[1]
        elif words[:1] == ["element"] and len(words) == 3 and is_whole(words[2]):
            elements.append((words[1], int(words[2]), {}))
        elif words[:1] == ["property"] and len(words) > 2 and elements:
            kind = words[1]
            if kind not in _TYPES and kind != "list":
                contents.fail(f"a type of PLY ({', '.join(_TYPES)})", f"'{kind}'", "Export it again.")
            elements[-1][2][words[-1]] = kind
    if encoding not in ("ascii", *_ORDERS):
        contents.fail(f"format ascii or {' or '.join(_ORDERS)}", f"'{encoding}'", "Export it again.")
    return line_end + 1, encoding, elements
