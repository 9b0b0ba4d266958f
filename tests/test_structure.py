"""The figures by which the structure of the project is judged."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import structure

ROOT = Path(__file__).parents[1]

MOST = {
    "iterative pose fits": 2,
    "iterative pose fits in C++": 1,
    "tuned numbers in vision": 49,
    "tuned numbers in posterior": 109,
    "checks of a kind in C++": 0,
    "files with checks of a kind in C++": 0,
    "checks of a kind in Python": 0,
    "files with checks of a kind in Python": 0,
    "code lines of Python in the judged packages": 14040,
    "code lines of C++": 13247,
    "exported names": 451,
    "exported names without a user": 0,
    "words of docs": 46370,
    "live decisions": 40,
}
"""Largest accepted figures. Lines and words may grow with new capabilities; the others may only fall."""

ENTERED = 90
"""Largest accepted number of files that the second call of ``identify`` enters."""


def test_no_figure_rises():
    figures = structure.figures(structure.Checkout(ROOT), trace=False)
    assert {name: figures[name] for name, most in MOST.items() if figures.get(name, 0) > most} == {}


def test_a_bare_identify_enters_no_more_files():
    pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
    assert len(structure.entered(structure.Checkout(ROOT))) <= ENTERED


def test_docstrings_comments_and_blanks_are_no_code():
    source = '"""Title."""\n\n# why\ndef f():\n    """Do.\n\n    More.\n    """\n    return """a\nb"""  # c\n'
    assert structure.python_lines(source) == (3, 5)


def test_comments_of_cpp_are_no_code():
    assert structure.cpp_lines('// a\nint x;  // b\n/* c\n d */\n\nauto s = "// e";\n') == 2


def test_a_loop_that_solves_and_moves_a_pose_is_a_fit():
    fit = "def f(T):\n    for _ in range(9):\n        T = T @ SE3.exp(np.linalg.solve(A, b))\n"
    assert structure.python_fits(fit) == [(1, "f")]


def test_a_fit_may_solve_in_another_function():
    fit = "def g():\n    return np.linalg.pinv(A) @ b\ndef f(T):\n    while True:\n        T = T @ SE3.exp(g())\n"
    assert structure.python_fits(fit) == [(3, "f")]


def test_a_fit_may_take_its_motion_as_an_argument():
    fit = "def f(x, moved):\n    for _ in range(9):\n        x = moved(x, np.linalg.solve(A, b))\n"
    assert structure.python_fits(fit) == [(1, "f")]


def test_a_fit_of_cpp_may_leave_its_motion_to_a_callback():
    fit = "void fit() {\n  for (;;) {\n    solve_cholesky(A, 6, b);\n    if (attempt(b)) return;\n  }\n}\n"
    assert structure.cpp_fits(fit) == [(1, "fit")]


@pytest.mark.parametrize(
    "source",
    [
        "def f(T):\n    return T @ SE3.exp(np.linalg.solve(A, b))\n",
        "def f(T):\n    for _ in range(9):\n        Ts = T @ SE3.exp(draw())\n",
        "def f(x):\n    for _ in range(9):\n        x = x + np.linalg.solve(A, b)\n",
    ],
)
def test_one_step_drawing_and_plain_newton_are_no_pose_fits(source):
    assert structure.python_fits(source) == []


def test_fits_of_cpp_are_found_through_a_step():
    step = "bool step(Pose& p) {\n  solve_cholesky(A, 6, b);\n  p = moved(p, b);\n  return true;\n}\n"
    assert structure.cpp_fits(step) == []
    assert structure.cpp_fits(step + "void fit(Pose& p) {\n  while (step(p)) {}\n}\n") == [(6, "fit")]
    assert structure.cpp_fits(step + "// for (;;) step(p);\nvoid once(Pose& p) { step(p); }\n") == []


def test_numbers_count_once_each_and_know_their_source():
    source = (
        "_A, _B = 0.5, (3.0, 4)\n"
        '"""Chosen by `benchmarks/families.py`."""\n'
        "C = 1\nD = dict(x=2)\n"
        "class S:\n    steps: int = 20\n    name: str = ''\n"
        "    # Wilson and Hilferty (1931)\n    z: float = 1.96\n"
        'class T:\n    """Do.\n\n    Attributes:\n        a: one. Rows\n            touch.\n        b: two.\n    """\n'
        "    a: int = 7\n    b: int = 8\n"
    )
    found = structure.tuned_numbers(source)
    assert [(n.name, n.count, n.sourced) for n in found] == [
        ("(_A, _B)", 3, True), ("D", 1, False), ("steps", 1, False), ("z", 1, True), ("a", 1, True), ("b", 1, False)
    ]  # fmt: skip


def test_numerical_constants_and_definitions_are_not_tuned():
    source = (
        'STEPS = 50\n"""Numerical: Newton steps, which end before."""\nDOF = 6\n"""Definition: of a pose."""\n'
        'GATE = 4.0\n"""A gate. Numerical: no."""\n'
    )
    assert [n.name for n in structure.tuned_numbers(source)] == ["GATE"]


@pytest.mark.parametrize(
    ("source", "count"),
    [
        ("if kind == CENTRE: pass", 1),
        ("on = np.array(kinds) == 'apex'", 1),
        ("if kind in WALLS and other.kind != 'plane': pass", 2),
        ("n = CENTRES.get(kind, 1)", 1),
        ("if kind == 'grbl': pass", 0),
        ("for kind in KINDS:\n    pass", 0),
        ("names = [kind.name for kind in KINDS]", 0),
        ("x = 1  # kind == CENTRE", 0),
        ("from a import CENTRE", 0),
    ],
)
def test_questions_of_the_kind_are_counted(source, count):
    assert len(structure.kind_checks(source, structure.PYTHON_KIND)) == count


def test_questions_of_the_kind_in_cpp_are_counted():
    source = "if (p.kind == Kind::EDGE) f();  // Kind::BALL\nRoundKind k = RoundKind::CONE;\nif (p.amid()) g();\n"
    assert len(structure.kind_checks(source, structure.CPP_KIND)) == 2


def test_a_package_that_is_not_there_is_left_out(tmp_path):
    package = tmp_path / "src" / "tanteo" / "vision"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("A = 2.5\n")
    found = structure.figures(structure.Checkout(tmp_path), trace=False)
    assert found["tuned numbers in vision"] == 1
    assert "tuned numbers in inference" not in found
