import re

import pytest

MISSING = re.compile(r"^(?:warning|error): (\S+): expected a file, got nothing there", re.MULTILINE)


@pytest.mark.parametrize(
    ("typed", "missing"),
    [
        ("identify r.csv --parts a b c", "a b c"),
        ("identify r.csv --parts a --parts b", "a b"),
        ("identify r.csv --parts a b --top 3", "a b"),
        ("identify --parts a b --json r.csv", "a b"),
        ("identify --parts a b r.csv", "a b"),
        ("identify --parts=a r.csv", "a"),
        ("identify --parts a.step r.CSV --top 2", "a.step"),
        ("identify r.csv --parts --json", "--json"),
    ],
)
def test_each_word_after_parts_is_a_part(run, tmp_path, monkeypatch, typed, missing):
    monkeypatch.chdir(tmp_path)
    for name in ("r.csv", "r.CSV"):
        (tmp_path / name).write_text("x_mm,y_mm,z_mm\n0,0,0\n")
    result = run(*typed.split(), "--sd", "1mm")
    assert result.code == 1
    assert sorted(MISSING.findall(result.err)) == missing.split()


@pytest.mark.parametrize(
    ("typed", "message"),
    [
        ("identify r.csv --parts", "requires an argument"),
        ("identify --parts a -- r b", "extra argument(s) (b)"),
        ("part show a b", "extra argument(s) (b)"),
    ],
)
def test_no_word_is_a_part_without_parts_before_it(run, typed, message):
    result = run(*typed.split())
    assert result.code == 2
    assert message in result.err


@pytest.mark.parametrize(
    ("words", "error_text"),
    [
        (["nonsense"], "expected one of points, few"),
        (["points", "--method", "nonsense"], "FILE.py:function"),
        (["points", "--scenes", "0"], "expected 1 or more"),
        (["points", "--limit", "-1"], "positive number of seconds"),
        (["--compare", "missing.json"], "missing.json"),
        (["points", "few", "--write", "folder"], "expected one set"),
    ],
)
def test_wrong_options_of_a_benchmark_are_reported(run, words, error_text):
    ended = run("bench", *words)
    assert ended.code in (1, 2)
    assert error_text in ended.err


def test_a_benchmark_prints_its_table(run, tmp_path):
    ended = run("bench", "normals", "--scenes", "2", "--out", tmp_path / "s.json")
    assert ended.code == 0, ended.err
    assert "NEES/dof" in ended.out
    again = run("bench", "--compare", tmp_path / "s.json")
    assert again.out == ended.out
    assert "outliers" in run("bench", "--list").out
