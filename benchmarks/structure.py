"""Figures of the structure: ``python benchmarks/structure.py [CHECKOUT] [--commit REVISION] [--list NAME]``.

The figures are those by which the redesign into measurement factors is judged. Packages that a checkout lacks are
skipped. ``--list fits`` (``kinds``, ``numbers``, ``entered``) prints the places that a figure counts.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import os
import re
import subprocess
import sys
import tokenize
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import exports

ROOT = Path(__file__).resolve().parents[1]

CODE_PACKAGES = (
    "inference", "posterior", "factors", "measurements", "answers", "recognition", "vision", "localization",
    "fitting/localization",
)  # fmt: skip
"""Packages and modules of recognition and localization, under their names in any commit."""

NUMBER_PACKAGES = ("inference", "posterior", "vision")
"""Packages whose tuned numbers are counted."""

SIMULATED = {"vision/rendering.py": "light, paint and lens of rendered scenes: no answer depends on them"}
"""Modules of these packages without tuned numbers, and why: they simulate what is sensed."""

KINDS = ("FACE", "EDGE", "CORNER", "CENTRE", "ROUND", "BALL", "APEX", "WALLS", "CENTRES")
"""Names of kinds in ``sensors`` and in the C++ ``enum class Kind``."""

SOURCE = re.compile(
    r"benchmarks[/\\ ]|[Dd]ecisions?\b|\bRows? [a-z]|\barxiv\b|\bdoi\b|\b[Ee]q\. ?\(?\d"
    r"|\([A-Z][^()]*\b(?:18|19|20)\d\d\)|\b[A-Z]\w+ (?:et al\.? |and \w+ )?\((?:18|19|20)\d\d\)"
)
"""Text that names what chose a number: a benchmark or a row of ``against_scenes.py``, a decision, an equation, or an
author with a year."""


@dataclass(frozen=True)
class Place:
    """A place behind a figure: path, line and what is there."""

    path: str
    line: int
    what: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line} {self.what}"


# Lines


def python_lines(source: str) -> tuple[int, int]:
    """Return code lines, without blanks, comments and docstrings, and docstring lines of Python source."""
    tree = ast.parse(source)
    texts = {
        line
        for node in ast.walk(tree)
        if isinstance(body := getattr(node, "body", None), list)
        for one in body
        if isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant) and isinstance(one.value.value, str)
        for line in range(one.lineno, one.end_lineno + 1)
    }
    quiet = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)
    used = {
        line
        for token in tokenize.generate_tokens(io.StringIO(source).readline)
        if token.type not in quiet
        for line in range(token.start[0], token.end[0] + 1)
    }
    return len(used - texts), len(texts)


def without_comments(source: str) -> str:
    """Return C++ source with comments and string literals blanked, line numbers kept."""
    pattern = r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"'
    return re.sub(pattern, lambda m: re.sub(r"[^\n]", " ", m[0]), source, flags=re.DOTALL)


def cpp_lines(source: str) -> int:
    """Return lines of C++ that are neither blank nor comment alone."""
    return sum(bool(line.strip()) for line in without_comments(source).splitlines())


# Iterative pose fits


def python_fits(source: str) -> list[tuple[int, str]]:
    """Return line and name of functions that fit a pose iteratively.

    Such a function has a loop whose body both solves for a step and moves a pose. A step is a linear solve, an inverse
    or an eigen-decomposition, there or in a function of the same module that it calls. A pose moves by ``SE3.exp`` or
    ``SO3.exp``, assigned back to the same variable. Loops that draw or place poses without solving are not fits.
    """
    tree, out = ast.parse(source), []
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    solving = {f.name for f in functions if _solves(f, set())}
    for f in functions:
        loops = [node for node in ast.walk(f) if isinstance(node, ast.For | ast.While)]
        if any(_solves(loop, solving) and _moves(loop) for loop in loops):
            out.append((f.lineno, f.name))
    return out


_SOLVERS = {"solve", "lstsq", "inv", "pinv", "cho_solve", "scaled_solve", "joint_test", "mixture", "_covariance"}
"""Functions that solve for a step, NumPy's and the project's own."""


def _solves(node: ast.AST, also: set[str]) -> bool:
    names = (_called(call) for call in ast.walk(node) if isinstance(call, ast.Call))
    return any(name in _SOLVERS or name in also for name in names)


def _called(call: ast.Call) -> str:
    return call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")


def _moves(node: ast.AST) -> bool:
    """Return whether a node assigns to a name a pose made of that name and an exponential, or a setup that it moves."""
    for one in ast.walk(node):
        if not isinstance(one, ast.Assign):
            continue
        targets = {n.id for t in one.targets for n in ast.walk(t) if isinstance(n, ast.Name)}
        used = {n.id for n in ast.walk(one.value) if isinstance(n, ast.Name)}
        calls = {_called(c) for c in ast.walk(one.value) if isinstance(c, ast.Call)}
        if targets & used and calls & {"exp", "moved", "retract"}:
            return True
    return False


CPP_SOLVE = re.compile(r"\b(?:solve_cholesky|solve_symmetric|ldlt)\s*\(|/=\s*A\[i\]\[i\]")
CPP_MOVE = re.compile(
    r"\b(?:moved|stepped|rotation|retract|pose_of|after)\s*\(|\byaw\s*=|\.z\[i\]\s*=|\btask\.moved|\bturned\(|\battempt\("
)


def cpp_functions(source: str) -> list[tuple[int, str, str]]:
    """Return line, name and body of the functions defined in C++ source."""
    text, out, at = without_comments(source), [], 0
    head = re.compile(r"([~\w]+)\s*\([^;{}()]*(?:\([^;{}()]*\)[^;{}()]*)*\)\s*(?:const\s*)?(?:noexcept\s*)?"
                      r"(?::\s*\w+\s*[({][^;{}]*[)}]\s*(?:,[^{;]*)?)?\{")  # fmt: skip
    for m in head.finditer(text):
        if m[1] in ("if", "for", "while", "switch", "catch") or m.start() < at:
            continue
        end = _closing(text, m.end() - 1)
        out.append((text.count("\n", 0, m.start()) + 1, m[1], text[m.end() : end]))
        at = end
    return out


def _closing(text: str, start: int) -> int:
    """Return where the brace or parenthesis that opens at ``start`` closes."""
    opens, depth = text[start], 0
    closes = {"{": "}", "(": ")"}[opens]
    for k in range(start, len(text)):
        depth += (text[k] == opens) - (text[k] == closes)
        if not depth:
            return k
    return len(text)


def _loops(body: str) -> Iterator[str]:
    """Yield head and body of every loop."""
    for m in re.finditer(r"\b(?:for|while)\s*(?=\()", body):
        end = _closing(body, m.end()) + 1
        rest = body[end:].lstrip()
        start = len(body) - len(rest)
        stop = _closing(body, start) if rest.startswith("{") else body.find(";", start)
        yield body[m.end() : stop]


def cpp_fits(source: str) -> list[tuple[int, str]]:
    """Return line and name of C++ functions that fit a pose (or its states) iteratively.

    The criterion is that of :func:`python_fits`: a loop in which a linear system is solved and a pose or state moves,
    there or in functions of the same file that the loop calls.
    """
    functions = cpp_functions(source)

    def reach(pattern: re.Pattern) -> set[str]:
        found: set[str] = set()
        while True:
            more = {n for _, n, body in functions if pattern.search(body) or _calls(body, found)}
            if more <= found:
                return found
            found |= more

    solving, moving = reach(CPP_SOLVE), reach(CPP_MOVE)
    steps = solving & moving
    out = []
    for line, name, body in functions:
        for loop in _loops(body):
            whole = (CPP_SOLVE.search(loop) or _calls(loop, solving - steps)) and CPP_MOVE.search(loop)
            if whole or _calls(loop, {s for s in steps if _is_step(functions, s)}):
                out.append((line, name))
                break
    return out


def _calls(body: str, names: set[str]) -> bool:
    return any(re.search(rf"(?<![\w:]){re.escape(name)}\s*\(", body) for name in names)


def _is_step(functions: list[tuple[int, str, str]], name: str) -> bool:
    """Return whether a function solves and moves once, without a loop that does both."""
    for _, own, body in functions:
        if own == name and CPP_SOLVE.search(body) and CPP_MOVE.search(body):
            return not any(CPP_SOLVE.search(loop) and CPP_MOVE.search(loop) for loop in _loops(body))
    return False


# Tuned numbers


EXCLUDED = "Numerical:", "Definition:"
"""How the text of a constant begins that no engineer would tune; :func:`tuned_numbers` states the rule."""


@dataclass(frozen=True)
class Number:
    """Tuned numbers of one assignment: how many, and whether their docstring or comment names what chose them."""

    line: int
    name: str
    count: int
    sourced: bool


def tuned_numbers(source: str) -> list[Number]:
    """Return the numeric literals in constants of a module or class, fields of dataclasses included.

    0, 1 and -1 alone, indices in subscripts and what is computed from other constants only do not count as tuned. Nor
    does a constant whose text begins with "Numerical:" or "Definition:". A numerical constant is a tolerance of
    float64, a number of quadrature nodes, a limit of an iteration or a size of an array. Its text states why a more
    accurate value changes no answer by more than rounding or the stated error. A definition cannot be chosen.
    """
    tree, lines, out = ast.parse(source), source.splitlines(), []
    for owner in [tree, *(node for node in ast.walk(tree) if isinstance(node, ast.ClassDef))]:
        body, attributes = owner.body, _attributes(ast.get_docstring(owner) or "")
        for k, node in enumerate(body):
            if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
                continue
            found = [c for c in _literals(node.value) if c not in (0, 1)]
            if not found:
                continue
            target = ast.unparse(node.targets[0] if isinstance(node, ast.Assign) else node.target)
            text = " ".join([*_texts(lines, body, k), attributes.get(target, "")])
            if text.startswith(EXCLUDED):
                continue
            out.append(Number(node.lineno, target, len(found), bool(SOURCE.search(text))))
    return out


def _attributes(docstring: str) -> dict[str, str]:
    """Return the texts of the attributes that the docstring of a class lists, by name."""
    entries = re.findall(r"^ {4}(\w+): (.*(?:\n {8,}.*)*)", docstring, flags=re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in entries}


def _texts(lines: list[str], body: list[ast.stmt], k: int) -> Iterator[str]:
    """Yield the docstring after an assignment and the comments beside and above it."""
    node = body[k]
    after = body[k + 1] if k + 1 < len(body) else None
    if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) and isinstance(after.value.value, str):
        yield " ".join(after.value.value.split())
    yield from (line.split("#", 1)[1] for line in lines[node.lineno - 1 : node.end_lineno] if "#" in line)
    above = node.lineno - 2
    while above >= 0 and lines[above].lstrip().startswith("#"):
        yield lines[above]
        above -= 1


def _literals(node: ast.AST) -> Iterator[float]:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
        yield node.value
    for child in ast.iter_child_nodes(node):
        if not (isinstance(node, ast.Subscript) and child is node.slice) and not isinstance(child, ast.Lambda):
            yield from _literals(child)


# Kinds


WORDS = (
    "point", "plane", "edge", "vertex", "corner", "circle", "cylinder", "cone", "sphere", "centre", "sphere_centre",
    "apex", "ray", "range",
)  # fmt: skip
"""Names of kinds of readings and sensed features, as files and columns have them."""

_NAMES = "|".join(sorted(KINDS, key=len, reverse=True))
_TEXTS = "|".join(sorted(WORDS, key=len, reverse=True))
PYTHON_KIND = re.compile(
    rf"(?:==|!=|\bin\b|\bis\b)\s*\(?\*?(?:{_NAMES})\b"
    rf"|\b(?:{_NAMES})\s*(?:==|!=|\bin\b)|\b(?:{_NAMES})(?:\[|\.get\()"
    r"|(?<!for )\bkinds?(?:\[[^\]]*\])?\)?\s*(?:==|!=|\bnot in\b|\bin\b)\s*"
    rf"[({{\[*]*(?:_?[A-Z][A-Z_]+\b|[\"'](?:{_TEXTS})[\"'])"
    rf"|[\"'](?:{_TEXTS})[\"']\s*(?:==|!=|\bnot in\b|\bin\b)\s*[\w.]*kinds?\b"
    r"|\bis_round\(|\bdirections_met\(|\blabel_kind\("
)
"""Questions of the kind in Python: comparisons with a kind, look-ups by it, and functions that classify kinds."""

OTHER_KINDS = {
    "catalogue/segment.py": "derived data of a part",
    "cli/probe.py": "machines",
    "io/readings/broken_bags.py": "recordings",
    "io/documents/mount_files.py": "joints of URDF",
    "io/documents/ros_messages.py": "messages of ROS",
    "io/readings/ros_readings.py": "messages of ROS",
    "io/logs/ply.py": "numbers of PLY",
    "machines/address.py": "machines",
    "parts/faces/planes.py": "surfaces of CAD",
    "parts/readers/step.py": "surfaces of CAD",
    "parts/faces/surfaces.py": "surfaces of CAD",
}
"""Modules in which ``kind`` is not one of measurements or sensed features, and of what it is one."""

CPP_KIND = re.compile(r"(?<!Round)\bKind::\w+|\bon_face\(\)|\bamid\(\)|\bswitch\s*\([^)]*\bkind\b")
"""Questions of the kind in C++. ``RoundKind`` is a surface that is fitted, not a kind of measurement."""


def kind_checks(source: str, pattern: re.Pattern) -> list[tuple[int, str]]:
    """Return line and text of each place that depends on the kind of a measurement."""
    clean = without_comments(source) if pattern is CPP_KIND else _without_texts(source)
    return [
        (n, m[0])
        for n, line in enumerate(clean.splitlines(), 1)
        if not re.match(r"\s*(?:for\b.*:\s*$|(?:from|import)\b)", line)
        for m in pattern.finditer(line)
    ]


def _without_texts(source: str) -> str:
    """Return Python source with docstrings and comments blanked, other strings kept."""
    lines = source.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT or (
            token.type == tokenize.STRING and token.string.startswith(('"""', 'r"""'))
        ):
            for n in range(token.start[0] - 1, token.end[0]):
                first = token.start[1] if n == token.start[0] - 1 else 0
                last = token.end[1] if n == token.end[0] - 1 else len(lines[n])
                lines[n] = lines[n][:first] + " " * (last - first) + lines[n][last:]
    return "\n".join(lines)


# Whole checkouts


@dataclass(frozen=True)
class Checkout:
    """The sources of a checkout: path relative to ``src/tanteo`` and text."""

    root: Path

    @property
    def src(self) -> Path:
        return self.root / "src" / "tanteo"

    def files(self, package: str, *suffixes: str) -> list[Path]:
        """Return the files of a package, or the module of that name; none if the checkout lacks it."""
        module = self.src / f"{package}.py"
        found = [p for p in (self.src / package).rglob("*") if p.suffix in suffixes]
        return sorted([*found, *([module] if module.is_file() and ".py" in suffixes else [])])

    def everywhere(self, find: Callable[[str], Iterable[tuple[int, str]]], *suffixes: str) -> list[Place]:
        """Return the places that ``find`` returns for the files with some suffixes."""
        paths = sorted(p for p in self.src.rglob("*") if p.suffix in suffixes)
        return [Place(str(p.relative_to(self.src)), *each) for p in paths for each in find(p.read_text())]

    def packages(self) -> list[str]:
        return sorted(p.name for p in self.src.iterdir() if p.is_dir() and any(p.glob("*.py")))


def fits(checkout: Checkout) -> list[Place]:
    """Return all iterative fits of poses, in C++ and Python."""
    return [*checkout.everywhere(cpp_fits, ".cpp", ".hpp"), *checkout.everywhere(python_fits, ".py")]


def kinds(checkout: Checkout) -> list[Place]:
    """Return the places outside of folders named ``factors`` that depend on the kind of a measurement."""
    found = checkout.everywhere(lambda s: kind_checks(s, CPP_KIND), ".cpp", ".hpp")
    found += checkout.everywhere(lambda s: kind_checks(s, PYTHON_KIND), ".py")
    found = [place for place in found if place.path not in OTHER_KINDS]
    return [place for place in found if "factors" not in Path(place.path).parts[:-1]]


def numbers(checkout: Checkout, package: str) -> list[tuple[Place, Number]]:
    """Return the tuned numbers of a package."""
    return [
        (Place(str(p.relative_to(checkout.src)), one.line, one.name), one)
        for p in checkout.files(package, ".py")
        if str(p.relative_to(checkout.src)) not in SIMULATED
        for one in tuned_numbers(p.read_text())
    ]


TRACE = """
import json, sys
from pathlib import Path
root = Path(sys.argv[1])
import tanteo
src = str(Path(tanteo.__file__).parent)
part = tanteo.read_part(root / "examples" / "parts" / "bracket_left.step")
readings = tanteo.read_readings(root / "examples" / "readings" / "bracket_bare.csv")
tanteo.identify(readings, [part])
files = set()
def enter(frame, event, arg):
    if event == "call" and frame.f_code.co_filename.startswith(src):
        files.add(str(Path(frame.f_code.co_filename).relative_to(src)))
