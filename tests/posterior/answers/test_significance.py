"""One significance level judges an answer, wherever it is shown."""

import ast
import inspect
from pathlib import Path

import pytest
import typer

import tanteo
from tanteo.cli.app import app
from tanteo.defaults import SIGNIFICANCE, TOP
from tanteo.errors import InputError
from tanteo.planning import Session
from tanteo.posterior import Answer


@pytest.mark.parametrize("function", [tanteo.identify, tanteo.locate, Session.answer])
def test_the_default_numbers_of_a_question_stand_in_one_place(function):
    parameters = inspect.signature(function).parameters
    assert parameters["top"].default == TOP
    assert parameters["significance"].default in (SIGNIFICANCE, None)


@pytest.mark.parametrize("command", ["identify", "locate"])
def test_the_options_of_a_command_have_the_same_default_numbers(command):
    options = {option.name: option for option in typer.main.get_command(app).commands[command].params}
    assert options["top"].default == TOP
    assert options["significance"].default in (SIGNIFICANCE, None)


def test_an_answer_and_a_session_carry_their_significance():
    assert Answer("unknown", (), (), 1.0).significance == SIGNIFICANCE
    assert inspect.signature(Session).parameters["significance"].default == SIGNIFICANCE


@pytest.mark.parametrize("level", [0, 1, -0.1, "5 %", float("nan")])
def test_a_level_outside_of_0_and_1_is_refused(level):
    with pytest.raises(InputError, match="significance"):
        tanteo.geometry.limits.check_significance(level)


def _compared_with_a_number(path: Path) -> list[int]:
    """Return the lines that compare something called p or p_value with a number between 1e-3 and 0.5."""
    lines = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            names = [getattr(s, "attr", getattr(s, "id", "")) for s in sides]
            numbers = [s.value for s in sides if isinstance(s, ast.Constant) and isinstance(s.value, float)]
            if any("p_value" in n or n == "prior_p" for n in names) and any(1e-3 <= v <= 0.5 for v in numbers):
                lines.append(node.lineno)
    return lines


def test_no_module_judges_a_p_value_by_a_number_of_its_own():
    source = Path(tanteo.__file__).parent
    found = {str(p.relative_to(source)): lines for p in source.rglob("*.py") if (lines := _compared_with_a_number(p))}
    assert found == {}
