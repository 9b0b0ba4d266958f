"""Answers in the words of controllers, and the whole loop: plan, program, machine, log, answer."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from report_scenes import prism_text
from tanteo.geometry import SE3, SO3
from tanteo.io import pose_from_brand
from tanteo.parts import Surface, signed_distance

EXAMPLES = Path(__file__).parents[2] / "examples"
READINGS = EXAMPLES / "readings" / "bracket_left.csv"
BRACKET = EXAMPLES / "parts" / "bracket_left.step"
LOCATE = ("locate", READINGS, "--part", BRACKET, "--sd", "0.1mm")
NUMBER = re.compile(r"-?\d+\.\d+")


def test_only_the_pose_is_on_standard_output(run):
    got = run(*LOCATE, "--as", "kuka")
    assert got.code == 0
    assert re.fullmatch(r"\{X \S+, Y \S+, Z \S+, A \S+, B \S+, C \S+\}\n", got.out)
    assert "bracket_left at x 420.03" in got.err
    document = json.loads(run(*LOCATE, "--as", "kuka", "--json").out)
    assert document["as"]["text"] + "\n" == got.out
    assert document["as"]["units"] == "mm deg"
    T = pose_from_brand("kuka", np.array(document["as"]["values"]))
    np.testing.assert_allclose(T, document["hypotheses"][0]["pose"]["matrix"], atol=2e-6)


def test_an_unverified_convention_is_reported(run):
    got = run(*LOCATE, "--as", "denso")
    assert got.code == 0
    assert "warning: --as denso: the convention was not verified" in got.err
    assert "confirm one pose on your controller" in got.err


def test_a_work_offset_with_its_tilt(run):
    got = run(*LOCATE, "--wcs", "G54")
    assert got.code == 0
    assert "\nG10 L2 P1 X420.0" in got.out
    assert "warning: --wcs: G54 cannot represent" in got.err
    assert "taken as machine coordinates" in got.err
    document = json.loads(run(*LOCATE, "--wcs", "G54", "--json").out)
    assert document["wcs"]["text"] == got.out
    assert "farthest corner" in document["wcs"]["warnings"][0]


def test_a_frame_that_loses_the_turn_is_refused(run):
    got = run(*LOCATE, "--wcs", "grbl:G54")
    assert (got.code, got.out) == (1, "")
    assert "a turn of 33.0" in got.err
    accepted = run(*LOCATE, "--wcs", "grbl:G54", "--accept-turn-lost")
    assert accepted.code == 0
    assert "\nG10 L2 P1 X420.0" in accepted.out
    haas = run(*LOCATE, "--wcs", "haas:G54")
    assert haas.code == 0
    assert haas.out.splitlines()[-1] == "G17 G68 X0. Y0. R33.013"


@pytest.mark.parametrize("words", [("--as", "ur"), ("--wcs", "G54")])
def test_what_is_not_decided_is_not_written(words, run, tmp_path):
    few = tmp_path / "few.csv"
    few.write_text("".join(READINGS.read_text(encoding="utf-8").splitlines(keepends=True)[:8]), encoding="utf-8")
    got = run("locate", few, "--part", BRACKET, "--sd", "0.1mm", *words)
    assert got.code == 3
    assert got.out == ""
    assert f"error: {words[0]}: expected a decided answer, got insufficient" in got.err
    document = json.loads(run("locate", few, "--part", BRACKET, "--sd", "0.1mm", *words, "--json").out)
    assert document[words[0].strip("-")]["text"] is None
    guess = run("locate", few, "--part", BRACKET, "--sd", "0.1mm", "--as", "ur", "--best-guess")
    assert guess.code == 3
    assert guess.out.startswith("p[")
    assert "the answer is insufficient; this is its best guess" in guess.err


def test_part_and_pose_have_a_probability_each(run, tmp_path):
    """A cube with one small chamfer is certain; which of its poses is not."""
    part, readings = tmp_path / "cube.off", tmp_path / "readings.csv"
    part.write_text(prism_text([(0, 0), (40, 0), (40, 39), (39, 40), (0, 40)], 40))
    rows = ["x_mm,y_mm,z_mm,dx,dy,dz"]
    for u, v in ((10, 12), (25, 14), (18, 30)):
        rows += [f"{u},{v},0,0,0,1", f"{u},{v},40,0,0,-1", f"{u},0,{v},0,1,0", f"0,{u},{v},1,0,0"]
    readings.write_text("\n".join(rows) + "\n")
    words = ("locate", readings, "--part", part, "--units", "mm", "--sd", "0.05mm")
    report = tmp_path / "report.html"
    got = run(*words, "--as", "ur", "--best-guess", "--report", report)
    assert "cube has a probability of 9" in got.err
    assert "in any pose, and" in got.err
    assert "Its pose is one of 12." in got.err  # of which five are listed
    assert "cube in any pose" in report.read_text(encoding="utf-8")
    frame = run(*words, "--wcs", "ur:base", "--best-guess").out
    assert re.search(r"part 9\d\.\d%, this pose \d\d?\.\d%", frame)


def test_an_unknown_object_has_no_pose_at_all(run):
    unknown = EXAMPLES / "readings" / "unknown_part.csv"
    got = run("locate", unknown, "--part", BRACKET, "--as", "matrix", "--best-guess")
    assert (got.code, got.out) == (3, "")
    assert "got unknown. Nothing is written." in got.err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--as", "kukka"), "Did you mean 'kuka'?"),
        (("--as", "siemens"), "Use --wcs siemens:G54."),
        (("--wcs", "G60"), "--wcs: expected G54 to G59.3"),
        (("--as", "ur", "--wcs", "G54"), "expected one of the two, got both"),
        (("--best-guess",), "--best-guess: expected with --as or --wcs"),
        (("--accept-turn-lost",), "--accept-turn-lost: expected with --wcs"),
    ],
)
def test_misuse(words, message, run):
    got = run(*LOCATE, *words)
    assert (got.code, got.out) == (2, "")
    assert message in got.err


PLAN = ("plan", "--part", BRACKET, "--goal", "0.3mm", "--sd", "0.02mm", "--tip-radius", "1.5mm", "--tip-sd", "0,0,0mm")
EXACT = ("--scale-sd", "1e-9", "--drift-sd", "1e-6mm", "--warp-sd", "1e-6mm")
"""The machine of the test, like a plan, has none of the errors that `locate` otherwise assumes."""

PRIOR = "420,-130,35mm 0,0,33deg +- 1mm 0.5deg"


class Machine:
    """A LinuxCNC machine with a part on it: runs ``G0`` and ``G38.2`` and writes what ``PROBEOPEN`` would."""

    def __init__(self, part, T_true, rng):
        self.surface, self.to_part, self.rng = Surface(part.vertices, part.triangles), SE3.inverse(T_true), rng
        self.at, self.log = np.full(3, np.nan), []

    def gap(self, place):
        return float(signed_distance(self.surface, SE3.apply(self.to_part, place[None]))[0][0]) - 1.5e-3

    def run(self, program):
        for line in program.splitlines():
            if line.startswith(("G0 ", "G38.2")):
                goal = self.at.copy()
                for axis, value in re.findall(r"([XYZ])(-?[\d.]+)", line):
                    goal["XYZ".index(axis)] = float(value) / 1e3
                self.search(goal) if line.startswith("G38.2") else self.go(goal)

    def go(self, goal):
        if np.isfinite(self.at).all() and self.gap(self.at) > 1e-4:
            way = self.at + np.linspace(0, 1, 40)[:, None] * (goal - self.at)
            assert min(map(self.gap, way)) > 0, "the ball met the part in a motion without a search"
        self.at = goal

    def search(self, goal):
        way = np.linalg.norm(goal - self.at)
        along, gone = (goal - self.at) / way, 0.0
        while (gap := self.gap(self.at + gone * along)) > 1e-7:
            gone += gap
            assert gone < way, "no contact"
        self.at = self.at + gone * along
        tripped = 1e3 * (self.at + self.rng.normal(size=3) * 2e-5)
        self.log.append(" ".join(f"{v:f}" for v in [*tripped, *[0.0] * 6]))


def probe_log(log):
    """Return the console log that GRBL shows for the same probing."""
    return "".join(f"[PRB:{','.join(line.split()[:3])}:1]\nok\n" for line in log)


@pytest.mark.parametrize("controller", ["linuxcnc", pytest.param("grbl", marks=pytest.mark.slow)])
def test_a_planned_program_finds_the_part_again(run, models, tmp_path, controller):
    """NEES of three placements is below the 1e-4 quantile of a chi-square of 18; the log is read unchanged."""
    log = tmp_path / "log.txt"
    got = run(*PLAN, "--pose-prior", PRIOR, "--program", controller)
    assert got.code == 0
    assert got.out.startswith("(tanteo plan")
    assert "readings place all corners" in got.err
    T_expected = SE3.from_parts(SO3.axis_rotation(2, np.radians(33)), np.array([0.42, -0.13, 0.035]))
    total = 0.0
    for seed in range(3):
        rng = np.random.default_rng(seed)
        sds = np.repeat([1e-3, np.radians(0.5)], 3)
        machine = Machine(models["bracket_left"].part, T_expected @ SE3.exp(rng.normal(size=6) * sds), rng)
        machine.run(got.out)
        text = probe_log(machine.log) if controller == "grbl" else "".join(f"{line}\n" for line in machine.log)
        log.write_text(text, encoding="utf-8")
        options = ("--units", "mm", "--radius", "1.5mm", "--sd", "0.02mm", "--pose-prior", PRIOR, *EXACT)
        found = run("locate", log, "--part", BRACKET, *options, "--json")
        assert found.code == 0, found.err
        best = json.loads(found.out)["hypotheses"][0]
        error = SE3.log(SE3.inverse(SE3.inverse(machine.to_part)) @ np.array(best["pose"]["matrix"]))
        total += error @ np.linalg.solve(np.array(best["covariance"]["matrix"]), error)
        assert best["corner_sd_m"] < 0.3e-3
    assert total < 48.0


def test_the_ball_passes_over_the_stated_pose_of_the_part(run):
    got = run(*PLAN, "--pose-prior", PRIOR, "--program", "grbl", "--retract-height", "200mm")
    assert "\nG0 Z200.0000\n" in got.out
    assert "safe height Z 200.00" in got.out


def test_a_plan_without_touches_is_no_program(run):
    got = run(*PLAN, "--pose-prior", PRIOR, "--program", "grbl", "--approach", "0,0,1,20deg")
    assert (got.code, got.out) == (3, "")
    assert "warning: --program: the plan has no touches" in got.err


@pytest.mark.slow
@pytest.mark.parametrize("name", ["grbl", "ur", "fanuc", "kuka", "abb"])
def test_programs_are_in_the_document(name, run):
    got = run(*PLAN, "--pose-prior", PRIOR, "--program", name, "--json", "--feed", "2mm/s", "--overtravel", "6mm")
    assert got.code == 0
    assert "tanteo plan" in json.loads(got.out)["program"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--program", "linuxnc", "--tip-radius", "1mm", "--sd", "0.1mm"), "Did you mean 'linuxcnc'"),
        (("--program", "ur", "--sd", "0.1mm"), "--tip-radius: expected the ball radius of the probe"),
        (("--program", "ur", "--tip-radius", "1mm", "--sensor", "keyence_il300"), "expected a touch probe"),
        (("--feed", "2mm/s", "--sd", "0.1mm"), "--feed: expected with --program"),
        (
            (
                "--program",
                "ur",
                "--tip-radius",
                "1mm",
                "--sd",
                "0.1mm",
                "--retract-height",
                "20mm",
                "--goal",
                "3mm",
            ),
            "--retract-height: expected 122.0 mm or more",
        ),
        (("--program", "ur", "--tip-radius", "1mm", "--sd", "0.1mm", "--feed", "2mm"), "Write it as 100mm/min"),
    ],
)
def test_misuse_of_programs(words, message, run):
    got = run("plan", "--part", BRACKET, "--goal", "0.3mm", *words)
    assert (got.code, got.out) == (2, "")
    assert message in got.err


def test_the_log_of_a_robot_is_a_readings_file(run, tmp_path):
    """What URScript's ``textmsg`` writes, columns and rows, is read."""
    got = run(*PLAN, "--pose-prior", PRIOR, "--program", "ur")
    columns = re.search(r'textmsg\("(id.*)"\)', got.out)[1]
    facts = re.findall(r'touch\("(\d+)".*"([^"]*)"\)', got.out)
    rows = [f"{number},0.42,-0.13,0.1,0.42,-0.13,0.1,3.14,0,0,{fact}" for number, fact in facts]
    path = tmp_path / "log.csv"
    path.write_text("\n".join([columns, *rows, ""]), encoding="utf-8")
    from tanteo.io import read_readings

    read = read_readings(path)
    assert len(read) == len(rows)
    assert read.Ts_world_hand.given.all()


