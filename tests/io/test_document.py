"""Documents by their classes: what is read, what is refused and where, and that writing reads back."""

from dataclasses import dataclass
from typing import Annotated, TypeVar

import numpy as np
import pytest
from msgspec import Meta
from typing_extensions import TypeAliasType

from tanteo.errors import InputError, UnitError
from tanteo.io.documents.document import load_toml, table, value
from tanteo.io.documents.schema import Direction, Length, Numbers, Place, Point, Table, as_plain, toml_lines

Scalar = TypeVar("Scalar", bound=np.generic)
Array = TypeAliasType("Array", np.ndarray[tuple[int, ...], np.dtype[Scalar]], type_params=(Scalar,))
"""As ``numpy.typing.NDArray`` is from NumPy 2.5 on: an alias of the ``type`` statement."""


@dataclass(frozen=True)
class Some:
    counts: Array[np.int64]
    sds: Array[np.float64] | None


@pytest.mark.parametrize("sds", [None, np.array([0.5, np.inf])])
def test_aliases_of_array_types_are_read(sds):
    plain = as_plain(Some(np.array([1, 2]), sds))
    back = table(Some, plain, Place("file"))
    assert back.counts.dtype == np.int64
    assert as_plain(back) == plain


@pytest.mark.parametrize("counts", ["many", [1, 2.5], [[1], [1, 2]], [True], [2**70], {}, None])
def test_what_is_no_array_is_named(counts):
    with pytest.raises(InputError, match=r"^file, counts: expected whole numbers, got "):
        table(Some, {"counts": counts, "sds": None}, Place("file"))


@pytest.mark.parametrize("plain", [False, 3, ["a"], {}])
def test_what_is_neither_a_text_nor_nothing_is_refused(plain):
    place = Place("file", table={"name": plain})
    assert value(str | None, None, place, "name") is None
    assert value(str | None, "a", place, "name") == "a"
    with pytest.raises(InputError, match=r"^file, name: expected a text, got "):
        value(str | None, plain, place, "name")


class Pin(Table, frozen=True, kw_only=True, eq=False):
    at_mm: str = ""
    tip: Point
    along: Direction | None = None
    radius: Annotated[Length, Meta(gt=0)] = 1e-3
    count: Annotated[int, Meta(ge=2)] = 2
    rate: Annotated[float, Numbers("rate")] | None = None


class Pins(Table, frozen=True, kw_only=True, eq=False):
    pin: Pin


def read(tmp_path, text):
    path = tmp_path / "pins.toml"
    path.write_text(text)
    return load_toml(path, "file of pins", Pins).pin


GOOD = "# pins\n\n[pin]\ntip_mm = [1, 2, 3]\n"


def test_units_of_keys_become_si(tmp_path):
    pin = read(tmp_path, GOOD + "along = [0, 3, 4]\nradius_um = 5\nrate_hz = 7\n")
    np.testing.assert_allclose(pin.tip, [1e-3, 2e-3, 3e-3])
    np.testing.assert_allclose(pin.along, [0, 0.6, 0.8])
    assert (pin.radius, pin.count, pin.rate) == pytest.approx((5e-6, 2, 7))
    back = read(tmp_path, "[pin]\n" + "\n".join(toml_lines(pin)))
    for name, value_before in pin.values().items():
        assert back.values()[name] == pytest.approx(value_before)


@pytest.mark.parametrize(
    ("line", "error", "message"),
    [
        ("radius_mm = 0", InputError, "pin, radius_mm: expected one positive number, got 0. Correct it. See line 5."),
        ("radius_mm = true", InputError, "radius_mm: expected finite numbers, got True. Correct it. See line 5."),
        (f"radius_mm = {10**400}", InputError, "radius_mm: expected finite numbers, got 1000"),
        ("radius_mm = [1]", InputError, "radius_mm: expected one positive number, got [1]. Correct it. See line 5."),
        ("radius_cm = 1", UnitError, "expected one of radius_mm, radius_m, radius_um, radius_in, got 'radius_cm'"),
        ("radius_mm = 1\nradius_m = 1", UnitError, "radius_m: expected 'radius' once, got it in two units"),
        ("raduis_mm = 1", InputError, "got 'raduis_mm'. Did you mean 'radius_mm'? See line 5."),
        ("count = 1", InputError, "count: expected a whole number of 2 or more, got 1. Correct it. See line 5."),
        ("at_mm = 1", InputError, "at_mm: expected a text, got 1. Write it in quotes. See line 5."),
        ("at = 1", InputError, "got 'at'. Did you mean 'at_mm'?"),
        ("along = [0, 0, 0]", InputError, "along: expected a direction that is not zero, got [0, 0, 0]"),
        ("along = [1, 2]", InputError, "along: expected 3 numbers, got 2. Correct it. See line 5."),
    ],
)
def test_what_is_wrong_is_named_with_its_line(tmp_path, line, error, message):
    with pytest.raises(InputError) as caught:
        read(tmp_path, GOOD + line)
    assert type(caught.value) is error
    assert str(caught.value).startswith(f"{tmp_path / 'pins.toml'}, pin")
    assert message in str(caught.value)


def test_what_is_missing_is_named(tmp_path):
    with pytest.raises(InputError, match=r"pins.toml, pin: expected 'tip_mm' \(3 numbers\), got nothing. Add it."):
        read(tmp_path, "[pin]\n")
    with pytest.raises(InputError, match=r"pins.toml: expected a table \[pin\], got nothing. Add it."):
        read(tmp_path, "")
    with pytest.raises(
        InputError, match=r"pins.toml, pin: expected a table \[pin\], got 3. Write \[name\] and its keys"
    ):
        read(tmp_path, "pin = 3")
