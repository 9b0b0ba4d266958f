"""Convert column names written by people and machines to canonical ones: case, units in brackets, words of ROS."""

from __future__ import annotations

import re
from collections.abc import Sequence

from tanteo.io.logs.value_words import BESIDE, MEASURED, NOMINAL, VALUE, plain

_BRACKETS = re.compile(r"(.*?)[\s_]*[\[({<]\s*([^\[\](){}<>]{0,20}?)\s*[\])}>]")
_SLASH = re.compile(r"(.+?)\s*/\s*(\w+|°)")
_GLUED = re.compile(rf"(m|p|pt|pos|point|{MEASURED})([xyz])|([xyz])(m|a|{MEASURED})")
"""Names of coordinates with a word or letter for measured values: ``MX``, ``ActX``, ``Xa``."""
_SURVEYED = {"easting": "x", "northing": "y", "elevation": "z", "ostwert": "x", "rechtswert": "x", "hochwert": "y",
             "#5061": "x", "#5062": "y", "#5063": "z"}  # fmt: skip
"""Coordinates of surveying (east, north, up is a right-handed frame), and variables with the position of a touch."""
_BLANKS = re.compile(r"[\s.\-]+")
_UNIT_WORDS = {
    "millimeter": "mm", "millimeters": "mm", "millimetre": "mm", "millimetres": "mm", "meter": "m", "meters": "m",
    "metre": "m", "metres": "m", "inch": "in", "inches": "in", '"': "in", "micron": "um", "microns": "um",
    "degree": "deg", "degrees": "deg", "°": "deg", "grad": "deg", "radian": "rad", "radians": "rad",
}  # fmt: skip
_ACTUAL = re.compile(rf"^(?:{MEASURED})_|_?(?:(?<=_)|(?<=[xyz]))(?:{MEASURED})_?{VALUE}?(?=_|$)")
_BESIDE = re.compile(
    r"(?:time|t|stamp|timestamp|time_stamp|date|datetime|comments?|remarks?|notes?|operator|temp|temperature|feed|feedrate|speed"
    r"|serial|batch|tol|tolerance|upper_tol|lower_tol|dev|deviation|result|out_of_tol"
    rf"|(?:{NOMINAL}|{BESIDE})_\w+|\w+_(?:{NOMINAL}|{BESIDE}))(?:_(?:mm|in|um|m|deg|rad|s|ms|c))?"
)
_COORDINATE = re.compile(
    r"(?:(?:coord(?:inate)?s?|pos(?:ition)?|wert|value|valeur|valore?|waarde)_)?([xyz])(?:_?(?:座標|坐标|値|值)"
    r"|_(?:coord(?:inate)?|koord(?:inate)?|wert|value|val|valeur|valore?|waarde|axis|achse|axe|eje|pos(?:ition)?))?"
    r"(_?(?:mm|um|in)|_m)?"
)
_DIAMETER = re.compile(
    r"(?:(?:hole|bore|bohrung|loch)_)?(?:d|dia|diam|diameter|durchmesser|diametre|diametro|ø|⌀|φ|直径)"
)
"""Name of the diameter of a hole in a table of holes without heights."""
_NAMES = (
    "no", "nr", "num", "number", "index", "point", "points", "point_no", "point_nr", "pt", "name", "point_name",
    "nummer", "punkt", "messpunkt", "punktname", "punto", "punt", "ponto", "pont", "bod", "nokta", "точка", "hole",
    "bohrung", "target", "点名", "点号", "点", "점",
)  # fmt: skip
GROUPS_OF_READINGS = (
    "line", "scan_line", "line_no", "line_number", "profile", "scan", "pass", "collection",
    "speed", "feed", "feedrate", "feed_rate", "tool", "tool_no", "tool_number", "stylus",
)  # fmt: skip
"""Names of columns that group readings, in the order in which the first one is chosen."""
_LONGEST = 100
"""Largest number of characters in a column name; longer text is not matched."""

