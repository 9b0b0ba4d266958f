"""Probing programs: read back they make the planned touches, clear of the part on every way between."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.io import pose_from_brand
from tanteo.machines.programs import PROGRAMS, job_of, write_program
from tanteo.parts import Surface, signed_distance
from tanteo.planning import plan, probe_of
from tanteo.planning.start import at_pose
from tanteo.posterior import prepare

AXES_3 = [name for name, language in PROGRAMS.builtin.items() if language.points_down]
RADIUS, CLEARANCE = 1.5e-3, 10e-3
T_EXPECTED = SE3.from_parts(SO3.axis_rotation(2, 0.6), np.array([0.42, -0.13, 0.035]))
C = np.diag([1e-3] * 3 + [5e-3] * 3) ** 2
NUMBER = r"-?\d+\.\d+"


def job_for(part, **stylus):
    probe = probe_of(
        2e-5, contact=True, radius=RADIUS, approach=[0, 0, -1], cone=np.pi / 2, clearance=CLEARANCE, **stylus
    )
    found = plan(at_pose(prepare(part), T_EXPECTED, C), probe, 0.3e-3)
    assert found.reached
    return job_of(found, part, probe, C, feed=2e-3)


@pytest.fixture(scope="module")
def part(parts):
    return parts["bracket_left"]


@pytest.fixture(scope="module")
def jobs(part):
    upright, side = job_for(part, stylus=[0, 0, 1]), job_for(part, stylus_along_motion=True)
    return {name: upright if name in AXES_3 else side for name in PROGRAMS.builtin}


def expected_gap(part, points):
    """Return the signed distance of the ball's centre from the part at its expected pose [m]."""
    surface = Surface(part.vertices, part.triangles)
    return signed_distance(surface, SE3.apply(SE3.inverse(T_EXPECTED), np.atleast_2d(points)))[0]


def test_the_ball_stops_where_it_touches(jobs, part):
    for touch in jobs["linuxcnc"].touches:
        assert expected_gap(part, touch.contact)[0] == pytest.approx(RADIUS, abs=1e-6)
        for place, sign in ((touch.start, 1), (touch.contact, 1), (touch.stop, 1)):
            way = place - touch.start
            assert np.linalg.norm(way - (way @ touch.direction) * touch.direction) < 1e-9
            assert sign * (way @ touch.direction) >= 0
        assert (touch.stop - touch.contact) @ touch.direction >= 2e-3


def test_the_stylus_has_clearance_above_the_ball(jobs, part):
    """All the way from start to contact, half as thick as the ball."""
    for touch in jobs["grbl"].touches:
        for share in np.linspace(0, 1, 7):
            centre = touch.start + share * (touch.contact - touch.start)
            shaft = centre + np.linspace(RADIUS, 0.3, 200)[:, None] * np.array([0, 0, 1])
            assert expected_gap(part, shaft).min() > 0.5 * RADIUS
        assert touch.direction[2] <= 1e-9


def test_the_tool_of_a_robot_points_along_the_motion(jobs, part):
    for touch in jobs["ur"].touches:
        np.testing.assert_allclose(touch.tool[:, 2], touch.direction, atol=1e-9)
        np.testing.assert_allclose(touch.tool @ touch.tool.T, np.eye(3), atol=1e-9)
        back = touch.start + np.linspace(0, 0.3, 200)[:, None] * -touch.direction
        assert expected_gap(part, back).min() > 0.5 * RADIUS


def brand_poses(name, texts):
    return [pose_from_brand(name, np.array(re.findall(NUMBER, text), dtype=float)) for text in texts]


def steps_ur(text):
    for line in text[text.index('textmsg("id') :].splitlines():
        poses = brand_poses("ur", re.findall(r"p\[([^\]]*)\]", line))
        if poses:
            yield ("touch" if line.strip().startswith("touch(") else "move"), poses


def steps_abb(text):
    for line in text.splitlines():
        word = line.split()[0] if line.split() else ""
        poses = [
            pose_from_brand("abb", np.array(re.findall(NUMBER, target), dtype=float))
            for target in re.findall(r"\[\[[^\]]*\],\[[^\]]*\],\[0,0,0,0\]", line)
        ]
        if poses and word in ("MoveL", "Touch"):
            yield ("touch" if word == "Touch" else "move"), poses


