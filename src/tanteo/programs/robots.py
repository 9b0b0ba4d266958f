"""Probing programs of robots: URScript, KRL, RAPID, FANUC TP. The tool's z is the stylus, its TCP the ball's centre.

Read for each: URScript ``to_str`` and threads (Script Manual e-Series, 14.1); RAPID ``SearchL`` with its stop and
``ERR_WHLSEARCH``, TP ``SKIP CONDITION`` with ``Skip,LBL,PR=LPOS``, in public programs. KRL's search is an
interrupt with ``BRAKE`` and ``RESUME``, which ends the subprogram that moves and needs ``$ADVANCE`` 0 (KRL reference,
by way of articles on it); nobody here has run it.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator

import numpy as np

from tanteo.io import BRANDS, pose_as_brand
from tanteo.lie import SE3
from tanteo.programs.job import Job, Touch, first_way, transfer
from tanteo.typing import Rotations, Vectors

_COLUMNS = "id,x_mm,y_mm,z_mm,radius_mm,dx,dy,dz"
_TRAVEL = 0.1
"""Speed between touches [m/s]."""


def _header(job: Job, log: list[str]) -> list[str]:
    return [
        f"tanteo plan: {len(job.touches)} touches of {job.part}",
        job.message,
        "frame: world of the plan = the robot's base; tool: TCP at the centre of the ball, z along the stylus,",
        f"away from the flange; ball radius {1e3 * job.radius:g} mm; probe on digital input 1 (UR: 0), high at contact",
        "before it starts: a free straight way from where the robot is to the first point.",
        "around the part nothing is known: look at every motion, and run it without the part and slowly first",
        *log,
    ]


def _ways(job: Job) -> Iterator[tuple[Touch, list[tuple[Vectors, Rotations]]]]:
    """Each touch, and the way to its outer point from the one before."""
    before: Touch | None = None
    for touch in job.touches:
        way = first_way(job, touch) if before is None else transfer(job, before, touch)
        ahead = [*way[1:], (np.full(3, np.inf), touch.tool)]
        stays = [np.allclose(p, q) and np.allclose(R, Q) for (p, R), (q, Q) in zip(way, ahead, strict=True)]
        yield touch, [there for there, stay in zip(way, stays, strict=True) if not stay]
        before = touch


def _pose(name: str, place: Vectors, tool: Rotations) -> str:
    """A pose in a controller's syntax."""
    brand = BRANDS[name]
    values = pose_as_brand(name, SE3.from_parts(tool, place)) + 0.0
    of_place, of_turn = (4 if brand.metre < 1 else 7), (5 if brand.radian < 1 else 7)
    texts = [f"{v:.{of_place}f}" for v in values[:3]] + [f"{v:.{of_turn}f}" for v in values[3:]]
    return brand.syntax.format(*(t.removeprefix("-") if not float(t) else t for t in texts))


def _facts(job: Job, touch: Touch) -> str:
    """What a row of the log has behind the place."""
    d = ",".join(f"{v:.6f}" for v in np.round(touch.direction, 6) + 0.0)
    return f"{1e3 * job.radius:g},{d}"


def ur(job: Job) -> str:
    """URScript: a thread moves, the program watches the input."""
    log = [
        "log: lines of a readings file (CSV) in the log of PolyScope (textmsg): copy those that begin with a number,"
    ]
    log += [f"and the line of columns above them: {_COLUMNS.replace('_mm', '_m', 3)}"]
    lines = [f"# {text}" for text in _header(job, log)] + _UR.format(feed=job.feed).splitlines()
    lines += [f'  textmsg("{_COLUMNS.replace("_mm", "_m", 3)}")']
    for touch, way in _ways(job):
        lines.append(f"  # touch {touch.number}: {touch.face}")
        lines += [f"  movel({_pose('ur', place, tool)}, a=0.5, v={_TRAVEL})" for place, tool in way]
        places = ", ".join(_pose("ur", place, touch.tool) for place in (touch.start, touch.stop))
        lines.append(f'  touch("{touch.number}", {places}, "{_facts(job, touch)}")')
        lines.append(f"  movel({_pose('ur', touch.outer, touch.tool)}, a=0.5, v={_TRAVEL})")
    return "\n".join([*lines, "end", ""])


