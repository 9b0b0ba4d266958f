r"""Write ABB RAPID programs: ``SearchL\Stop`` with the error ``ERR_WHLSEARCH`` if there is no contact; file as log.

The use of ``SearchL`` follows published programs. ``tests/machines/programs`` checks the syntax with ``rapidchecker``.
"""

from __future__ import annotations

from tanteo.geometry.typing import Rotations, Vectors
from tanteo.machines.programs.job import Job
from tanteo.machines.programs.robot import COLUMNS, facts, pose_text, robot_header, ways


def abb(job: Job) -> str:
    """Return the RAPID program of a job; it logs its readings to a file in ``HOME:``.

    Args:
        job: touches of the program.
    """
    log = ["log: HOME:/tanteo_touches.csv, a readings file", "set tProbe and diProbe to those of the cell"]
    lines = ["MODULE TanteoProbe", *(f"  ! {text}" for text in robot_header(job, log)), *_RAPID_DATA.splitlines()]
    lines += ["  PROC TanteoProbe()", '    Open "HOME:"\\File:="tanteo_touches.csv",log\\Write;']
    lines += [f'    Write log,"{COLUMNS},"\\NoNewLine;', f'    Write log,"{_HAND}";', "    ConfL\\Off;"]
    for touch, way in ways(job):
        lines.append(f"    ! touch {touch.number}: {touch.face}")
        lines += [f"    MoveL {_robtarget(place, tool)},v100,fine,tProbe\\WObj:=wobj0;" for place, tool in way]
        places = ",".join(_robtarget(place, touch.tool) for place in (touch.start, touch.stop))
        lines.append(f'    Touch "{touch.number}",{places},"{facts(job, touch)}";')
        lines.append(f"    MoveL {_robtarget(touch.outer, touch.tool)},v100,fine,tProbe\\WObj:=wobj0;")
    lines += ["    Close log;", "  ENDPROC", "", *_RAPID_TOUCH.format(feed=1e3 * job.feed).splitlines()]
    return "\n".join([*lines, "ENDMODULE", ""])


def _robtarget(place: Vectors, tool: Rotations) -> str:
    pose = pose_text("abb", place, tool)[1:-1].replace(", ", ",")
    return f"[{pose},[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"


_HAND = "hand_x_mm,hand_y_mm,hand_z_mm,hand_q1,hand_q2,hand_q3,hand_q4"
"""Columns of the pose of the tool; RAPID's strings have at most 80 characters."""

_RAPID_DATA = """  PERS tooldata tProbe := [TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,50],[1,0,0,0],0,0,0]];
  VAR iodev log;
  VAR robtarget found;
"""

_RAPID_TOUCH = """  PROC Touch(string number,robtarget start,robtarget stop,string facts)
    VAR speeddata slow := [{feed:.4g},10,10,10];
    VAR string row;
    MoveL start,v50,fine,tProbe\\WObj:=wobj0;
    SearchL\\Stop,diProbe,found,stop,slow,tProbe\\WObj:=wobj0;
    row := number + "," + NumToStr(found.trans.x,4) + "," + NumToStr(found.trans.y,4);
    Write log,row + "," + NumToStr(found.trans.z,4) + "," + facts + ","\\NoNewLine;
    row := NumToStr(found.trans.x,4) + "," + NumToStr(found.trans.y,4) + "," + NumToStr(found.trans.z,4);
    Write log,row + ","\\NoNewLine;
    row := NumToStr(found.rot.q1,6) + "," + NumToStr(found.rot.q2,6) + "," + NumToStr(found.rot.q3,6);
    Write log,row + "," + NumToStr(found.rot.q4,6);
    MoveL start,v50,fine,tProbe\\WObj:=wobj0;
  ERROR
    IF ERRNO=ERR_WHLSEARCH OR ERRNO=ERR_SIGSUPSEARCH THEN
      TPWrite "tanteo: no contact, or the probe was high before, at touch " + number;
      Stop;
      EXIT;
    ENDIF
  ENDPROC
"""
