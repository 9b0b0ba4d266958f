import pytest

from tanteo.cli.app import spread_values


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("identify r.csv --parts a b c", "identify r.csv --parts a --parts b --parts c"),
        ("identify r.csv --parts a --parts b", "identify r.csv --parts a --parts b"),
        ("identify r.csv --parts a b --top 3", "identify r.csv --parts a --parts b --top 3"),
        ("identify --parts a b --json r.csv", "identify --parts a --parts b --json r.csv"),
        ("identify --parts a b r.csv", "identify --parts a --parts b r.csv"),
        ("identify --parts=a r.csv", "identify --parts=a r.csv"),
        ("identify --parts a.step r.CSV --top 2", "identify --parts a.step r.CSV --top 2"),
        ("identify r.csv --parts", "identify r.csv --parts"),
        ("identify r.csv --parts --json", "identify r.csv --parts --json"),
        ("identify --parts a -- r b", "identify --parts a -- r b"),
        ("part show a b", "part show a b"),
        ("", ""),
    ],
)
def test_values_after_parts_are_spread(typed, meant):
    assert spread_values(typed.split()) == meant.split()
