"""Write the URScript programs of the driver of Universal Robots, one for each motion.

A program polls a digital input while a thread moves, as the probing programs of :mod:`tanteo.machines.programs` do. It
writes its result to output registers, which RTDE returns. Source: Universal Robots' Script Manual (``movel``, threads,
``write_output_integer_register``).
"""

from __future__ import annotations

from collections.abc import Sequence

from tanteo.geometry import SO3
from tanteo.geometry.typing import Transforms

NUMBER, RESULT, PLACE = 24, 25, 24
"""Output registers: number and result of a program (integers), and first of six registers of the TCP's pose."""
ARRIVED, HIT, TRIPPED, PUSHED = 1, 2, 3, 4
"""Results of a program."""
_BRAKE = 2.0
"""Deceleration after a contact [m/s^2]."""

_GUARDED = """def tanteo_{number}():
  global arrived = False
  thread search():
    movel({goal}, a={acceleration:.4f}, v={speed:.6f})
    arrived = True
    while True:
      sync()
    end
  end
  write_output_integer_register({RESULT}, 0)
  write_output_integer_register({NUMBER}, {number})
  if get_standard_digital_in({input}):
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
  write_output_integer_register({RESULT}, 0)
  write_output_integer_register({NUMBER}, {number})
  movel({goal}, a={acceleration:.4f}, v={speed:.6f})
  write_output_integer_register({RESULT}, {ARRIVED})
end
"""
STOP = "def tanteo_stop():\n  stopl(5.0)\nend\n"
"""Program that replaces the running one and stops the robot."""


def guarded(number: int, T: Transforms, speed: float, digital_input: int, force: float) -> str:
    """Return the program of a straight motion that ends at a contact or at a force.

    Args:
        number: number of the program.
        T: pose of the TCP at the end ``(4, 4)`` [m].
        speed: speed [m/s].
        digital_input: number of the probe's digital input.
        force: increase of the force at which the motion ends [N].
    """
    motion = _motion(number, T, speed)
    return _GUARDED.format(input=digital_input, force=force, brake=_BRAKE, places=_places(), **motion)


def plain(number: int, T: Transforms, speed: float) -> str:
    """Return the program of a straight motion.

    Args:
        number: number of the program.
        T: pose of the TCP at the end ``(4, 4)`` [m].
        speed: speed [m/s].
    """
    return _PLAIN.format(**_motion(number, T, speed))


def pose_of(T: Transforms) -> Sequence[float]:
    """Return a pose as URScript writes it: position [m] and rotation vector [rad].

    Args:
        T: pose ``(4, 4)`` [m].
    """
    return [float(v) + 0.0 for v in (*T[:3, 3], *SO3.log(T[:3, :3]))]


def _motion(number: int, T: Transforms, speed: float) -> dict[str, object]:
    goal = "p[" + ", ".join(f"{v:.7f}" for v in pose_of(T)) + "]"
    results = {"ARRIVED": ARRIVED, "HIT": HIT, "TRIPPED": TRIPPED, "PUSHED": PUSHED}
    acceleration = max(0.1, 4 * speed)
    motion = {"number": number, "goal": goal, "speed": speed, "acceleration": acceleration}
    return {**motion, "NUMBER": NUMBER, "RESULT": RESULT, **results}


def _places() -> str:
    return "\n".join(f"  write_output_float_register({PLACE + k}, here[{k}])" for k in range(6))
