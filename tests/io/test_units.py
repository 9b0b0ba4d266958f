import math

import pytest

from tanteo.errors import UnitError
from tanteo.io.readings import parse_angle, parse_length, parse_lengths


@pytest.mark.parametrize(
    ("text", "metres"),
    [
        ("0.3mm", 3e-4),
        ("200um", 2e-4),
        ("200 µm", 2e-4),
        ("0.01in", 2.54e-4),
        ("1e-3m", 1e-3),
        (".5mm", 5e-4),
        ("-2mm", -2e-3),
    ],
)
def test_lengths(text, metres):
    assert parse_length(text) == pytest.approx(metres, rel=1e-15)


def test_the_last_unit_holds_for_numbers_without():
    assert parse_lengths("1.5,1.5,0.3mm") == pytest.approx((1.5e-3, 1.5e-3, 3e-4))
    assert parse_lengths("1.5mm, 200um, 0.01in") == pytest.approx((1.5e-3, 2e-4, 2.54e-4))


def test_angles():
    assert parse_angle("180deg") == pytest.approx(math.pi)
    assert parse_angle("0.5 rad") == 0.5


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0.3", "expected a unit (mm, m, um, in)"),
        ("mm", "expected a number and its unit"),
        ("", "expected a number"),
        ("0.3cm", "expected a unit of mm, m, um, in, got 'cm'"),
        ("0.3MM", "Did you mean 'mm'"),
        ("nanmm", "expected a number"),
        ("1e999mm", "expected a finite number"),
        ("1,2mm", "expected one length"),
        ("0.3deg", "expected a unit of mm"),
        ("1_0mm", "got '_0mm'"),
        ("٣mm", "expected a number"),
        ("0.3mm mm", "got 'mm mm'"),
    ],
)
def test_refusals(text, message):
    with pytest.raises(UnitError) as caught:
        parse_length(text, "--sd")
    assert str(caught.value).startswith("--sd: expected")
    assert message in str(caught.value)


def test_two_angles_are_not_one():
    with pytest.raises(UnitError, match="one angle"):
        parse_angle("1,2deg")
