"""Names of readings that are told: what was told before is left out, and no name comes twice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tanteo.sensors import Readings


def new_readings(before: Sequence[Readings], readings: Readings) -> tuple[Readings | None, str]:
    """The readings that are new, named so that no name comes twice; and what was done about names.

    Args:
        before: what was given before.
        readings: what is given now.
    """
    known = {name: (r, k) for r in before for k, name in enumerate(r.ids)}
    taken = {*known, *readings.ids}
    keep, names = list[int](), list[str]()
    again, corrected, renamed = list[str](), list[str](), list[str]()
    for k, name in enumerate(readings.ids):
        new, bearers = name, _bearers(known, name)
        if told_before := [one for one in bearers if _equal(_WHERE, readings, k, *one)]:
            same = any(_equal(_HOW_WELL, readings, k, *one) for one in told_before)
            (again if same else corrected).append(name)
            continue
        if bearers:
            new = next(f"{name} ({n})" for n in range(2, 10**6) if f"{name} ({n})" not in taken)
            taken.add(new)
            renamed.append(new)
        keep.append(k)
        names.append(new)
    notes = [f"{', '.join(again)}: told before"] if again else []
    notes += (
        [f"{', '.join(corrected)}: told before with other errors, radius or normal, which hold"] if corrected else []
    )
    notes += [f"{', '.join(renamed)}: named anew, as the name was taken"] if renamed else []
    if not keep:
        return None, "; ".join(notes)
    fresh = readings if len(keep) == len(readings) else readings.take(np.array(keep))
    return fresh if not renamed else replace(fresh, ids=tuple(names)), "; ".join(notes)


_WHERE = "points", "directions", "ranges", "Ts_world_hand", "max_ranges", "is_free"
_HOW_WELL = "sds", "across_sds", "radii", "normals", "normal_sds"


def _bearers(known: dict[str, tuple[Readings, int]], name: str) -> list[tuple[Readings, int]]:
    """Readings that had this name when they were told: the first, and those that were named anew."""
    out = [known[name]] if name in known else []
    n = 2
    while (again := f"{name} ({n})") in known:
        out.append(known[again])
        n += 1
    return out


def _equal(columns: Sequence[str], a: Readings, i: int, b: Readings, j: int) -> bool:
    return a.sensors[i] == b.sensors[j] and all(
        np.array_equal(getattr(a, name)[i], getattr(b, name)[j], equal_nan=getattr(a, name).dtype != bool)
        for name in columns
    )