def steps_kuka(text):
    kept = []
    for line in text.splitlines():
        poses = brand_poses("kuka", re.findall(r"\{(X[^}]*)\}", line))
        if line.startswith("LIN {"):
            yield "move", poses
        elif re.match(r"P_START=|P_GOAL=", line):
            kept += poses
        elif re.match(r"TOUCH\(\d", line):
            yield "touch", kept
            kept = []


def steps_fanuc(text):
    body, data = text.split("/POS")
    points = {
        int(number): brand_poses("fanuc", [fields])[0]
        for number, fields in re.findall(r"P\[(\d+)\]\{.*?(X =.*?)\};", data, re.DOTALL)
    }
    moves = [(int(k), "Skip" in rest) for k, rest in re.findall(r"L P\[(\d+)\] \S+ FINE(.*);", body)]
    for n, (k, skip) in enumerate(moves):
        if skip:
            yield "touch", [points[moves[n - 1][0]], points[k]]
        elif not (n + 1 < len(moves) and moves[n + 1][1]) and not (n and moves[n - 1][1]):
            yield "move", [points[k]]


READ = {"ur": steps_ur, "abb": steps_abb, "kuka": steps_kuka, "fanuc": steps_fanuc}


@pytest.mark.parametrize("name", READ)
def test_robot_programs_are_the_planned_touches(name, jobs, part):
    job = jobs[name]
    steps = list(READ[name](write_program(name, job)))
    touches = [poses for kind, poses in steps if kind == "touch"]
    assert len(touches) == len(job.touches)
    for (start, stop), touch in zip(touches, job.touches, strict=True):
        for T, place in ((start, touch.start), (stop, touch.stop)):
            np.testing.assert_allclose(T[:3, 3], place, atol=1e-6)
            np.testing.assert_allclose(T[:3, :3], touch.tool, atol=1e-5)
    places = [p for kind, poses in steps for p in (poses if kind == "move" else [poses[0], poses[0]])]
    for a, b in pairwise(places):
        way = a[:3, 3] + np.linspace(0, 1, 60)[:, None] * (b[:3, 3] - a[:3, 3])
        assert expected_gap(part, way).min() > CLEARANCE - 1e-3
        assert min(a[2, 2], b[2, 2]) <= 1e-6  # the tool never points up


@pytest.mark.parametrize("name", AXES_3)
def test_gcode_is_the_planned_touches(name, jobs, part):
    job, at, touches, ways = jobs[name], dict.fromkeys("XYZ", np.nan), [], []
    for line in write_program(name, job).splitlines():
        words = {a: float(v) for a, v in re.findall(r"([A-Z])(-?[\d.]+)", line)} if line.startswith("G") else {}
        if not line.startswith(("G0 ", "G38.2")):
            continue
        before = np.array(list(at.values())) / 1e3
        at |= {a: v for a, v in words.items() if a in at}
        after = np.array(list(at.values())) / 1e3
        if line.startswith("G38.2"):
            touches.append((before, after, words["F"]))
        elif np.isfinite(before).all():
            ways.append((before, after))
    for (start, stop, feed), touch in zip(touches, job.touches, strict=True):
        np.testing.assert_allclose([start, stop], [touch.start, touch.stop], atol=1e-7)
        assert feed == pytest.approx(120)
    back = {tuple(stop) for _, stop, _ in touches}
    for a, b in ways:
        if tuple(a) not in back:  # a way back begins where the ball was stopped
            assert expected_gap(part, a + np.linspace(0, 1, 60)[:, None] * (b - a)).min() > RADIUS