_NO_UNIT = ("", "-", "1", "/")
_OF_HOLES = re.compile(r"(?:hole|bore|boss|circle|cylinder|sphere|feature)_(radius|diameter|diam|dia)(_\w+)?")
_GROUPS = {
    "position": "hand_", "translation": "hand_", "orientation": "hand_q", "rotation": "hand_q", "normal": "n",
    "normale": "n", "normalenvektor": "n", "direction": "d", "richtung": "d", "antastrichtung": "d", "direccion": "d",
    "direzione": "d",
}  # fmt: skip
"""Beginning of the canonical names by the word of a vector or a pose, in five languages."""
_WHOLE = re.compile(rf"(?:\w*_)?({'|'.join(_GROUPS)})_([xyzw])(_\w+)?")
_SIZE = re.compile(r"(?:\w+_)?(?:diameter|diam|dia)")
_ABOUT_SIZE = (
    "The radius of the tip's ball is half of it: name the column radius_mm and halve the values. Of holes or bosses "
    "name it hole_diameter_mm."
)
_ADVICE = (
    (r"(?:std|stdev|stddev|sigma|uncertainty|unc|error|accuracy|standardabweichung|streuung|messunsicherheit|unsicherheit"
     r"|ecart_type|incertitude|desviacion_(?:estandar|tipica)|incertidumbre|deviazione_standard|incertezza)",
     "If it is one standard deviation along the normal, name the column sd_mm; of a tolerance write a third."),
    (r"(?:v[xyz]|u|v|w)", "Name vectors nx, ny, nz if they point out of the material, dx, dy, dz if into it."),
    (r"(?:dist|distance|depth|length)", "Of a range sensor name the column range_mm, with sensor and hand columns."),
    (r"(?:type|category)", "Name the column kind: plane, edge, vertex, circle, point or free."),
    (r"(?:label|face|surface)",
     "Name it id if it differs in each row, feature if rows on one face share it."),
)  # fmt: skip


def canonical(cell: str) -> str:
    """Return the canonical column name: ``X (mm)``, ``X [mm]``, ``X_MM`` and ``x mm`` become ``x_mm``.

    Names of ROS messages are converted too: ``pose.position.x`` becomes ``hand_x``.

    Args:
        cell: header cell as written.
    """
    text = plain(cell.strip().strip("\"'").strip())
    if len(text) > _LONGEST:
        return text
    match = _BRACKETS.fullmatch(text) or _SLASH.fullmatch(text)
    unit = ""
    if match:
        text = match[1]
        unit = match[2].strip().strip(".")
    text = _BLANKS.sub("_", text.strip()).strip("_")
    head, _, last = text.rpartition("_")
    if head and last in _UNIT_WORDS:
        text = f"{head}_{_UNIT_WORDS[last]}"
    text = with_unit(text, unit)
    text = _ACTUAL.sub("", text)
    head, _, last = text.partition("_")
    text = f"{_SURVEYED[head]}_{last}".strip("_") if head in _SURVEYED else text
    if place := _COORDINATE.fullmatch(text):
        return f"{place[1]}_{place[2].strip('_')}" if place[2] else place[1]
    if of_hole := _OF_HOLES.fullmatch(text):
        return f"hole_{'radius' if of_hole[1] == 'radius' else 'diameter'}{of_hole[2] or ''}"
    whole = _WHOLE.fullmatch(text)
    return f"{_GROUPS[whole[1]]}{whole[2]}{whole[3] or ''}" if whole else text


def is_unrelated(name: str) -> bool:
    """Return whether a column describes no position: time, remark, nominal value, deviation or tolerance.

    Args:
        name: canonical column name.
    """
    return len(name) <= _LONGEST and _BESIDE.fullmatch(name) is not None


_TRUE_DISTANCES = (
    "distance", "true", "true_range", "actual", "actual_distance", "real_distance", "reference", "reference_distance",
    "ground_truth", "gt", "known_distance", "dist_to_plane",
)  # fmt: skip
"""Definition: names of the known distance beside a range."""


def without_nominal(names: Sequence[str], written: Sequence[str]) -> list[str]:
    """Return column names in which a coordinate is nominal where another column states that it is measured.

    Args:
        names: canonical column names.
        written: header cells as written.
    """
    measured = [re.search(rf"(?:^|[^a-z])(?:{MEASURED})(?:[^a-z]|$)", plain(cell)) is not None for cell in written]
    twice = {name for name in names if name[:1] in ("x", "y", "z") and names.count(name) == 2}
    sure = {name for name in twice if sum(m for n, m in zip(names, measured, strict=True) if n == name) == 1}
    return [f"nominal_{n}" if n in sure and not m else n for n, m in zip(names, measured, strict=True)]


_NO_POINT = re.compile(rf"{NOMINAL}|{BESIDE}|hand|normal|dir\w*|cm|dm|km|nm|ft|px")
"""Words of vectors that are no measured point, and units that are not accepted."""


