"""Read 3MF files as vertices and triangles: the build items with their components, also from several model files.

Sources: core specification 1.3 and production extension 1.1 of the 3MF Consortium (https://3mf.io/spec). Support
structures and objects outside the build are ignored.
"""

from __future__ import annotations

import posixpath
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tanteo.errors import PartError
from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.parts.readers.files import METRES, third_party_reader

LARGEST = 512_000_000
"""Largest total size that is unpacked from one archive [bytes]."""

SMALL, RATIO = 32_000_000, 200
"""Unpacked size [bytes] above which the compression ratio is limited, and its limit; text of meshes has about 10."""

_CHUNK = 1 << 20


class Archive:
    """Files of a zip archive by name, ignoring case; the sizes stated in the archive are not trusted."""

    def __init__(self, file: zipfile.ZipFile, packed: int, label: str) -> None:
        self._file, self._packed, self._label = file, packed, label
        self._names = {info.filename.lstrip("/").lower(): info for info in file.infolist()}
        self._read = 0

    def __contains__(self, name: str) -> bool:
        return name.lower() in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(info.filename.lstrip("/") for info in self._names.values())

    def read(self, name: str) -> bytes:
        """Unpack one file.

        Args:
            name: name of the file, ignoring case.

        Raises:
            PartError: the file does not exist, or exceeds the limits; damaged archives raise the errors of ``zipfile``.
        """
        info = self._names.get(name.lower())
        if info is None:
            raise PartError(f"{self._label}: expected a file {name!r} in the archive, got none. Export it again.")
        pieces = []
        with self._file.open(info) as stream:
            while piece := stream.read(_CHUNK):
                self._read += len(piece)
                self._check()
                pieces.append(piece)
        return b"".join(pieces)

    def _check(self) -> None:
        if self._read > LARGEST or (self._read > SMALL and self._read > RATIO * self._packed):
            raise PartError(
                f"{self._label}: expected a mesh, got an archive of {self._packed:,} bytes that unpacks to more than "
                f"{self._read:,}. Export one part."
            )


UNITS = {"micron": "um", "millimeter": "mm", "centimeter": "cm", "inch": "in", "foot": "ft", "meter": "m"}

_READ = ("/production/", "/material/", "/trianglesets/", "/core/")
"""Namespaces of extensions that are supported, or that change no surface."""

_DEEPEST, _MOST_COPIES, _MOST_TRIANGLES = 32, 20_000, 5_000_000


@dataclass(slots=True)
class _Object:
    """Mesh, or components: other objects with their transforms."""

    kind: str
    vertices: FloatArray | None = None
    triangles: IntArray | None = None
    components: list[tuple[str, str, FloatArray]] = field(default_factory=list)


@dataclass(slots=True)
class _Model:
    """Model file of the package: its objects by identifier, the build items, and its unit."""

    unit: str
    objects: dict[str, _Object] = field(default_factory=dict)
    items: list[tuple[str, str, FloatArray]] = field(default_factory=list)


def read_3mf(path: Path, label: str) -> tuple[FloatArray, IntArray, str, list[str]]:
    """Read the build items of a 3MF file.

    Args:
        path: path of the file.
        label: name of the file for messages.

    Returns:
        Vertices, triangles, short name of the unit, and sentences about what was excluded.

    Raises:
        PartError: the file is damaged, violates the specification, or needs an unsupported extension.
    """
    with third_party_reader(path, label), zipfile.ZipFile(path) as file:
        return _Package(Archive(file, path.stat().st_size, label), label).built()


class _Package:
    """Models of a file, each parsed at first use."""

    def __init__(self, archive: Archive, label: str) -> None:
        self._archive, self._label = archive, label
        self._models: dict[str, _Model] = {}
        self._copies = self._copied = 0

    def built(self) -> tuple[FloatArray, IntArray, str, list[str]]:
        root = self._root()
        model = self._model(root)
        notes = []
        items = model.items
        if not items:
            used = {(p, i) for o in model.objects.values() for p, i, _ in o.components}
            items = [("", i, np.eye(4)) for i in model.objects if ("", i) not in used]
            notes.append("The file builds nothing: all its objects are taken.")
        kinds = [self._object(p or root, i).kind for p, i, _ in items]
        left = [kind for kind in kinds if kind not in ("model", "surface")]
        if left and len(left) < len(items):
            kept = [item for item, kind in zip(items, kinds, strict=True) if kind in ("model", "surface")]
            named = ", ".join(sorted(set(left)))
            items = kept
            count = len(left)
            notes.append(f"Excluded {count} {'object' if count == 1 else 'objects'} of the type {named}.")
        pieces = [piece for p, i, T in items for piece in self._meshes(p or root, i, T, ())]
        if not pieces:
            return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), model.unit, notes
        starts = np.cumsum([0] + [len(vertices) for vertices, _ in pieces])[:-1]
        triangles = np.concatenate([t + start for (_, t), start in zip(pieces, starts, strict=True)])
        return np.concatenate([v for v, _ in pieces]) / METRES[model.unit], triangles, model.unit, notes

    def _meshes(
        self, path: str, index: str, T: FloatArray, above: tuple[tuple[str, str], ...]
    ) -> Iterator[tuple[FloatArray, IntArray]]:
        """Yield meshes of an object and of its components, in metres."""
        if (path, index) in above or len(above) > _DEEPEST:
            raise PartError(f"{self._label}: expected objects made of others, got object {index} made of itself.")
        self._copies += 1
        if self._copies > _MOST_COPIES:
            raise PartError(
                f"{self._label}: expected up to {_MOST_COPIES} copies of objects, got more. Export one part."
            )
        found = self._object(path, index)
        metres = METRES[self._models[path].unit]
        if found.vertices is not None and found.triangles is not None and len(found.triangles):
            self._copied += len(found.triangles)
            if self._copied > _MOST_TRIANGLES:
                raise PartError(
                    f"{self._label}: expected up to {_MOST_TRIANGLES} triangles, got more. Simplify the part."
                )
            turned = found.triangles[:, ::-1] if np.linalg.det(T[:3, :3]) < 0.0 else found.triangles
            yield (found.vertices @ T[:3, :3] + T[3, :3]) * metres, turned
        for other, inner, placed in found.components:
            yield from self._meshes(other or path, inner, placed @ T, (*above, (path, index)))

    def _object(self, path: str, index: str) -> _Object:
        objects = self._model(path).objects
        if index not in objects:
            raise PartError(
                f"{self._label}: expected an object {index} in {path}, got none. Export it again, as one file."
            )
        return objects[index]

    def _model(self, path: str) -> _Model:
        if path not in self._models:
            self._models[path] = _parsed(self._archive.read(path), self._label)
        return self._models[path]

    def _root(self) -> str:
        """Return the name of the root model of the package."""
        if "_rels/.rels" in self._archive:
            for relation in _tree(self._archive.read("_rels/.rels"), self._label).iter("{*}Relationship"):
                if relation.get("Type", "").endswith("/3dmodel"):
                    return _plain(relation.get("Target", ""))
        models = [name for name in self._archive if name.lower().endswith(".model")]
        if not models:
            raise PartError(
                f"{self._label}: expected a 3MF file, got a zip archive without a 3D model. Export it again."
            )
        return next((name for name in models if name.lower() == "3d/3dmodel.model"), models[0])


