"""Name measured and nominal values, axes, units and shapes in the languages in which reports are written.

Patterns match text of :func:`plain`: small letters without accents.
"""

from __future__ import annotations

import re
from unicodedata import combining, normalize

MEASURED = "|".join((
    "actual", "act", "measured", "measure", "meas", "mea", "istwert", "ist", "gemessen", "messwert", "mess",
    "mesuree?s?", "medid[oa]s?", "misurat[oaie]", "gemeten", "zmierzon[aey]", "uppmatt", "namereno", "namerena",
    "zmerena", "mert", "olculen", "mitattu", r"изм(?:ерен\w*)?", r"факт(?:ич\w*)?",
    "実測", "实测", "測定", "测定", "測量", "测量", "측정", "실측",
))  # fmt: skip
"""Pattern of words for measured values, in eighteen languages."""
NOMINAL = (
    r"nom(?:inal\w*)?|soll\w*|theo\w*|teor\w*|jmen\w*|nenn\w*|ном\w*|теор\w*|nevleges|ref\w*|cad|target|tavoite|設計|名义|理论|公称"
    r"|공칭|설계"
)
"""Pattern of words for nominal values."""
BESIDE = (
    r"dev(?:iation)?s?|deviacion|deviazione|abw\w*|ecart\w*|scart\w*|scost\w*|desv\w*|odch\w*|afwijking|откл\w*|tol\w*"
    r"|delta|diff\w*|err\w*"
)
"""Pattern of words for deviations and tolerances."""
VALUE = r"(?:value|val|wert|valeur|valore?|waarde|値|值|값)"
"""Pattern of words for a value."""
LENGTH_UNITS = {
    "mm": "mm", "millimeter": "mm", "millimeters": "mm", "millimetre": "mm", "millimetres": "mm", "m": "m",
    "meter": "m", "meters": "m", "metre": "m", "metres": "m", "in": "in", "inch": "in", "inches": "in", "zoll": "in",
    "um": "um", "micron": "um", "microns": "um", '"': "in",
}  # fmt: skip
"""Unit by its name in a file."""
_UNIT_LINE = re.compile(
    r"(?<![a-z])(?:units?|einheit(?:en)?|unites?|unidad(?:es)?|unita|eenheid)(?![a-z])[^a-z0-9\n]{1,12}"
    rf"(?:of measure\w* *[:=] *)?({'|'.join(LENGTH_UNITS)})(?![a-z0-9/])"
)


def plain(text: str) -> str:
    """Return a text in small letters without accents.

    Args:
        text: text as written.
    """
    text = text.lower().replace("µ", "u").replace("μ", "u").replace("″", '"')
    return text if text.isascii() else normalize("NFC", "".join(c for c in normalize("NFKD", text) if not combining(c)))


def stated_unit(lines: list[str]) -> str | None:
    """Return the length unit that lines such as ``# Units: mm`` state; None if none or several do.

    Args:
        lines: comments and titles of a file.
    """
    found = {LENGTH_UNITS[name] for line in lines for name in _UNIT_LINE.findall(plain(line))}
    return found.pop() if len(found) == 1 else None
