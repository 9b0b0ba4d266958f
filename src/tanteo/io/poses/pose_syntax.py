"""Parse a pose that a user types: as answers print it, or in the syntax of a robot controller."""

from __future__ import annotations

import re

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.io.poses.poses import pose_from_brand
from tanteo.io.readings.assembling import LARGEST
from tanteo.io.readings.brands import BRANDS, Brand, brand
from tanteo.io.readings.units import parse_lengths_angles

_WRITTEN = "400,200,0mm 0,0,90deg"
_BRANDED = "kuka 400,200,0,90,0,0"
_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_NAMED = re.compile(rf"(?<![\w.])([A-Za-z]\w*)\s*[:=]?\s*({_NUMBER})\s*(mm|deg|rad|m|°)?(?![\w.])", re.ASCII)
_PLAIN = re.compile(_NUMBER, re.ASCII)
_GROUP = re.compile(r"\[([^\[\]]*)\]")
_UNITS = {"mm": "mm", "m": "m", "deg": "deg", "rad": "rad", "°": "deg"}


def brand_word(text: str) -> str:
    """Return the brand at the start of a typed pose; empty if the pose is in tanteo's own convention.

    Args:
        text: typed pose.
    """
    match = re.match(r"\s*([A-Za-zä]+)(?=[\s:{\[(])", text)
    return match[1] if match else ""


def parse_pose(text: str, name: str = "pose", *, attitude: bool = True) -> Transforms:
    """Return the pose of a text such as ``'400,200,0mm 0,0,90deg'`` or ``'kuka {X 400, ..}'``.

    Without a brand the text is x, y, z and roll, pitch, yaw. With a brand it is the syntax of that controller, such as
    ``'ur p[0.4, ..]'``; for ``abb`` a robtarget is accepted. Named fields may come in any order, and fields that are
    not part of the pose (S, T, E1) are ignored.

    Args:
        text: typed pose.
        name: name of the input, for messages.
        attitude: whether roll, pitch and yaw are required; otherwise they default to zero.

    Returns:
        Pose ``(4, 4)`` [m].

    Raises:
        InputError: numbers are missing, the brand is unknown, or the numbers are probably in another unit.
        UnitError: a required unit is missing.
    """
    word = brand_word(text)
    if word:
        return _branded(word, text.strip()[len(word) :].lstrip(": "), name)
    place, turn = parse_lengths_angles(text, name)
    if len(place) != 3 or len(turn) not in ((3,) if attitude else (0, 3)):
        raise InputError(
            f"{name}: expected x, y, z and roll, pitch, yaw, got {len(place)} lengths and {len(turn)} angles. "
            f"Write it as {_WRITTEN}."
        )
    return pose_from_brand("paper", np.array([*place, *(turn or (0.0, 0.0, 0.0))]))


def _branded(word: str, fields: str, name: str) -> Transforms:
    try:
        b = brand(word)
        T = pose_from_brand(b.name, _values(b, fields, name))
    except InputError as error:
        raise error if str(error).startswith(f"{name}:") else InputError(f"{name}: {error}") from None
    if not np.all(np.abs(T[:3, 3]) <= LARGEST):
        unit = "metres" if b.metre == 1 else "millimetres"
        raise InputError(
            f"{name}: expected a place within {LARGEST:g} m of the origin, got '{fields.strip()}', which {word} "
            f"writes in {unit}. Write it in {unit}."
        )
    return T


def _values(b: Brand, fields: str, name: str) -> FloatArray:
    """Return the fields in the brand's order and units."""
    named = _NAMED.findall(fields)
    if named and not (b.name == "ur" and fields.lstrip().startswith("p[")):
        return _named(b, fields, named, name)
    inner = _GROUP.findall(fields) if fields.lstrip().startswith("[[") else []
    text = ",".join(inner[:2]) if inner else fields
    words = text.replace("p[", "").strip("{}[]() ").replace(",", " ").replace(";", " ").split()
    if not all(_PLAIN.fullmatch(value) for value in words):
        raise InputError(
            f"{name}: expected plain numbers behind '{b.name}', whose units are its own, got '{fields.strip()}'. "
            f"Write it as {_BRANDED}; brands: {', '.join(BRANDS)}."
        )
    return np.array([float(value) for value in words])


def _named(b: Brand, fields: str, named: list[tuple[str, str, str]], name: str) -> FloatArray:
    given: dict[str, float] = {}
    for key, value, unit in named:
        field = next((f for f in b.fields if f.lower() == key.lower()), None)
        if field is None:
            continue
        if field in given:
            raise InputError(f"{name}: expected {field} once, got it twice in '{fields.strip()}'. Keep one.")
        own = ("m" if b.metre == 1 else "mm") if field in b.fields[:3] else ("rad" if b.radian == 1 else "deg")
        if unit and _UNITS[unit] != own:
            raise InputError(f"{name}: expected {field} in {own}, as {b.name} writes it, got {unit}. Convert it.")
        given[field] = float(value)
    missing = [f for f in b.fields if f not in given]
    if missing:
        raise InputError(
            f"{name}: expected {' '.join(b.fields)} behind '{b.name}', got no {', '.join(missing)} in "
            f"'{fields.strip()}'. Add it; fields may come in any order."
        )
    return np.array([given[f] for f in b.fields])