def _plain(path: str) -> str:
    return posixpath.normpath(path).lstrip("/")


def _tree(data: bytes, label: str) -> Any:
    """Parse XML without entities and external content; undeclared prefixes are accepted as those of extensions."""
    from lxml import etree  # slow to import

    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True, recover=True
    )
    try:
        root = etree.fromstring(data, parser)
        wrong = [one.message for one in parser.error_log if one.domain_name != "NAMESPACE"]
    except (etree.XMLSyntaxError, ValueError) as error:
        root = None
        wrong = [str(getattr(error, "msg", error))]
    if root is None or wrong:
        detail = wrong[0].splitlines()[0] if wrong and wrong[0] else "nothing in it"
        raise PartError(f"{label}: expected XML in the 3MF file, got a damaged one ({detail}). Export it again.")
    if root.getroottree().docinfo.doctype:
        raise PartError(f"{label}: expected a 3MF model, got XML with a document type. Export it again.")
    return root


def _parsed(data: bytes, label: str) -> _Model:
    root = _tree(data, label)
    needed = [root.nsmap.get(prefix, prefix) for prefix in root.get("requiredextensions", "").split()]
    unread = [name for name in needed if not any(part in name for part in _READ)]
    if unread:
        raise PartError(
            f"{label}: expected a mesh, got one that needs the 3MF extension {unread[0]!r}, which is not read. "
            "Export the part as a plain mesh."
        )
    unit = root.get("unit", "millimeter").lower()
    if unit not in UNITS:
        raise PartError(f"{label}: expected one of the units {', '.join(UNITS)}, got {unit!r}. Export it again.")
    model = _Model(UNITS[unit])
    try:
        for element in root.iter("{*}object"):
            model.objects[element.attrib["id"]] = _object(element, label)
        for element in root.iter("{*}item"):
            model.items.append(_placed(element, label))
    except KeyError as error:
        raise PartError(
            f"{label}: expected the attribute {error} in the 3MF model, got none. Export it again."
        ) from None
    return model


def _object(element: Any, label: str) -> _Object:
    found = _Object(element.get("type", "model"))
    mesh = element.find("{*}mesh")
    if mesh is not None:
        rows = [(v.attrib["x"], v.attrib["y"], v.attrib["z"]) for v in mesh.iterfind("{*}vertices/{*}vertex")]
        corners = [(t.attrib["v1"], t.attrib["v2"], t.attrib["v3"]) for t in mesh.iterfind("{*}triangles/{*}triangle")]
        try:
            found.vertices = np.array(rows, dtype=np.float64).reshape(-1, 3)
            found.triangles = np.array(corners, dtype=np.int64).reshape(-1, 3)
        except (ValueError, OverflowError):
            raise PartError(f"{label}: expected numbers in the 3MF mesh, got others. Export it again.") from None
        if len(corners) and (found.triangles.min() < 0 or found.triangles.max() >= len(rows)):
            raise PartError(f"{label}: expected corner indices below {len(rows)}, got others. Export it again.")
    found.components = [_placed(part, label) for part in element.iterfind("{*}components/{*}component")]
    return found


def _placed(element: Any, label: str) -> tuple[str, str, FloatArray]:
    """Return file (or empty), object and transform (for row vectors) of an item or a component."""
    path = next((value for name, value in element.attrib.items() if name.rsplit("}", 1)[-1] == "path"), "")
    T = np.eye(4)
    if "transform" in element.attrib:
        try:
            T[:, :3] = np.array(element.attrib["transform"].split(), dtype=np.float64).reshape(4, 3)
        except ValueError:
            raise PartError(f"{label}: expected 12 numbers of a transform, got others. Export it again.") from None
    return _plain(path) if path else "", element.attrib["objectid"], T
