"""Work on several items at a time: the results are those of a loop, for any number of threads."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from tanteo import _core
from tanteo.threads import for_each


@pytest.fixture(autouse=True)
def three_threads(monkeypatch):
    monkeypatch.setattr(_core, "most_threads", lambda: 3)


def test_results_have_the_order_of_the_items():
    assert for_each(lambda k: k * k, range(50)) == [k * k for k in range(50)]


def test_several_threads_work_at_a_time():
    all_here = threading.Barrier(3, timeout=30)  # breaks unless three threads wait at it
    for_each(lambda _: all_here.wait(), range(3))


def test_the_first_failure_is_raised_and_others_are_not_begun():
    begun = []

    def work(k):
        begun.append(k)
        if k > 1:
            raise ValueError(f"item {k}")

    with pytest.raises(ValueError, match="item 2"):
        for_each(work, range(1000))
    assert len(begun) < 10


def test_calls_inside_calls_return():
    assert for_each(lambda k: sum(for_each(lambda i: i * k, range(9))), range(9)) == [36 * k for k in range(9)]


def test_floating_point_errors_are_handled_as_by_the_caller():
    with np.errstate(divide="raise"), pytest.raises(FloatingPointError):
        for_each(lambda _: 1 / np.zeros(1), range(30))
    waited = threading.Barrier(3, timeout=30)
    with np.errstate(divide="ignore"):
        found = for_each(lambda _: (waited.wait(), np.geterr()["divide"])[1], range(3))
    assert found == ["ignore"] * 3
