"""The types of the compiled core, written by hand in native.pyi: the same names and arguments as in the core itself."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from tanteo import _core
from tanteo._core import native

STUB = ast.parse((Path(_core.__file__).parent / "native.pyi").read_text(encoding="utf-8"))


def test_functions_have_the_arguments_of_the_stub():
    declared = {
        node.name: [arg.arg for arg in node.args.args] for node in STUB.body if isinstance(node, ast.FunctionDef)
    }
    functions = {name: f for name, f in vars(native).items() if type(f).__name__ == "nb_func"}
    assert functions
    assert declared == {name: re.findall(r"(\w+): ", f.__doc__.partition(" -> ")[0]) for name, f in functions.items()}


def test_classes_have_the_properties_of_the_stub():
    nodes = [node for node in STUB.body if isinstance(node, ast.ClassDef)]
    functions = {node.name: [f for f in node.body if isinstance(f, ast.FunctionDef)] for node in nodes}
    declared = {name: {f.name for f in own if not f.name.startswith("_")} for name, own in functions.items()}
    classes = {name: c for name, c in vars(native).items() if isinstance(c, type)}
    assert declared == {name: {f for f in vars(c) if not f.startswith("_")} for name, c in classes.items()}


def test_the_package_names_every_function_of_the_stub():
    assert set(_core.__all__) == {name for name in vars(native) if not name.startswith("_")}
