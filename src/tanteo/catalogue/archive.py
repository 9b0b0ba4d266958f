"""Store a part as bytes of which only the requested attributes are decoded: a checksum, JSON documents and arrays.

The first document holds numbers and names, the second the offsets of the arrays, the third the faces. An opened part
keeps the bytes and decodes an attribute at its first use. No pickle is used.
"""

from __future__ import annotations

import json
import struct
import zlib
from functools import cached_property
from typing import Any

import numpy as np

from tanteo.errors import InputError
from tanteo.parts import Part
from tanteo.parts.faces import Face, ModelEdges, ModelPlanes, ModelVertices, SymmetryGroup

FORMAT_VERSION = 12
"""Version of the byte format and of the readers; increase it whenever a reader gives another result."""

_MAGIC = b"tanteoP\n"
_HEAD = struct.Struct("<8sIIIQ")
"""Header: magic, CRC-32 of all that follows, lengths of the first document, of the second, and of everything."""

_GROUPS: dict[str, tuple[type[Any], tuple[str, ...]]] = {
    "planes": (ModelPlanes, ("Ts_part_feature", "faces", "areas", "gyration", "boundary", "boundary_start")),
    "edges": (ModelEdges, ("Ts_part_feature", "lengths", "ends", "faces", "dihedrals", "convex")),
    "corners": (ModelVertices, ("points", "edges", "edges_start")),
}
_ARRAYS = ("vertices", "triangles", "triangle_face")
_PLAIN = ("name", "source", "unit", "volume", "area", "radius")
_VECTORS = ("centroid", "box")
_FACE_NUMBERS = ("area", "radius", "minor_radius", "half_angle", "convex", "sagitta")
_FACE_VECTORS = ("centroid", "axis_point", "axis_direction")


def part_to_bytes(part: Part) -> bytes:
    """Return a part as bytes that :func:`part_from_bytes` restores exactly.

    Args:
        part: part to store.
    """
    arrays: dict[str, Any] = {name: getattr(part, name) for name in _ARRAYS}
    for group, (_, names) in _GROUPS.items():
        arrays.update({f"{group}.{name}": getattr(getattr(part, group), name) for name in names})
    arrays["symmetry.Ts"] = part.symmetry.Ts
    faces = json.dumps([_face_to_json(face) for face in part.faces]).encode()
    parts = [faces]
    places = {}
    at = len(faces)
    for name, array in arrays.items():
        parts.append(bytes(-at % 8))
        at += -at % 8
        places[name] = (at, array.dtype.str, array.shape)
        parts.append(array.tobytes())
        at += array.nbytes
    axis = part.symmetry.axis
    header = {
        "version": FORMAT_VERSION,
        **{name: getattr(part, name) for name in _PLAIN},
        **{name: getattr(part, name).tolist() for name in _VECTORS},
        "repairs": part.repairs,
        "axis": None if axis is None else [vector.tolist() for vector in axis],
        "spherical": part.symmetry.spherical,
        "faces": len(faces),
    }
    document = json.dumps(header).encode()
    table = json.dumps(places).encode()
    table += b" " * (-(_HEAD.size + len(document) + len(table)) % 8)
    body = b"".join([document, table, *parts])
    return _HEAD.pack(_MAGIC, zlib.crc32(body), len(document), len(table), _HEAD.size + len(body)) + body


def part_from_bytes(data: bytes, *, name: str | None = None, source: str | None = None) -> Part:
    """Open a stored part, which keeps the bytes.

    Args:
        data: bytes of :func:`part_to_bytes`.
        name: name of the part; None for the stored name.
        source: origin of the part; None for the stored origin.

    Raises:
        InputError: the bytes are damaged or have another format version.
    """
    try:
        magic, checksum, length, table, size = _HEAD.unpack_from(data)
        if magic != _MAGIC or size != len(data) or checksum != zlib.crc32(memoryview(data)[_HEAD.size :]):
            raise ValueError("others, or damaged ones")
        header = json.loads(data[_HEAD.size : _HEAD.size + length])
        if header["version"] != FORMAT_VERSION:
            raise ValueError(f"version {header['version']}")
    except (ValueError, KeyError, TypeError, struct.error) as error:
        raise InputError(f"data: expected a stored part, got {error}. Read the CAD file again.") from error
    known = {field: header[field] for field in _PLAIN}
    known.update(name=name or known["name"], source=source or known["source"], repairs=tuple(header["repairs"]))
    for field in _VECTORS:
        known[field] = np.array(header[field])
        known[field].setflags(write=False)
    start = _HEAD.size + length
    return Part.opened(_Stored(data, start, start + table, header), **known)


class _Stored:
    """Loader of a part's attributes, which decodes each at its first use."""

    def __init__(self, data: bytes, table: int, start: int, header: dict[str, Any]) -> None:
        self._data, self._table, self._start, self._header = data, table, start, header

    @cached_property
    def _places(self) -> dict[str, Any]:
        places: dict[str, Any] = json.loads(self._data[self._table : self._start])
        return places

    def __call__(self, name: str) -> Any:
        if name == "faces":
            text = self._data[self._start : self._start + self._header["faces"]]
            return tuple(Face(**face) for face in json.loads(text))
        if name in _GROUPS:
            kind, names = _GROUPS[name]
            return kind(**{field: self._array(f"{name}.{field}") for field in names})
        if name == "symmetry":
            axis = self._header["axis"]
            pair = None if axis is None else (np.array(axis[0]), np.array(axis[1]))
            return SymmetryGroup(self._array("symmetry.Ts"), pair, self._header["spherical"])
        return self._array(name)

    def _array(self, name: str) -> Any:
        at, dtype, shape = self._places[name]
        count = int(np.prod(shape))
        return np.frombuffer(self._data, dtype, count, self._start + at).reshape(shape)


def _face_to_json(face: Face) -> dict[str, Any]:
    stored: dict[str, Any] = {"name": face.name, "surface": face.surface}
    stored.update({name: getattr(face, name) for name in _FACE_NUMBERS})
    for name in _FACE_VECTORS:
        vector = getattr(face, name)
        stored[name] = None if vector is None else vector.tolist()
    return stored
