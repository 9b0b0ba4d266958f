"""A part as bytes: two arrays and a JSON header in one ``npz``, without pickle, so that reading runs no code."""

from __future__ import annotations

import io
import json
import zipfile
from typing import Any

import numpy as np

from tanteo.errors import InputError
from tanteo.parts import Face, ModelEdges, ModelPlanes, ModelVertices, Part, SymmetryGroup

FORMAT_VERSION = 2
"""Of the bytes and of the rules that made the part: raise it whenever a reader gives another answer."""

_GROUPS: dict[str, tuple[type[Any], tuple[str, ...]]] = {
    "planes": (
        ModelPlanes,
        ("Ts_part_feature", "faces", "areas", "gyration", "boundary", "boundary_start"),
    ),
    "edges": (ModelEdges, ("Ts_part_feature", "lengths", "ends", "faces", "dihedrals", "convex")),
    "corners": (ModelVertices, ("points", "edges", "edges_start")),
}
_ARRAYS = ("vertices", "triangles", "triangle_face", "centroid", "box")
_FACE_NUMBERS = ("area", "radius", "minor_radius", "half_angle", "convex", "sagitta")
_FACE_VECTORS = ("centroid", "axis_point", "axis_direction")


def part_to_bytes(part: Part) -> bytes:
    """Write a part to bytes that :func:`part_from_bytes` reads back bit for bit."""
    arrays: dict[str, Any] = {name: getattr(part, name) for name in _ARRAYS}
    for group, (_, names) in _GROUPS.items():
        arrays.update({f"{group}.{name}": getattr(getattr(part, group), name) for name in names})
    arrays["symmetry.Ts"] = part.symmetry.Ts
    axis = part.symmetry.axis
    header = {
        "version": FORMAT_VERSION,
        "name": part.name,
        "source": part.source,
        "unit": part.unit,
        "volume": part.volume,
        "area": part.area,
        "radius": part.radius,
        "repairs": part.repairs,
        "axis": None if axis is None else [vector.tolist() for vector in axis],
        "spherical": part.symmetry.spherical,
        "faces": [_face_to_json(face) for face in part.faces],
        "arrays": [(name, list(a.shape), a.dtype.kind) for name, a in arrays.items()],
    }
    flat = {kind: [a.reshape(-1) for a in arrays.values() if (a.dtype.kind == "f") == (kind == "f")] for kind in "fi"}
    stream = io.BytesIO()
    np.savez(
        stream,
        header=np.frombuffer(json.dumps(header).encode(), dtype=np.uint8),
        floats=np.concatenate(flat["f"]),
        integers=np.concatenate([a.astype(np.int64) for a in flat["i"]]),
    )
    return stream.getvalue()


def part_from_bytes(data: bytes, *, name: str | None = None, source: str | None = None) -> Part:
    """Read a part back.

    Args:
        data: as :func:`part_to_bytes` wrote it.
        name: given to the part in place of the stored one.
        source: given to the part in place of the stored one.

    Raises:
        InputError: the bytes are damaged or of another format version.
    """
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as stored:
            header = json.loads(stored["header"].tobytes())
            if header["version"] != FORMAT_VERSION:
                raise ValueError(f"version {header['version']}")
            arrays = _cut(header["arrays"], stored["floats"], stored["integers"])
        groups = {
            group: kind(**{field: arrays[f"{group}.{field}"] for field in names})
            for group, (kind, names) in _GROUPS.items()
        }
        axis = None if header["axis"] is None else (np.array(header["axis"][0]), np.array(header["axis"][1]))
        return Part(
            name=name or header["name"],
            source=source or header["source"],
            unit=header["unit"],
            faces=tuple(Face(**face) for face in header["faces"]),
            symmetry=SymmetryGroup(arrays["symmetry.Ts"], axis, header["spherical"]),
            volume=header["volume"],
            area=header["area"],
            radius=header["radius"],
            repairs=tuple(header["repairs"]),
            **{field: arrays[field] for field in _ARRAYS},
            **groups,
        )
    except (ValueError, KeyError, TypeError, IndexError, EOFError, OSError, zipfile.BadZipFile) as error:
        raise InputError(f"data: expected a stored part, got {error}. Read the CAD file again.") from error


def _cut(layout: list[Any], floats: Any, integers: Any) -> dict[str, Any]:
    """Cut the two flat arrays into the named ones."""
    at = {"f": 0, "i": 0}
    arrays = {}
    for name, shape, kind in layout:
        store = "f" if kind == "f" else "i"
        size = int(np.prod(shape))
        source = floats if store == "f" else integers
        if at[store] + size > len(source):
            raise ValueError("arrays that break off")
        arrays[name] = source[at[store] : at[store] + size].reshape(shape)
        at[store] += size
    return arrays


def _face_to_json(face: Face) -> dict[str, Any]:
    stored: dict[str, Any] = {"name": face.name, "surface": face.surface}
    stored.update({name: getattr(face, name) for name in _FACE_NUMBERS})
    for name in _FACE_VECTORS:
        vector = getattr(face, name)
        stored[name] = None if vector is None else vector.tolist()
    return stored
