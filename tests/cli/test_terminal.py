"""Output on a terminal: tables as wide as the terminal, completion, progress on standard error alone."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest

from tanteo.cli import printing


@pytest.fixture
def terminal(monkeypatch):
    """A terminal of so many columns."""

    def call(columns):
        monkeypatch.setenv("COLUMNS", str(columns))
        monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)

    return call


@pytest.mark.parametrize("columns", [60, 80, 120])
def test_what_the_commands_print_fits(run, parts, terminal, columns):
    terminal(columns)
    for args in (
        ["sensor", "list"],
        ["sensor", "rig", "paper-gripper"],
        ["part", "show", parts / "wedge.stl", "--units", "mm"],
    ):
        lines = re.sub(r"\x1b\[[0-9;]*m", "", run(*args).out).splitlines()
        rows = [line for line in lines if re.search(r"\S  +\S", line) and not line.startswith("  ")]
        assert rows
        assert max(map(len, rows)) <= columns, args


def test_sentences_are_folded_between_words_on_a_terminal_only(capsys, terminal):
    expected_text = (
        "  part        wedge, with its frame at the world's, to 5 mm and 3 deg (--pose-prior states another pose)"
    )
    printing.emit([expected_text, "short"])
    assert capsys.readouterr().out == f"{expected_text}\nshort\n"
    terminal(40)
    printing.emit([expected_text, "\x1b[1mthirty-nine letters are no fortieth one\x1b[0m"])
    first, *more, last = capsys.readouterr().out.splitlines()
    assert max(map(len, (first, *more))) <= 40
    assert all(line.startswith("    ") for line in more)
    assert " ".join([first, *(line.strip() for line in more)]).split() == expected_text.split()
    assert last == "\x1b[1mthirty-nine letters are no fortieth one\x1b[0m"


def shell(variables, *args):
    """Return the program for the completion of a shell."""
    code = [sys.executable, "-c", "from tanteo.cli import main; main()", *args]
    return subprocess.run(code, env=os.environ | variables, capture_output=True, text=True, timeout=60)


def complete(line):
    """Return the completions of bash for the word at the end of a line."""
    words = line.split(" ")
    got = shell({"_TANTEO_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1)})
    return got.stdout.split()


def test_completion_has_commands_options_and_presets(run, monkeypatch):
    def completions(line):
        monkeypatch.setenv("_TANTEO_COMPLETE", "complete_bash")
        monkeypatch.setenv("COMP_WORDS", line)
        monkeypatch.setenv("COMP_CWORD", str(len(line.split(" ")) - 1))
        return run().out.split()

    assert {"identify", "locate", "sensor", "doctor"} <= set(complete("tanteo "))
    assert complete("tanteo plan --sensor keyence_il0") == ["keyence_il030"]
    assert completions("tanteo iden") == ["identify"]
    assert "--report" in completions("tanteo locate --re")
    assert "xarm" in completions("tanteo locate r.csv --robot xa")
    assert "vl53l0x" in completions("tanteo identify r.csv --parts a b --sensor vl53l0")
    assert "xarm" in completions("tanteo sensor show xa")


@pytest.mark.parametrize(
    ("name", "word"), [("bash", "complete -o"), ("zsh", "compdef"), ("fish", "complete --command")]
)
def test_the_script_for_each_shell_can_be_shown(name, word):
    got = shell({"_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}, "--show-completion", name)
    assert got.returncode == 0
    assert word in got.stdout


def test_progress_is_on_standard_error_and_only_on_a_terminal(capsys, monkeypatch):
    with printing.progress("reading parts", quiet=False) as tick:
        tick(1, 2)
    assert capsys.readouterr() == ("", "")
