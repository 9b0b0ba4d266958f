"""Help texts of the commands."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

import pytest
import typer

from tanteo.cli import app
from tanteo.cli.app import spread_values

ROOT = Path(__file__).parents[2]


def commands(group, words=()):
    """Yield every command with its words."""
    for name, one in group.commands.items():
        if hasattr(one, "commands"):
            yield from commands(one, (*words, name))
        else:
            yield (*words, name), one


COMMANDS = dict(commands(typer.main.get_command(app.app)))
EXAMPLES = {words: one.epilog for words, one in COMMANDS.items() if one.epilog}


def typed_in(example):
    """Return the words that a shell makes of an example."""
    return shlex.split(example.replace("\\\n", " "))


def test_help_has_sections_in_one_order_and_no_types():
    """Files first, those of all commands last; no type of Python beside a name."""
    for words, command in COMMANDS.items():
        shown = command.get_help(typer.Context(command, info_name=" ".join(words)))
        titles = [line[:-1] for line in shown.splitlines() if line.endswith(":") and not line.startswith(" ")]
        first = [name for name in ("Arguments", "Readings and parts", "Options") if name in titles]
        last = [name for name in ("Answer", "Output", "File of readings", "Example") if name in titles]
        assert titles[: len(first)] == first, words
        assert titles[len(titles) - len(last) :] == last, words
        assert not any(one in shown for one in ("<str>", "<int>", "<float>", "<list")), words


@pytest.mark.parametrize("words", EXAMPLES, ids="-".join)
def test_every_example_of_a_help_text_is_parsed(words):
    """It fits a line, begins with its own command, names only files of the repository, and options that exist."""
    assert max(map(len, EXAMPLES[words].splitlines())) <= 78
    program, *typed = typed_in(EXAMPLES[words])
    assert program == "tanteo"
    assert tuple(typed[: len(words)]) == words
    rest = spread_values(typed[len(words) :])
    assert COMMANDS[words].make_context(" ".join(words), list(rest))
    assert [one for one in rest if one.startswith("examples/") and not (ROOT / one).exists()] == []


@pytest.mark.slow
@pytest.mark.parametrize("words", [one for one in EXAMPLES if one not in (("view",), ("demo",))], ids="-".join)
def test_every_example_of_a_help_text_runs(words, run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    os.symlink(ROOT / "examples", tmp_path / "examples")
    assert run(*typed_in(EXAMPLES[words])[1:]).code in (0, 3)