def with_coordinates(names: Sequence[str], written: Sequence[str]) -> list[str]:
    """Return column names in which three columns that differ in a word ``x``, ``y``, ``z`` only are the coordinates.

    They keep their names if there are none or several such triples, as nominal and measured points are.

    Args:
        names: canonical column names.
        written: header cells as written.
    """
    found = dict[str, dict[str, int]]()
    for k, cell in enumerate(written):
        tokens = re.findall(r"[^\W_]+", _BRACKETS.sub(r"\1", plain(cell)))
        glued = [match for token in tokens if (match := _GLUED.fullmatch(token))]
        if len(glued) == 1 and not {"x", "y", "z"} & set(tokens):
            tokens += [glued[0][2] or glued[0][3], "(glued)"]
        axes = [token for token in tokens if token in ("x", "y", "z")]
        if len(axes) == 1 and not any(_NO_POINT.fullmatch(token) for token in tokens):
            pattern = " ".join("*" if axes[0] in token else token for token in tokens)
            found.setdefault(pattern, {}).setdefault(axes[0], k)
    triples = [columns for columns in found.values() if len(columns) == len("xyz")]
    if len(triples) != 1:
        return list(names)
    at = {k: axis for axis, k in triples[0].items()}
    units = [match[1] if (match := re.search(r"(_(?:mm|um|in|m))$", name)) else "" for name in names]
    if any("(glued)" in pattern and columns is triples[0] for pattern, columns in found.items()):
        names = [f"nominal_{name}" if name in ("nx", "ny", "nz") else name for name in names]  # NX beside MX
    return [f"{at[k]}{units[k]}" if k in at else name for k, name in enumerate(names)]


def with_height(names: Sequence[str]) -> list[str] | None:
    """Return the names of a table of holes ``x, y, diameter`` with a height and a kind; None for another table.

    Args:
        names: header cells as written.
    """
    canonicals = [canonical(name) for name in names]
    bases = [re.sub(r"_(?:mm|m|um|in)$", "", name) for name in canonicals]
    sizes = [k for k, base in enumerate(bases) if _DIAMETER.fullmatch(base) or base == "hole_diameter"]
    if len(sizes) != 1 or not {"x", "y"} <= set(bases) or "z" in bases or "kind" in bases:
        return None
    unit = canonicals[bases.index("x")][1:]
    size = canonicals[sizes[0]][len(bases[sizes[0]]) :] or unit
    return [*(f"hole_diameter{size}" if k == sizes[0] else name for k, name in enumerate(names)), f"z{unit}", "kind"]


def with_id(names: list[str]) -> list[str]:
    """Return column names in which the first of ``No``, ``Point``, ... becomes ``id``, unless there is an ``id``.

    Args:
        names: canonical column names.
    """
    if "id" in names:
        return names
    first = next((name for name in names if name in _NAMES), None)
    return ["id" if name == first else name for name in names]


def with_group(names: list[str]) -> list[str]:
    """Return column names in which the first of ``line``, ``pass``, ``speed``, ... becomes ``group``, if none is.

    Args:
        names: canonical column names.
    """
    first = next((name for name in GROUPS_OF_READINGS if name in names), None)
    if "group" in names or first is None:
        return names
    return ["group" if name == first else name for name in names]


def with_true_distance(names: list[str]) -> list[str]:
    """Return column names in which a distance beside a range becomes ``true_distance``, which the row states twice.

    Args:
        names: canonical column names.
    """
    bare = [_without_unit(name) for name in names]
    found = [k for k, name in enumerate(bare) if name in _TRUE_DISTANCES]
    if "range" not in bare or "true_distance" in bare or len(found) != 1:
        return names
    k = found[0]
    return [*names[:k], "true_distance" + names[k][len(bare[k]) :], *names[k + 1 :]]


def with_unit(name: str, unit: str) -> str:
    """Return a column name with the unit appended, unless it ends in the unit or the unit is empty.

    Args:
        name: column name.
        unit: unit as written.
    """
    unit = _UNIT_WORDS.get(unit, unit)
    return name if unit in _NO_UNIT or name.endswith(f"_{unit}") else f"{name}_{unit}"


def units_row(cells: Sequence[str], units: Sequence[str]) -> list[str] | None:
    """Return the units of a row that contains only units, as some programs write below the header; None otherwise.

    Args:
        cells: cells of the row.
        units: known units.
    """
    words = [cell.strip().strip("\"'").strip("[](){} ").lower().replace("µ", "u").strip() for cell in cells]
    words = [_UNIT_WORDS.get(word, word) for word in words]
    return words if any(word in units for word in words) and all(w in units or w in _NO_UNIT for w in words) else None


def advice(name: str) -> str:
    """Return advice on an unknown column name that has a common meaning; empty if none is known.

    Args:
        name: header cell as written.
    """
    base = _without_unit(name)
    return next((f" {words}" for pattern, words in _ADVICE if re.fullmatch(pattern, base)), "")


def advice_on_size(name: str) -> str:
    """Return advice on a diameter, which decides whether points are centres; empty for other names.

    Args:
        name: header cell as written.
    """
    return f" {_ABOUT_SIZE}" if _SIZE.fullmatch(_without_unit(name)) else ""


def _without_unit(name: str) -> str:
    return re.sub(r"_(?:mm|m|um|in|cm|deg|rad)$", "", canonical(name))