sys.setprofile(enter)
tanteo.identify(readings, [part])
sys.setprofile(None)
print(json.dumps(sorted(files)))
"""


def entered(checkout: Checkout) -> list[str]:
    """Return the Python files that the second ``identify`` of bare readings against one part enters.

    It runs in a process of its own, with the sources and the compiled core of the checkout.
    """
    environment = os.environ | {"PYTHONPATH": str(checkout.root / "src"), "OMP_NUM_THREADS": "1"}
    run = [sys.executable, "-c", TRACE, str(checkout.root)]
    return json.loads(subprocess.run(run, check=True, env=environment, stdout=subprocess.PIPE, text=True).stdout)


def touched(checkout: Checkout, revision: str) -> list[tuple[str, int, int]]:
    """Return path, added and removed lines of the source files that a commit or a range ``A..B`` touches."""
    names = [revision] if ".." in revision else [f"{revision}~1", revision]
    command = ["git", "-C", str(checkout.root), "diff", "--numstat", *names, "--", "src"]
    rows = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()
    return [(path, int(a), int(b)) for a, b, path in (row.split("\t") for row in rows) if a != "-"]


def figures(checkout: Checkout, *, trace: bool = True) -> dict[str, int]:
    """Return all figures by name."""
    out = {"files entered by a bare identify": len(entered(checkout))} if trace else {}
    every = fits(checkout)
    out["iterative pose fits"] = len(every)
    out["iterative pose fits in C++"] = sum(not place.path.endswith(".py") for place in every)
    for package in NUMBER_PACKAGES:
        found = numbers(checkout, package)
        if found:
            out[f"tuned numbers in {package}"] = sum(n.count for _, n in found)
            out[f"of them with a source in {package}"] = sum(n.count for _, n in found if n.sourced)
    checks = kinds(checkout)
    for name, suffixes in (("C++", (".cpp", ".hpp")), ("Python", (".py",))):
        some = [place for place in checks if place.path.endswith(suffixes)]
        out[f"checks of a kind in {name}"] = len(some)
        out[f"files with checks of a kind in {name}"] = len({place.path for place in some})
    lines = [python_lines(p.read_text()) for package in CODE_PACKAGES for p in checkout.files(package, ".py")]
    out["code lines of Python in the judged packages"] = sum(code for code, _ in lines)
    out["docstring lines of Python in the judged packages"] = sum(text for _, text in lines)
    out["code lines of C++"] = sum(
        cpp_lines(p.read_text()) for p in checkout.src.rglob("*") if p.suffix in (".cpp", ".hpp")
    )
    found = exports.Exports(checkout.root)
    out |= {"exported names": found.count, "exported names without a user": len(found.unused())}
    out["names in public modules"] = sum(map(len, found.public.values()))
    return out | page_figures(checkout.root)


def page_words(page: str) -> int:
    """Return the number of words of a page in Markdown, without code blocks, formulas and targets of links."""
    text = re.sub(r"^```.*?^```$", "", page, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"\$\$.*?\$\$|\$[^$\n]*\$", " ", text, flags=re.DOTALL)
    text = re.sub(r"\]\([^)\s]*\)", "]", text)
    return sum(bool(re.search("[A-Za-z]", word)) for word in text.split())


def page_figures(root: Path) -> dict[str, int]:
    """Return the words of the pages in ``docs``, and the number of decisions with a page of their own."""
    pages = sorted((root / "docs").rglob("*.md"))
    live = [page for page in pages if re.match(r"\d{4}-", page.name)]
    return {"words of docs": sum(page_words(page.read_text()) for page in pages), "live decisions": len(live)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("checkout", nargs="?", type=Path, default=ROOT)
    parser.add_argument("--commit", help="a commit or a range A..B: source files that it touches")
    parser.add_argument(
        "--list", choices=("fits", "kinds", "numbers", "entered", "exports"), help="the places behind a figure"
    )
    options = parser.parse_args()
    checkout = Checkout(options.checkout.resolve())
    if options.commit:
        rows = touched(checkout, options.commit)
        print("\n".join(f"{path} +{a} -{b}" for path, a, b in rows))
        print(f"{len(rows)} source files, +{sum(a for _, a, _ in rows)} -{sum(b for _, _, b in rows)}")
    elif options.list == "numbers":
        for package in NUMBER_PACKAGES:
            for place, one in numbers(checkout, package):
                print(f"{place} {one.count}{' sourced' if one.sourced else ''}")
    elif options.list == "exports":
        print(*exports.Exports(checkout.root).unused(), sep="\n")
    elif options.list:
        print(*{"fits": fits, "kinds": kinds, "entered": entered}[options.list](checkout), sep="\n")
    else:
        print("| figure | value |\n|---|---|")
        for name, value in figures(checkout).items():
            print(f"| {name} | {value} |")
        print("\n| package | files | code lines | docstring lines |\n|---|---|---|---|")
        for package in [*checkout.packages(), "recognition"]:
            lines = [python_lines(p.read_text()) for p in checkout.files(package, ".py")]
            print(f"| {package} | {len(lines)} | {sum(a for a, _ in lines)} | {sum(b for _, b in lines)} |")


if __name__ == "__main__":
    main()
