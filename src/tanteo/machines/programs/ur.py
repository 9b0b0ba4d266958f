"""Write URScript programs: a thread moves the tool while the program polls a digital input.

Sources: ``to_str``, ``textmsg`` and threads (Script Manual e-Series, 14.1), and polling loops of published drivers.
"""

from __future__ import annotations

from tanteo.machines.programs.job import APPROACH, DEAD_PROBE, TRAVEL, Job
from tanteo.machines.programs.robot import COLUMNS, facts, miss_text, misses, pose_text, robot_header, ways


def ur(job: Job) -> str:
    """Return the URScript program of a job; it logs its readings with ``textmsg``.

    Args:
        job: touches of the program.
    """
    log = [
        "log: lines of a readings file (CSV) in the log of PolyScope (textmsg): copy those that begin with a number,"
    ]
    log += [f"and the line of columns above them: {_COLUMNS}", misses(job)]
    header = robot_header(job, log, "probe on digital input 0, high at contact")
    lines = [f"# {text}" for text in header]
    lines += _UR.format(feed=job.feed, approach=APPROACH, least=DEAD_PROBE).splitlines()
    lines += [f'  textmsg("{_COLUMNS}")']
    for touch, way in ways(job):
        lines.append(f"  # touch {touch.number}: {touch.face}")
        lines += [f"  movel({pose_text('ur', place, tool)}, a=0.5, v={TRAVEL})" for place, tool in way]
        places = ", ".join(pose_text("ur", place, touch.tool) for place in (touch.start, touch.stop))
        lines.append(f'  touch("{touch.number}", {miss_text(touch)}, {places}, "{facts(job, touch)}")')
        lines.append(f"  movel({pose_text('ur', touch.outer, touch.tool)}, a=0.5, v={TRAVEL})")
    return "\n".join([*lines, "end", ""])


_HAND = "hand_x_m,hand_y_m,hand_z_m,hand_rx_rad,hand_ry_rad,hand_rz_rad"
_COLUMNS = COLUMNS.replace("x_mm,y_mm,z_mm", f"x_m,y_m,z_m,{_HAND}")
"""Columns of the log: the position of the ball, and the pose of the tool in the robot's notation."""

_UR = """def tanteo_probe():
  global goal = p[0, 0, 0, 0, 0, 0]
  global arrived = False
  global works = 1.0
  def met():
    return get_standard_digital_in(0)
  end
  thread search():
    movel(goal, a=0.1, v={feed:.6f})
    arrived = True
    while True:
      sync()
    end
  end
  def fail(words):
    popup(words, title="tanteo", error=True, blocking=True)
    halt
  end
  def touch(number, miss, start, stop, facts):
    if met():
      fail("the probe is high before the touch")
    end
    movel(start, a=0.5, v={approach})
    if met():
      fail("the probe touched something on the way to the start")
    end
    goal = stop
    arrived = False
    handle = run search()
    while not met() and not arrived:
      sync()
    end
    here = get_actual_tcp_pose()
    kill handle
    stopl(2.0)
    if not met():
      works = works * miss
      textmsg(str_cat("no contact at touch ", number))
      if works < {least}:
        fail("several touches made no contact: is the probe connected, and the part there?")
      end
      movel(start, a=0.5, v={approach})
      return False
    end
    works = 1.0
    line = str_cat(number, ",")
    line = str_cat(line, str_cat(to_str(here[0]), ","))
    line = str_cat(line, str_cat(to_str(here[1]), ","))
    line = str_cat(line, str_cat(to_str(here[2]), ","))
    k = 0
    while k < 6:
      line = str_cat(line, str_cat(to_str(here[k]), ","))
      k = k + 1
    end
    textmsg(str_cat(line, facts))
    movel(start, a=0.5, v={approach})
    return True
  end"""
