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


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nonsense"], "expected one of points, few"),
        (["points", "--method", "nonsense"], "FILE.py:function"),
        (["points", "--scenes", "0"], "expected 1 or more"),
        (["points", "--limit", "-1"], "positive number of seconds"),
        (["--compare", "missing.json"], "missing.json"),
        (["points", "few", "--write", "folder"], "expected one set"),
    ],
)
def test_what_is_typed_wrongly_of_a_benchmark_is_said(run, words, said):
    ended = run("bench", *words)
    assert ended.code in (1, 2)
    assert said in ended.err


def test_a_benchmark_prints_its_table(run, tmp_path):
    ended = run("bench", "normals", "--scenes", "2", "--out", tmp_path / "s.json")
    assert ended.code == 0, ended.err
    assert "NEES/dof" in ended.out
    again = run("bench", "--compare", tmp_path / "s.json")
    assert again.out == ended.out
    assert "outliers" in run("bench", "--list").out
