"""Define the faults of a fake controller, on which drivers are tested."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Faults:
    """Faults of a fake controller, each with the number of the motion at which it occurs.

    Motions are numbered from 1; 0 means that the fault does not occur.

    Attributes:
        drop_before: motion whose command ends the connection; the motion is not made.
        drop_after: motion after which the connection ends, before the controller reports the result.
        late: motion whose result is reported late.
        seconds: delay of a late report [s].
        stop_at: motion in whose middle the emergency stop is pressed.
        stuck: motion that pushes against an obstacle half way without a trip of the probe, for robots with a force
            sensor.
        silent: first motion from which on the controller sends nothing, although the connection stays open.
        beside: motion whose contact is reported ``shift`` beside the line.
        along: motion whose contact is reported ``shift`` before its place.
        missed: motion whose contact ends it, but is reported as none.
        never: first motion from which on the probe does not trigger.
        shift: error of a reported contact [m].
    """

    drop_before: int = 0
    drop_after: int = 0
    late: int = 0
    seconds: float = 1.0
    stop_at: int = 0
    stuck: int = 0
    silent: int = 0
    beside: int = 0
    along: int = 0
    missed: int = 0
    never: int = 0
    shift: float = 5e-4
