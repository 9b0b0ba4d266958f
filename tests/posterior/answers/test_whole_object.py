"""What is measured of the whole object: a likelihood of each part, never a cut."""

from pathlib import Path

import numpy as np
import pytest

import tanteo
from tanteo.cli import main
from tanteo.errors import InputError, UnitError
from tanteo.io.documents import parse_density, parse_mass, parse_size
from tanteo.posterior import Priors, WholeObject

EXAMPLES = Path(__file__).parents[3] / "examples"
VOLUMES = np.array([1e-4, 1.05e-4, 2e-4, 0.0])
BOXES = np.array([[0.1, 0.05, 0.02], [0.1, 0.05, 0.021], [0.1, 0.05, 0.04], [0.1, 0.05, 0.02]])


def test_a_mass_favours_parts_of_its_volume():
    odds = WholeObject(mass=(0.27, 0.001), density=(2700.0, 10.0)).log_odds(VOLUMES, BOXES)
    assert np.argmax(odds) == 0
    assert odds[0] > odds[1] + 3
    assert odds[2] > -4  # something else may have been weighed, too
    assert odds[3] == 0  # it encloses nothing


def test_sides_are_compared_in_any_order():
    odds = WholeObject(sides=(0.02, 0.1, 0.05), side_sd=2e-4).log_odds(VOLUMES, BOXES)
    assert odds[0] == odds[3] == odds.max()
    assert odds[1] < odds[0] - 5


def test_a_wider_standard_deviation_is_less_informative():
    sharp, wide = (WholeObject(sides=(0.1, 0.05, 0.02), side_sd=sd).log_odds(VOLUMES, BOXES) for sd in (2e-4, 5e-3))
    assert sharp[0] - sharp[1] > wide[0] - wide[1] > 0


def test_a_contradiction_to_a_part_is_reported():
    of_mass = WholeObject(mass=(0.27, 0.001), density=(2700.0, 10.0))
    assert of_mass.mismatch("wedge", 1e-4, BOXES[0]) is of_mass.mismatch("sheet", 0.0, BOXES[0]) is None
    message = of_mass.mismatch("wedge", 2e-4, BOXES[0]).message
    assert "The mass corresponds to 100 cm3, the volume of wedge is 200 cm3." in message
    of_sides = WholeObject(sides=(0.02, 0.1, 0.05), side_sd=2e-4)
    assert of_sides.mismatch("wedge", 1e-4, BOXES[0]) is None
    assert (
        "100 x 50 x 20 mm, the box of wedge is 100 x 50 x 40 mm" in of_sides.mismatch("wedge", 1e-4, BOXES[2]).message
    )


def test_an_answer_reports_a_different_mass(parts):
    readings = tanteo.read_readings(EXAMPLES / "readings" / "bracket_left.csv")
    whole = WholeObject(mass=(0.1, 0.002), density=(7850.0, 80.0))
    answer = tanteo.locate(readings, parts["bracket_left"], priors=Priors(whole=whole))
    assert "The mass corresponds to 12.74 cm3, the volume of bracket_left is 190.1 cm3." in answer.message
    assert [one.kind for one in answer.findings if one.role != "verdict"] == ["shared_error", "outliers", "whole"]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"mass": (0.3, 0.01)}, "density of the material, too"),
        ({"mass": (-0.3, 0.01), "density": (2700.0, 10.0)}, "positive"),
        ({"mass": (0.3, 0.0), "density": (2700.0, 10.0)}, "positive"),
        ({"sides": (0.1, 0.1, 0.1)}, "positive"),
    ],
)
def test_what_cannot_be_measured_is_refused(given, message):
    with pytest.raises(InputError, match=message):
        WholeObject(**given)


def test_quantities_are_read_with_their_spread():
    assert parse_mass("340 g +- 2 g") == pytest.approx((0.34, 0.002))
    assert parse_density("7.85g/cm3+-1%") == pytest.approx((7850.0, 78.5))
    assert parse_size("120,80,50mm+-1mm") == ((0.12, 0.08, 0.05), pytest.approx(1e-3))


@pytest.mark.parametrize(
    ("read", "text", "error"),
    [
        (parse_mass, "340g", InputError),
        (parse_mass, "340+-2", UnitError),
        (parse_mass, "340mm+-2mm", UnitError),
        (parse_mass, "0g+-2g", InputError),
        (parse_density, "7.85+-1%", UnitError),
        (parse_density, "7.85g/cm3+-0%", InputError),
        (parse_size, "120,80mm+-1mm", InputError),
        (parse_size, "120,80,50mm+-1,1mm", InputError),
    ],
)
def test_quantities_that_are_none_are_refused(read, text, error):
    with pytest.raises(error, match=r"expected"):
        read(text)


def test_a_weight_settles_what_readings_leave_open():
    parts = tanteo.read_parts(["examples/parts/step_12mm.step", "examples/parts/step_15mm.step"])
    readings = tanteo.Readings.from_columns(TOP * 1e-3)
    before = tanteo.identify(readings, parts, sd=1e-4, conventions=False)
    shares = {h.part: h.probability for h in before.hypotheses}
    weighed = Priors(whole=WholeObject(mass=(2700 * parts["step_15mm"].volume, 1e-3), density=(2700.0, 5.0)))
    after = tanteo.identify(readings, parts, sd=1e-4, priors=weighed, conventions=False)
    known = {h.part: h.probability for h in after.hypotheses}
    assert known["step_15mm"] > max(shares["step_15mm"], known.get("step_12mm", 0.0))


TOP = np.array([
    (80, 25, 45), (95, 55, 45), (78, 58, 45), (50, 5, 30), (70, 55, 30), (60, 30, 30), (100, 30, 20), (100, 50, 35),
    (100, 10, 10), (60, 0, 20), (90, 0, 5), (55, 60, 25), (80, 60, 40), (50, 20, 0), (80, 40, 0),
], dtype=float)  # fmt: skip
"""Places of both stairs, none of them on the step that differs [mm]."""


def test_options_of_the_whole_object_are_read_or_refused(capsys):
    command = ["identify", "examples/readings/bracket_left.csv", "--parts", "examples/parts/bracket_left.step"]
    for more, message in (
        (["--mass", "340g+-2g"], "--mass: expected the density"),
        (["--density", "7.85g/cm3+-1%"], "--density: expected --mass beside it"),
        (["--size", "1,2mm+-1mm"], "--size: expected three positive sides"),
    ):
        with pytest.raises(SystemExit) as ended:
            main([*command, *more])
        assert ended.value.code == 2
        assert message in capsys.readouterr().err
