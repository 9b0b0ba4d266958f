"""Exported names of the packages and who uses them: ``python benchmarks/exports.py [CHECKOUT]`` lists the unused ones.

A package exports the names of its ``__init__.pyi``. A module among them is public: its names without a leading
underscore, or the names in its own ``__init__.pyi`` or ``__all__``, belong to the public API as well.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
USERS = ("src", "tests", "benchmarks", "examples", "docs")
"""Folders whose programs use exported names."""

PROGRAMS = ("examples", "docs")
"""Folders whose programs show the public API to users."""


class Exports:
    """The exported names of a checkout.

    Attributes:
        root: folder of the checkout.
        modules: dotted names of all modules and packages.
        packages: names that each package of ``tanteo``, and ``tanteo`` itself, exports; not those of the compiled core.
        public: public modules and their names.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self._src = root / "src" / "tanteo"
        self.modules = {self._dotted(path): path for path in sorted(self._src.rglob("*.py"))}
        packages = [name for name, path in self.modules.items() if path.name == "__init__.py" and name.count(".") < 2]
        self.packages = {name: self._names(name) for name in packages if name != "tanteo._core"}
        self.public: dict[str, list[str]] = {}
        names = [f"{package}.{name}" for package, listed in self.packages.items() for name in listed]
        waiting = [name for name in names if name in self.modules and name.count(".") > 1]
        while waiting:
            module = waiting.pop()
            self.public[module] = self._names(module)
            inner = [f"{module}.{name}" for name in self.public[module]]
            waiting += [name for name in inner if name in self.modules and name not in self.public]

    def _dotted(self, path: Path) -> str:
        return ".".join(path.relative_to(self._src.parent).with_suffix("").parts).removesuffix(".__init__")

    def _names(self, module: str) -> list[str]:
        """Return the names of a public module."""
        path = self.modules[module]
        if path.with_suffix(".pyi").is_file():
            return _listed(path.with_suffix(".pyi"))
        body = ast.parse(path.read_text()).body
        for node in body:
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
                return list(ast.literal_eval(node.value))
        found = [name for node in body for name in _defined(node)]
        if path.name == "__init__.py":
            found += [a.name for node in body if isinstance(node, ast.ImportFrom) for a in node.names if a.asname]
        return [name for name in found if not name.startswith("_")]

    @property
    def count(self) -> int:
        """Number of names that the packages export."""
        return sum(map(len, self.packages.values()))

    def exports(self, module: str, name: str) -> bool:
        """Return whether a name of a module belongs to the public API.

        A module beside the packages and the compiled core export all names.
        """
        if module == "tanteo" or (module not in self.packages and module not in self.public):
            return module.count(".") < 2
        return name in (self.packages | self.public)[module] or name.startswith("__")

    def uses(self, path: Path) -> Iterator[tuple[int, str, str]]:
        """Yield line, module and name of each use of a module's name in a program."""
        tree, bound = ast.parse(path.read_text()), dict[str, str]()
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                bound |= {a.asname or "tanteo": a.name if a.asname else "tanteo" for a in node.names if _own(a.name)}
            elif isinstance(node, ast.ImportFrom) and _own(node.module):
                for a in node.names:
                    yield node.lineno, node.module, a.name
                    if f"{node.module}.{a.name}" in self.modules:
                        bound[a.asname or a.name] = f"{node.module}.{a.name}"
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and (module := self._module(node.value, bound)):
                yield node.lineno, module, node.attr

    def _module(self, node: ast.expr, bound: dict[str, str]) -> str | None:
        """Return the module that an expression names."""
        if isinstance(node, ast.Name):
            return bound.get(node.id)
        if isinstance(node, ast.Attribute) and (module := self._module(node.value, bound)):
            name = f"{module}.{node.attr}"
            return name if name in self.modules else None
        return None

    def unused(self) -> list[str]:
        """Return the exported names that no other package, example, page of the documentation or README uses."""
        used: set[tuple[str, str]] = set()
        for folder in ("src", *PROGRAMS):
            for path in sorted((self.root / folder).rglob("*.py")):
                own = "tanteo." + path.relative_to(self._src).parts[0] if folder == "src" else "none"
                for _, module, name in self.uses(path):
                    if not f"{module}.".startswith(own.removesuffix(".py") + "."):
                        used |= {(module, name), tuple(module.rpartition(".")[::2])}
        pages = [*(self.root / "docs").rglob("*.md"), *(self.root / "docs").rglob("*.rst"), *self.root.glob("*.md")]
        texts = [page.read_text() for page in pages if page.name != "CHANGELOG.md" and page.parent.name != "decisions"]
        code = re.findall(r"```.*?```|`[^`\n]+`", "\n".join(texts), re.DOTALL)
        words = set(re.findall(r"\w+", " ".join(code)))
        listed = ((package, name) for package, names in self.packages.items() for name in names)
        return [f"{p}.{name}" for p, name in listed if (p, name) not in used and name not in words]


def _own(module: str | None) -> bool:
    return (module or "").split(".")[0] == "tanteo"


def _listed(path: Path) -> list[str]:
    """Return the names that an ``__init__.pyi`` imports or defines, without the former name of a renamed one."""
    body = ast.parse(path.read_text()).body
    renamed = {node.value.id for node in body if isinstance(node, ast.Assign) and isinstance(node.value, ast.Name)}
    imported = [a.asname or a.name for node in body if isinstance(node, ast.ImportFrom) for a in node.names]
    defined = [name for node in body for name in _defined(node) if not name.startswith("_")]
    return [name for name in [*imported, *defined] if name not in renamed]


def _defined(node: ast.stmt) -> list[str]:
    """Return the names that a statement of a module defines."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return [name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)]


def main() -> None:
    found = Exports(Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else ROOT)
    for package, names in found.packages.items():
        print(f"{package} {len(names)}")
    print(f"{found.count} exported names, {sum(map(len, found.public.values()))} in {len(found.public)} public modules")
    print("unused:", *found.unused(), sep="\n")


if __name__ == "__main__":
    main()
