"""Kinds of readings: what one row reports, and which feature the rows of one label determine together."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from tanteo.errors import ReadingsError
from tanteo.features.kinds import CIRCLE, CONE, CYLINDER, KINDS, PLANE, SPHERE, FeatureKind

SIZES = {"radius": "hole_radii", "half angle": "half_angles"}
"""Column of readings that has the size of a round feature, by the name of that size."""

_LEAST_ON_WALL = 3
"""Fewest contacts of a label on a hole or boss: fewer rows may as well be two centres."""


@dataclass(frozen=True, slots=True)
class ReadingKind:
    """One kind of reading.

    Attributes:
        name: as in the column ``kind``.
        feature: kind of feature that the readings of one label determine; None if they determine none.
        least: fewest readings that one label may have.
        if_few: kind that the rows of a label with fewer readings become; ``''`` if they are refused.
        is_labelled: whether each reading needs a label.
        is_stated: whether files name the kind; the others follow from the other columns.
        centre: name of the kind of the centre of such features; ``''`` for features that are not round.
        centre_of: kind of feature of which a reading is the centre; None for readings on the surface.
        size: column of the size of the round feature; ``''`` if it has none.
        note: message about rows that were read as centres, with a place for their names.
    """

    name: str
    feature: FeatureKind | None = None
    least: int = 0
    if_few: str = ""
    is_labelled: bool = False
    is_stated: bool = True
    centre: str = ""
    centre_of: FeatureKind | None = None
    size: str = ""
    note: str = ""

    @property
    def is_centre(self) -> bool:
        """Whether a reading is the centre of a round feature."""
        return self.centre_of is not None

    @property
    def is_between_faces(self) -> bool:
        """Whether a reading is where faces of the part meet."""
        return self.feature is not None and self.feature.faces > 1

    @property
    def is_of_one_face(self) -> bool:
        """Whether a reading is a point of one face of the part."""
        return not self.is_centre and not self.is_between_faces


_POINT = "the centre of a sphere or the apex of a cone ({})."
_CENTRES = (
    ReadingKind(
        "centre", centre="centre", centre_of=CIRCLE, size="hole_radii",
        note="the centre of a hole or boss ({}); the height along its axis is not used, so sense a face as well.",
    ),
    ReadingKind("sphere_centre", centre="sphere_centre", centre_of=SPHERE, size="hole_radii", note=_POINT),
    ReadingKind("apex", centre="apex", centre_of=CONE, size="half_angles", note=_POINT),
)  # fmt: skip
_OWN = {
    kind.name: kind
    for kind in (
        *_CENTRES, ReadingKind("point", PLANE, is_stated=False), ReadingKind("free", is_stated=False)
    )
}  # fmt: skip
_LEAST = {CIRCLE.name: _LEAST_ON_WALL, CYLINDER.name: _LEAST_ON_WALL}
_CENTRE = {CIRCLE.name: "centre", CYLINDER.name: "centre", SPHERE.name: "sphere_centre", CONE.name: "apex"}


def reading_kinds() -> tuple[str, ...]:
    """Return the names of all kinds: of features, of centres, ``point``, and ``free`` for a beam without echo."""
    return (*(kind.name for kind in KINDS.values() if kind.min_readings), *_OWN)


def centre_notes() -> tuple[str, ...]:
    """Return the messages about rows that were read as centres, each once."""
    return tuple(dict.fromkeys(kind.note for kind in _CENTRES))


def reading_kind(name: str) -> ReadingKind:
    """Return the kind of a name; those of registered features included.

    Raises:
        ReadingsError: there is no such kind; the message lists all.
    """
    if name in _OWN:
        return _OWN[name]
    if name not in KINDS or not KINDS[name].min_readings:
        raise ReadingsError(f"kind: expected one of {', '.join(reading_kinds())}, got '{name}'. Correct the kind.")
    return _of_feature(KINDS[name])


@cache
def _of_feature(kind: FeatureKind) -> ReadingKind:
    return ReadingKind(
        kind.name, kind, _LEAST.get(kind.name, kind.min_readings), "point" if kind is PLANE else "", is_labelled=True,
        centre=_CENTRE.get(kind.name, ""), size=SIZES.get(kind.size_name, ""),
    )  # fmt: skip