_UR = """def tanteo_probe():
  global goal = p[0, 0, 0, 0, 0, 0]
  global arrived = False
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
  def touch(number, start, stop, facts):
    if met():
      fail("the probe is high before the touch")
    end
    movel(start, a=0.5, v=0.05)
    if met():
      fail("the probe met something on the way to the start")
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
      fail("nothing was met")
    end
    line = str_cat(number, ",")
    line = str_cat(line, str_cat(to_str(here[0]), ","))
    line = str_cat(line, str_cat(to_str(here[1]), ","))
    line = str_cat(line, str_cat(to_str(here[2]), ","))
    textmsg(str_cat(line, facts))
    movel(start, a=0.5, v=0.05)
  end"""


def abb(job: Job) -> str:
    """RAPID: ``SearchL``, with a file of readings in ``HOME:``."""
    log = ["log: HOME:/tanteo_touches.csv, a readings file", "set tProbe and diProbe to those of the cell"]
    lines = ["MODULE TanteoProbe", *(f"  ! {text}" for text in _header(job, log)), *_RAPID_DATA.splitlines()]
    lines += ["  PROC TanteoProbe()", '    Open "HOME:"\\File:="tanteo_touches.csv",log\\Write;']
    lines += [f'    Write log,"{_COLUMNS}";', "    ConfL\\Off;"]
    for touch, way in _ways(job):
        lines.append(f"    ! touch {touch.number}: {touch.face}")
        lines += [f"    MoveL {_robtarget(place, tool)},v100,fine,tProbe\\WObj:=wobj0;" for place, tool in way]
        places = ",".join(_robtarget(place, touch.tool) for place in (touch.start, touch.stop))
        lines.append(f'    Touch "{touch.number}",{places},"{_facts(job, touch)}";')
        lines.append(f"    MoveL {_robtarget(touch.outer, touch.tool)},v100,fine,tProbe\\WObj:=wobj0;")
    lines += ["    Close log;", "  ENDPROC", "", *_RAPID_TOUCH.format(feed=1e3 * job.feed).splitlines()]
    return "\n".join([*lines, "ENDMODULE", ""])


def _robtarget(place: Vectors, tool: Rotations) -> str:
    pose = _pose("abb", place, tool)[1:-1].replace(", ", ",")
    return f"[{pose},[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"


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
    Write log,row + "," + NumToStr(found.trans.z,4) + "," + facts;
    MoveL start,v50,fine,tProbe\\WObj:=wobj0;
  ERROR
    IF ERRNO=ERR_WHLSEARCH OR ERRNO=ERR_SIGSUPSEARCH THEN
      TPWrite "tanteo: nothing was met, or the probe was high before, at touch " + number;
      Stop;
      EXIT;
    ENDIF
  ENDPROC
