"""Parts that stay active after a round of successive halving."""

from types import SimpleNamespace

from tanteo.posterior import candidate_pruning


def _part(log_evidence, on):
    return SimpleNamespace(log_evidence=log_evidence, is_good_fit=lambda: on)


def _kept(evidence, on, unknown=-1e9, gap=24.0):
    parts = [_part(value, on) for value in evidence]
    return [part.log_evidence for part in candidate_pruning.still_active(parts, unknown, gap)]


def test_parts_far_below_an_explaining_one_are_pruned():
    assert _kept([100, 90, 70, 0], on=True) == [100, 90]


def test_half_of_parts_stay_while_leader_does_not_explain_points():
    assert _kept([-500, 100, -900, -700], on=False) == [-500, 100]
    assert _kept([-500, 100, 90, 80], on=False) == [100, 90, 80]  # and all that are near it


def test_the_unknown_object_leads_too():
    assert _kept([100, 90], on=True, unknown=200) == []
    assert _kept([100, 90], on=False, unknown=200) == [100]
