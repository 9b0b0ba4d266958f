"""The commands of a catalogue: what they say, what they refuse, and a catalogue in the place of parts."""

import json

import pytest

from tanteo.cli import main

BLOCK, WEDGE = "examples/parts/block.step", "examples/parts/wedge.step"


def run(capsys, *words):
    with pytest.raises(SystemExit) as ended:
        main(words)
    printed = capsys.readouterr()
    return ended.value.code or 0, printed.out, printed.err


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    folder = tmp_path_factory.mktemp("two") / "catalogue"
    with pytest.raises(SystemExit):
        main(["catalogue", "build", BLOCK, WEDGE, "--out", str(folder)])
    return str(folder)


def test_the_built_catalogue_is_reported(two, capsys):
    code, out, _ = run(capsys, "catalogue", "build", BLOCK, WEDGE, "--out", two)
    assert code == 0
    assert "2 parts (0 read, 2 unchanged)" in out
    code, out, _ = run(capsys, "catalogue", "show", two, "--names")
    assert "2 parts" in out.splitlines()[0]
    assert out.splitlines()[-2:] == ["  block", "  wedge"]
    code, out, _ = run(capsys, "catalogue", "check", two)
    assert "all checksums are correct" in out


def test_documents_are_equal(two, capsys):
    _, out, _ = run(capsys, "catalogue", "show", two, "--json")
    shown = json.loads(out)
    assert (shown["schema"], shown["parts"], shown["names"]) == ("tanteo.catalogue_summary/1", 2, ["block", "wedge"])
    _, out, _ = run(capsys, "catalogue", "build", BLOCK, WEDGE, "--out", two, "--json")
    built = json.loads(out)
    assert (built["schema"], built["kept"], built["failures"]) == ("tanteo.catalogue_built/1", 2, [])


def test_a_catalogue_stands_for_its_parts(two, capsys):
    readings = "examples/readings/bracket_left.csv"
    code, out, _ = run(capsys, "identify", readings, "--parts", two, "--sd", "0.1mm", "--json")
    assert code == 3  # it is none of the two
    assert json.loads(out)["status"] == "unknown"
    code, _, err = run(capsys, "identify", readings, "--parts", two, BLOCK)
    assert code == 2
    assert "--parts: expected one catalogue or CAD files" in err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["show", "nowhere"], "tanteo catalogue build FOLDER... --out nowhere"),
        (["check", "examples"], "expected a catalogue"),
        (["add", BLOCK, "--to", "nowhere"], "expected a catalogue"),
        (["build", BLOCK, "--out", "examples"], "expected a catalogue or an empty folder"),
        (["build", "examples/readings/bracket_left.csv", "--out", "{new}"], "expected one of .step"),
    ],
)
def test_what_cannot_be_meant_is_refused(words, message, tmp_path, capsys):
    code, out, err = run(capsys, "catalogue", *(word.format(new=tmp_path / "new") for word in words))
    assert code == 1
    assert message in err
    assert not out


def test_nothing_added_is_an_error(two, capsys):
    code, _, err = run(capsys, "catalogue", "add", "examples/readings/bracket_left.csv", "--to", two)
    assert code == 1
    assert "expected one of .step" in err