"""


def kuka(job: Job) -> str:
    """KRL: an interrupt ends the motion and keeps where it was; two files, of which the second is the log."""
    log = [
        "two files: save what is below the line of dashes as TANTEO.DAT beside TANTEO.SRC",
        "log: FOUND[1].. of TANTEO.DAT after the run, positions of the ball's centre in millimetres",
        "the search by interrupt was not verified: try it on the controller with a hand on the stop",
    ]
    lines = ["&ACCESS RVP", "DEF TANTEO( )", *(f"; {text}" for text in _header(job, log)), *_KRL.splitlines()]
    for touch, way in _ways(job):
        lines.append(f"; touch {touch.number}: {touch.face}")
        lines += [f"LIN {_frame(place, tool)}" for place, tool in way]
        places = [f"{name}={_frame(p, touch.tool)}" for name, p in (("START", touch.start), ("GOAL", touch.stop))]
        lines += [*places, f"TOUCH({touch.number})", f"LIN {_frame(touch.outer, touch.tool)}"]
    lines += ["END", "", *_KRL_SEARCH.format(feed=job.feed).splitlines(), "; " + 40 * "-", "DEFDAT TANTEO PUBLIC"]
    lines += ["DECL INT NUMBER=0", "DECL BOOL MET=FALSE", "DECL FRAME START", "DECL FRAME GOAL"]
    lines += [f"DECL FRAME FOUND[{len(job.touches)}]"]
    zero = "{X 0.0, Y 0.0, Z 0.0, A 0.0, B 0.0, C 0.0}"
    return "\n".join([*lines, *(f"FOUND[{t.number}]={zero}" for t in job.touches), "ENDDAT", ""])


def _frame(place: Vectors, tool: Rotations) -> str:
    return _pose("kuka", place, tool)


_KRL = f"""BAS(#INITMOV,0)
$ADVANCE=0
$BASE=$NULLFRAME
$TOOL=TOOL_DATA[1]
$VEL.CP={_TRAVEL}"""

_KRL_SEARCH = """DEF TOUCH(N:IN)
INT N
NUMBER=N
MET=FALSE
$VEL.CP=0.05
IF $IN[1] THEN
HALT ; the probe is high before the touch
ENDIF
LIN START
WAIT SEC 0
IF $IN[1] THEN
HALT ; the probe met something on the way
ENDIF
SEARCH()
IF NOT MET THEN
HALT ; nothing was met
ENDIF
$VEL.CP=0.05
LIN START
$VEL.CP=0.1
END

DEF SEARCH()
INTERRUPT DECL 20 WHEN $IN[1]==TRUE DO CONTACT()
SEARCH_MOTION()
END

DEF SEARCH_MOTION()
INTERRUPT ON 20
$VEL.CP={feed:.6f}
LIN GOAL
WAIT SEC 0
INTERRUPT OFF 20
END

DEF CONTACT()
INTERRUPT OFF 20
BRAKE F
FOUND[NUMBER]=$POS_INT
MET=TRUE
RESUME
END
"""


def fanuc(job: Job) -> str:
    """A TP program: touches go to position registers from 101 on."""
    log = [f"log: PR[101] to PR[{100 + len(job.touches)}], X Y Z of the ball's centre in millimetres"]
    log += ["PR=LPOS at the skip needs the option High-Speed Skip. All positions have CONFIG N U T"]
    steps = [f"!{row}" for text in _header(job, log) for row in textwrap.wrap(text, 30)]
    steps += ["UFRAME_NUM=0", "UTOOL_NUM=1", "SKIP CONDITION DI[1]=ON"]
    poses: list[str] = []

    def point(place: Vectors, tool: Rotations) -> int:
        poses.append(_position(len(poses) + 1, _pose("fanuc", place, tool)))
        return len(poses)

    for touch, way in _ways(job):
        steps.append(f"!touch {touch.number}: {touch.face[:16]}")
        steps += [f"L P[{point(place, tool)}] {1e3 * _TRAVEL:g}mm/sec FINE" for place, tool in way]
        start, stop = (point(place, touch.tool) for place in (touch.start, touch.stop))
        steps += ["IF DI[1]=ON,JMP LBL[998]", f"L P[{start}] 50mm/sec FINE", "IF DI[1]=ON,JMP LBL[998]"]
        steps += [f"L P[{stop}] {max(1e3 * job.feed, 0.1):.1f}mm/sec FINE Skip,LBL[999],PR[{100 + touch.number}]=LPOS"]
        steps += [f"L P[{start}] 50mm/sec FINE", f"L P[{len(poses) - 2}] {1e3 * _TRAVEL:g}mm/sec FINE"]
    steps += ["END", "LBL[998:HIGH]", "MESSAGE[PROBE IS HIGH]", "ABORT"]
    steps += ["LBL[999:NOTHING]", "MESSAGE[NOTHING WAS MET]", "ABORT"]
    body = [f"{n:4d}:  {step} ;" for n, step in enumerate(steps, 1)]
    top = ["/PROG  TANTEO", "/ATTR", 'COMMENT\t\t= "TANTEO";', "DEFAULT_GROUP\t= 1,*,*,*,*;", "/MN"]
    return "\n".join([*top, *body, "/POS", *poses, "/END", ""])


def _position(number: int, fields: str) -> str:
    place, turn = fields.split(", W = ")
    lines = [f"P[{number}]{{", "   GP1:", "\tUF : 0, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',"]
    return "\n".join([*lines, f"\t{place},", f"\tW = {turn}", "};"])