def test_a_frame_of_one_of_two_equal_parts(run, tmp_path):
    rows = READINGS.read_text().splitlines()
    header = next(k for k, row in enumerate(rows) if "x_mm" in row)
    names = rows[header].split(",")
    x, name = names.index("x_mm"), names.index("id")
    cells = [row.split(",") for row in rows[header + 1 :]]
    moved = [[*c] for c in cells]
    for c in moved:
        c[x], c[name] = f"{float(c[x]) + 300:.4f}", f"b{c[name]}"
        if "feature" in names and c[names.index("feature")]:
            c[names.index("feature")] += "b"
    path = tmp_path / "two.csv"
    path.write_text("\n".join([rows[header], *(",".join(c) for c in cells + moved)]) + "\n")
    words = ("locate", path, "--part", BRACKET, "--sd", "0.1mm", "--as", "matrix")
    refused = run(*words)
    assert (refused.code, refused.out) == (3, "")
    assert "expected --which from 1 to 2, because 2 equal parts were sensed" in refused.err
    second = run(*words, "--which", "2")
    assert "\n2. bracket_left at x 720.03" in second.err
    assert "0.72003" in second.out
    document = json.loads(run(*words, "--json").out)
    assert [round(one["pose"]["position_m"][0], 3) for one in document["equal_parts"]] == [0.42, 0.72]


def test_a_pose_that_is_refused_is_no_success(run):
    """A script that takes the lines of a recognized answer must not go on without them."""
    got = run(*LOCATE, "--as", "matrix", "--which", "5")
    assert (got.code, got.out) == (3, "")
    assert "Nothing is written" in got.err
    document = json.loads(run(*LOCATE, "--as", "matrix", "--which", "5", "--json").out)
    assert document["status"] == "recognized"
    assert document["as"]["text"] is None
