"""Names of readings that are told: what was told before is left out, and no name comes twice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tanteo.sensors import Readings


def new_readings(told: Sequence[Readings], readings: Readings) -> tuple[Readings | None, str]:
    """The readings that are new, named so that no name comes twice; and what was done about names.

    Args:
        told: what was told before.
        readings: what is told now.
    """
    known = {name: (r, k) for r in told for k, name in enumerate(r.ids)}
    taken = {*known, *readings.ids}
    keep, names, again, renamed = [], [], [], []
    for k, name in enumerate(readings.ids):
        new = name
        if name in known:
            if _same(readings, k, *known[name]):
                again.append(name)
                continue
            new = next(f"{name} ({n})" for n in range(2, 10**6) if f"{name} ({n})" not in taken)
            renamed.append(new)
        keep.append(k)
        names.append(new)
    notes = [f"{', '.join(again)}: told before"] if again else []
    notes += [f"{', '.join(renamed)}: named anew, as the name was taken"] if renamed else []
    if not keep:
        return None, "; ".join(notes)
    return replace(readings.take(np.array(keep)), ids=tuple(names)), "; ".join(notes)


def _same(a: Readings, i: int, b: Readings, j: int) -> bool:
    arrays = ("points", "directions", "ranges", "Ts_world_hand", "max_ranges")
    return a.sensors[i] == b.sensors[j] and all(
        np.array_equal(getattr(a, name)[i], getattr(b, name)[j], equal_nan=True) for name in arrays
    )
