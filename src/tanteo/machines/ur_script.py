"""Write the URScript programs of the driver of Universal Robots, one for each motion.

A program polls a digital input while a thread moves, as the probing programs of :mod:`tanteo.machines.programs` do. It
writes its result to output registers, which RTDE returns. Source: Universal Robots' Script Manual (``movel``, threads,
``write_output_integer_register``, ``get_tcp_offset``, ``point_dist``, and ``norm``, which is the absolute value of a
number and the Euclidean norm of a list). Before it moves, a program compares the TCP and the start with those that the
driver has received.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tanteo.geometry import SO3
from tanteo.geometry.typing import Transforms

NUMBER, RESULT, PLACE = 24, 25, 24
"""Output registers: number and result of a program (integers), and first of six registers of the TCP's pose."""
ARRIVED, HIT, TRIPPED, PUSHED, CHANGED = 1, 2, 3, 4, 5
"""Results of a program; ``CHANGED`` if its TCP or its start is not that of the driver, so that it has not moved."""
TCP_NEAR, START_NEAR = 1e-5, 2e-4
"""Accepted difference of the TCP's offset [m, rad], and of the start [m]: ``MachineLimits.arrival``."""
BRAKE = 2.0
"""Deceleration after a contact [m/s^2]."""

_CHECKED = """  write_output_integer_register({RESULT}, 0)
  write_output_integer_register({NUMBER}, {number})
  tcp = get_tcp_offset()
  wanted = {tcp}
  off = norm([tcp[0] - wanted[0], tcp[1] - wanted[1], tcp[2] - wanted[2]])
  turned = norm([tcp[3] - wanted[3], tcp[4] - wanted[4], tcp[5] - wanted[5]])
  if off > {tcp_near:.6f} or turned > {tcp_near:.6f} or point_dist(get_actual_tcp_pose(), {start}) > {start_near:.6f}:
    write_output_integer_register({RESULT}, {CHANGED})
    halt
  end
"""
_GUARDED = """def tanteo_{number}():
  global arrived = False
  thread search():
    movel({goal}, a={acceleration:.4f}, v={speed:.6f})
    arrived = True
    while True:
      sync()
    end
  end
{checked}  if get_standard_digital_in({input}):
    write_output_integer_register({RESULT}, {TRIPPED})
    halt
  end
  quiet = force()
  pushed = False
  handle = run search()
  while not get_standard_digital_in({input}) and not arrived and not pushed:
    pushed = force() > quiet + {force:.1f}
    sync()
  end
  here = get_actual_tcp_pose()
  hit = get_standard_digital_in({input})
  kill handle
  stopl({brake:.2f})
{places}
  if hit:
    write_output_integer_register({RESULT}, {HIT})
  elif pushed:
    write_output_integer_register({RESULT}, {PUSHED})
  else:
    write_output_integer_register({RESULT}, {ARRIVED})
  end
end
"""
_PLAIN = """def tanteo_{number}():
{checked}  movel({goal}, a={acceleration:.4f}, v={speed:.6f})
  write_output_integer_register({RESULT}, {ARRIVED})
end
"""
STOP = "def tanteo_stop():\n  stopl(5.0)\nend\n"
"""Program that replaces the running one and stops the robot."""


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """Straight motion with the conditions under which the robot makes it.

    Attributes:
        number: number of the program.
        start: pose of the TCP before the motion ``(6,)`` [m, rad].
        T: pose of the TCP at the end ``(4, 4)`` [m].
        speed: speed [m/s].
        tcp: offset of the TCP from the flange ``(6,)`` [m, rad].
    """

    number: int
    start: Sequence[float]
    T: Transforms
    speed: float
    tcp: Sequence[float]


def guarded(way: Way, digital_input: int, force: float) -> str:
    """Return the program of a straight motion that ends at a contact or at a force.

    Args:
        way: motion.
        digital_input: number of the probe's digital input.
        force: increase of the force at which the motion ends [N].
    """
    return _GUARDED.format(input=digital_input, force=force, brake=BRAKE, places=_places(), **_motion(way))


def plain(way: Way) -> str:
    """Return the program of a straight motion.

    Args:
        way: motion.
    """
    return _PLAIN.format(**_motion(way))


def pose_of(T: Transforms) -> Sequence[float]:
    """Return a pose as URScript writes it: position [m] and rotation vector [rad].

    Args:
        T: pose ``(4, 4)`` [m].
    """
    return [float(v) + 0.0 for v in (*T[:3, 3], *SO3.log(T[:3, :3]))]


def _motion(way: Way) -> dict[str, object]:
    start, tcp, goal = (
        "p[" + ", ".join(f"{v:.7f}" for v in pose) + "]" for pose in (way.start, way.tcp, pose_of(way.T))
    )
    results = {"ARRIVED": ARRIVED, "HIT": HIT, "TRIPPED": TRIPPED, "PUSHED": PUSHED, "CHANGED": CHANGED}
    names = {"number": way.number, "NUMBER": NUMBER, "RESULT": RESULT, **results}
    near = {"tcp_near": TCP_NEAR, "start_near": START_NEAR}
    checked = _CHECKED.format(start=start, tcp=tcp, **near, **names)
    return {"goal": goal, "speed": way.speed, "acceleration": max(0.1, 4 * way.speed), "checked": checked, **names}


def _places() -> str:
    return "\n".join(f"  write_output_float_register({PLACE + k}, here[{k}])" for k in range(6))