@pytest.mark.skipif(shutil.which("rs274") is None, reason="rs274 of linuxcnc-uspace is not installed")
@pytest.mark.parametrize("name", AXES_3)
def test_linuxcnc_runs_the_planned_touches(name, jobs, tmp_path):
    (tmp_path / "probe.ngc").write_text(write_program(name, jobs[name]), encoding="utf-8")
    (tmp_path / "tool.tbl").write_text("", encoding="utf-8")
    command = ["rs274", "-g", "-t", "tool.tbl", "probe.ngc"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=20)
    assert done.returncode == 0, done.stderr
    stops = [
        [float(v) / 1e3 for v in words.split(",")[:3]]
        for words in re.findall(r"STRAIGHT_PROBE\(([^)]*)\)", done.stdout)
    ]
    np.testing.assert_allclose(stops, [t.stop for t in jobs[name].touches], atol=1e-6)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_rapid_is_well_formed(jobs):
    checker = pytest.importorskip("rapidchecker.check")
    assert checker.check_format(write_program("abb", jobs["abb"])) == []


def test_lines_are_short_enough(jobs):
    assert max(map(len, write_program("grbl", jobs["grbl"]).splitlines())) <= 80
    assert max(len(text) for text in re.findall(r'"([^"]*)"', write_program("abb", jobs["abb"]))) <= 80
    assert all(len(row) <= 31 for row in re.findall(r":  (!.*) ;", write_program("fanuc", jobs["fanuc"])))


@pytest.mark.parametrize("name", PROGRAMS.builtin)
def test_every_program_states_its_assumptions(name, jobs):
    text = " ".join(re.sub(r"\n[ \d:;!#()]*", " ", write_program(name, jobs[name])).replace(" ; ", " ").split())
    for words in ("tanteo plan", "bracket_left", "radius 1.5 mm", "log:", "frame"):
        assert words in text


def test_a_3_axis_machine_does_not_touch_from_below(part):
    probe = probe_of(2e-5, contact=True, radius=RADIUS, approach=[0, 0, 1], cone=0.5)
    found = plan(at_pose(prepare(part), T_EXPECTED, C), probe, 3e-3, max_measurements=2)
    job = job_of(found, part, probe, C, feed=2e-3)
    with pytest.raises(InputError, match=r"touch 1 on face .* from below"):
        write_program("linuxcnc", job)
    for name, read in READ.items():
        places = [p[:3, 3] for kind, poses in read(write_program(name, job)) for p in poses[:1]]
        for a, b in pairwise(places):
            assert expected_gap(part, a + np.linspace(0, 1, 60)[:, None] * (b - a)).min() > 0.5 * CLEARANCE


def test_an_unknown_controller_is_named(jobs):
    with pytest.raises(InputError, match="Did you mean 'linuxcnc'"):
        write_program("linuxnc", jobs["ur"])


def test_a_file_in_place_of_a_controller_names_the_way():
    with pytest.raises(
        InputError, match=r"expected one of linuxcnc, .* A file is written by '--program linuxcnc > FILE'"
    ):
        write_program("probe.ngc", None)


@pytest.fixture(scope="module")
def unsure(jobs):
    """The job of a robot whose second touch misses in half of the placements."""
    first, second, *rest = jobs["ur"].touches
    return replace(jobs["ur"], touches=(replace(first, miss=0.0), replace(second, miss=0.5), *rest))


def test_a_robot_goes_on_after_a_touch_without_contact(unsure):
    """Each touch states how often it misses; misses in a row that are improbable together end the program."""
    urscript = write_program("ur", unsure)
    chances = [float(word) for word in re.findall(r'touch\("\d+", ([\d.]+), p', urscript)]
    assert chances[:2] == [0.1, 0.5]
    assert len(chances) == len(unsure.touches)
    miss = urscript[urscript.index("if not met():\n      works") :].split("\n    end\n")[0]
    assert all(line in miss for line in ("works = works * miss", "if works < 0.02:", "movel(start"))


def test_a_controller_that_counts_no_misses_stops_at_the_first(jobs, unsure):
    """With a broken probe, a program that goes on would push past each expected contact."""
    touches = tuple(replace(t, miss=m.miss) for t, m in zip(jobs["grbl"].touches, unsure.touches, strict=False))
    for language in ("grbl", "linuxcnc"):
        assert "G38.3" not in write_program(language, replace(jobs["grbl"], touches=touches))
