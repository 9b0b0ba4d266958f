"""What may go wrong in a fake controller: told beforehand, so that a driver can be tried on it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Faults:
    """Faults of a fake, by the number of the motion, from 1; 0 is never.

    Attributes:
        drop_before: the connection ends when this motion arrives, which is not made.
        drop_after: it ends when this motion has been made, before the controller says so.
        late: this motion is answered ``seconds`` late.
        seconds: of it.
        stop_at: the emergency stop is pressed in the middle of this motion.
        stuck: this motion pushes against something half way, and the probe does not trip: of a robot that feels forces.
        silent: from this motion on nothing is said, though the connection stays.
    """

    drop_before: int = 0
    drop_after: int = 0
    late: int = 0
    seconds: float = 1.0
    stop_at: int = 0
    stuck: int = 0
    silent: int = 0
