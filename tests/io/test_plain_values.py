"""Frozen values as plain JSON and back."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import pytest
from typing_extensions import TypeAliasType

from tanteo.errors import InputError
from tanteo.io.plain_values import as_plain, from_plain

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
    back = from_plain(Some, plain, "file")
    assert back.counts.dtype == np.int64
    assert as_plain(back) == plain


def test_what_is_no_array_is_named():
    with pytest.raises(InputError, match="file, counts: expected"):
        from_plain(Some, {"counts": "many", "sds": None}, "file")


@pytest.mark.parametrize("plain", [False, 3, ["a"], {}])
def test_what_is_neither_a_text_nor_nothing_is_refused(plain):
    assert from_plain(str | None, None, "file, name") is None
    assert from_plain(str | None, "a", "file, name") == "a"
    with pytest.raises(InputError, match=r"^file, name: expected a text, got "):
        from_plain(str | None, plain, "file, name")
