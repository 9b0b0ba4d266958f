"""Check the language of the project: ``python benchmarks/language.py [PATH ...] [--counts]``.

The check scans docstrings, comments, messages, names and pages for words and fragments that plain technical English
avoids, and for sentences that are too long. It runs ruff's rule D401 for the mood of first lines, and pydoclint for
the sections that a docstring has. Tests differ in two points. The docstring of a test or a fixture states a law or
names a value and need not be imperative. Helpers of tests are private, so pydoclint does not run there.
``make check`` runs the script. ``--counts`` prints the number of findings for each package.
"""

from __future__ import annotations

import argparse
import ast
import importlib.util
import io
import re
import subprocess
import sys
import tokenize
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

QUOTING = "benchmarks/language.py", "tests/test_language.py", "tests/test_words.py"
"""Files that quote the words to avoid: they are not checked."""

WORDS = {
    r"tell|tells|told|telling": "report, state, distinguish",
    r"said|says|saying": "state, report",
    r"ask|asks|asked|asking": "query, request",
    r"glance|glances|glanced": "coarse evaluation",
    r"looks|looked|looking": "evaluate, inspect, search",
    r"sees": "observe, measure, detect",
    r"amid": "inside, between",
    r"alike": "similar, equal, common random numbers",
    r"aside": "apart, excluded",
    r"crowds?": "candidate set",
    r"(?<!type )hints?": "initial pose",
    r"settles?|settled|settling(?! time)": "refine, decide, converge",
    r"(?<!show)rooms?": "package, module, clearance",
    r"houses?": "project, package",
    r"doors?": "API, entry point, bindings",
    r"nobody": "name the subject",
    r"whoever|whatever": "name the subject",
    r"knows": "store, model, support",
    r"races?|raced": "successive halving of candidates",
    r"so_many": "beta_binomial_tail",
    r"stranger|strangers": "unknown object",
    r"unkind|honest|honesty|honestly": "calibrated",
    r"anew": "again",
    r"amongst|whilst|thereof|therein": "among, while, of it, in it",
    r"thing|things": "name the object",
}
"""Words that plain technical English avoids in this field, and what to write instead."""

FRAGMENTS = {
    r"(?:leaves?|leaving|left) out": "exclude",
    r"which of (?:them|these|those)": "name the subject",
    r"(?:is|are|was|were|be|being) of (?:a|an|the|its|that|another|one|some|no)\b": "is part of, belongs on",
    r"what (?:is|are|was|were|it|they|there|a|an|the|no|one|other) \S+ (?:tells?|says?|sees?)": "name the subject",
    r"of (?:what|them) (?:is|are|was|were)": "name the subject",
    r"(?:is|are|was|were|be) met|has met|have met|meets? (?:a|the|no) (?:face|part|surface)": "contact, hit",
    r"(?:is|are|was|were) asked (?:for|of)": "request, query",
    r"in words": "as text",
    r"the other way round": "the inverse",
    r"as good as|might as well": "write what holds",
    r"no more than (?:that|this)": "only",
    r"is what (?:it|they|is|are)": "write what holds",
    r"as (?:it|they) (?:is|are|was|were)\b": "unchanged",
    r"(?:looks?|looked) (?:at|for|into)": "evaluate, search, inspect",
}
"""Phrases that do not survive a second reading, and what to write instead."""

NAME_WORDS = {
    "told", "tell", "tells", "said", "says", "say", "asked", "ask", "asks", "look", "looks", "looked", "glance", "met",
    "sees", "behind", "held", "amid", "alike", "aside", "around", "crowd", "hint", "hints", "belongs", "settle",
    "settled", "settling", "room", "rooms", "house", "door", "doors", "otherwise", "mistakes", "stranger", "strangers",
    "knows", "race", "raced", "honest", "honesty", "nobody", "thing", "things",
}  # fmt: skip
"""Words that names do not contain."""

TERMS = {"ask", "tell"}
"""Names that are terms of the literature: the methods of the ask-and-tell interface of sequential optimizers."""

LONGEST = 40
"""Largest number of words in a sentence. The style asks for 25; the check is for sentences that need two readings."""

FIRST_WORDS = {
    "a", "all", "an", "and", "as", "at", "but", "by", "each", "every", "for", "from", "how", "if", "in", "its", "it",
    "no", "not", "of", "on", "one", "the", "those", "what", "when", "where", "whether", "which", "who", "with",
}  # fmt: skip
"""Words with which the docstring of a function does not begin: it begins with an imperative verb."""

FINDINGS = {"DOC102", "DOC103", "DOC104", "DOC105", "DOC202", "DOC203", "DOC403", "DOC404", "DOC501"}
"""Codes of pydoclint that concern sections which a docstring has.

A first line that begins with "Return" or "Yield" needs no section for the value, so DOC201 and DOC402 are not among
them. Exceptions pass through functions: a docstring may name one that a called function raises (DOC502), and a body
may catch one that it raises (DOC503).
"""

OPTIONS = (
    "--quiet", "--style=google", "--arg-type-hints-in-docstring=False", "--check-return-types=False",
    "--check-yield-types=False", "--check-class-attributes=False", "--omit-stars-when-documenting-varargs=True",
    "--ignore-private-args=True", "--allow-init-docstring=True", "--show-filenames-in-every-violation-message=True",
)  # fmt: skip
"""Options of pydoclint: types stand in the signature only."""

_WORD = re.compile(rf"(?<![\w`.-])(?:{'|'.join(WORDS)})(?![\w`]|-[a-z]|\()", re.IGNORECASE)
_FRAGMENT = re.compile(rf"\b(?:{'|'.join(FRAGMENTS)})\b", re.IGNORECASE)
_ALLOWED = re.compile(r"door opener|closed world|look-up table", re.IGNORECASE)
_CODE = re.compile(r"\$\$.*?\$\$|``.*?``|`[^`]*`|:\w+:`[^`]*`|\]\([^)]*\)|https?://\S+|\$[^$]*\$", re.DOTALL)
_PARTS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")


@dataclass(frozen=True, order=True)
class Finding:
    """One place that the check rejects.

    Attributes:
        path: path relative to the checkout.
        line: line number, from 1.
        text: what was found and what to write instead.
    """

    path: str
    line: int
    text: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.text}"


def words_of(text: str) -> Iterator[tuple[int, str]]:
    """Yield the line within a text, from 0, and the message for each word or phrase that the style avoids."""
    plain = _CODE.sub(lambda m: re.sub(r"[^\n]", "_", m[0]), text)
    for pattern, table in ((_WORD, WORDS), (_FRAGMENT, FRAGMENTS)):
        for m in pattern.finditer(plain):
            if _ALLOWED.search(plain[max(0, m.start() - 12) : m.end() + 12]):
                continue
            instead = next(v for k, v in table.items() if re.search(rf"\b(?:{k})", m[0], re.IGNORECASE))
            yield plain.count("\n", 0, m.start()), f'"{m[0]}": write {instead}'


def long_sentences(text: str) -> Iterator[tuple[int, str]]:
    """Yield the line within a text, from 0, and the message for each sentence of more than ``LONGEST`` words."""
    plain = _CODE.sub(lambda m: re.sub(r"[^\n]", "_", m[0]), text)
    for m in re.finditer(r"(?:[^.!?:;\n]|[.!?:;](?!\s)|\n(?!\s*(?:\n|[-*|>#├└│]|\w+:|\d+\.)))+", plain):
        count = len(re.findall(r"[A-Za-z][\w'-]*", m[0]))
        if count > LONGEST:
            yield plain.count("\n", 0, m.start()), f"a sentence of {count} words: {' '.join(m[0].split())[:60]} ..."


def names_of(name: str) -> set[str]:
    """Return the words of a name that the style avoids."""
    return set() if name in TERMS else {part.lower() for part in _PARTS.findall(name)} & NAME_WORDS


def python_findings(source: str) -> Iterator[tuple[int, str]]:
    """Yield line and message for docstrings, comments, messages and names of Python source."""
    nodes = list(ast.walk(ast.parse(source)))
    docstrings: set[ast.AST] = set()
    for node in nodes:
        body = getattr(node, "body", None)
        for k, one in enumerate(body if isinstance(body, list) else []):
            if isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant) and isinstance(one.value.value, str):
                docstrings.add(one.value)
                text = one.value.value
                yield from ((one.lineno + line, message) for line, message in words_of(text))
                yield from ((one.lineno + line, message) for line, message in long_sentences(text))
                first = text.split(maxsplit=1)[0].strip(".,:").lower() if text.strip() else ""
                function = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and k == 0
                if function and first in FIRST_WORDS and not _is_statement(node):
                    yield one.lineno, f'a docstring that begins with "{first}": begin with an imperative verb'
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in docstrings:
            if " " in node.value.strip():
                yield from ((node.lineno + line, message) for line, message in words_of(node.value))
        elif isinstance(node, ast.FunctionDef | ast.ClassDef | ast.AsyncFunctionDef):
            yield from ((node.lineno, f'"{w}" in the name {node.name}') for w in names_of(node.name))
        elif isinstance(node, ast.arg):
            yield from ((node.lineno, f'"{w}" in the name {node.arg}') for w in names_of(node.arg))
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield from ((node.lineno, f'"{w}" in the name {node.id}') for w in names_of(node.id))
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and ast.unparse(node.value) == "self":
            yield from ((node.lineno, f'"{w}" in the name {node.attr}') for w in names_of(node.attr))
    for line, text in _comments(source):
        yield from ((line + k, message) for k, message in words_of(text))


def _is_statement(node: ast.AST) -> bool:
    """Return whether a docstring need not be imperative: of a property, a fixture, or a test, which states its law."""
    return node.name.startswith("test_") or any(
        "property" in ast.unparse(d) or "fixture" in ast.unparse(d) for d in node.decorator_list
    )


def _comments(source: str) -> Iterator[tuple[int, str]]:
    """Yield line and text of comments, consecutive lines joined."""
    start, lines, last = 0, [], -1
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type != tokenize.COMMENT:
            continue
        if lines and token.start[0] != last + 1:
            yield start, "\n".join(lines)
            lines = []
        start = start if lines else token.start[0]
        lines.append(token.string.lstrip("# "))
        last = token.start[0]
    if lines:
        yield start, "\n".join(lines)


def cpp_findings(source: str) -> Iterator[tuple[int, str]]:
    """Yield line and message for comments, strings and names of C++ source."""
    pattern = re.compile(r'(?:^[ \t]*//[^\n]*\n?)+|//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', re.DOTALL | re.MULTILINE)
    for m in pattern.finditer(source):
        line = source.count("\n", 0, m.start()) + 1
        if not m[0].startswith('"') or " " in m[0]:
            text = re.sub(r"^([ \t]*)//", r"\1", m[0], flags=re.MULTILINE)
            yield from ((line + k, message) for k, message in words_of(text))
    code = pattern.sub(lambda m: re.sub(r"[^\n]", " ", m[0]), source)
    found: set[str] = set()
    for m in re.finditer(r"\b[A-Za-z_]\w*\b", code):
        if m[0] not in found and names_of(m[0]):
            found.add(m[0])
            yield code.count("\n", 0, m.start()) + 1, f"a name with words to avoid: {m[0]}"


def page_findings(source: str) -> Iterator[tuple[int, str]]:
    """Yield line and message for the prose of a page or of a makefile, without blocks of code."""
    prose = re.sub(r"^```.*?^```$", lambda m: "\n" * m[0].count("\n"), source, flags=re.DOTALL | re.MULTILINE)
    for find in (words_of, long_sentences):
        yield from ((line + 1, message) for line, message in find(prose))


def findings(path: Path) -> list[Finding]:
    """Return what the check rejects in one file."""
    name = path.relative_to(ROOT).as_posix()
    source = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        found = python_findings(source)
    elif path.suffix in (".cpp", ".hpp"):
        found = cpp_findings(source)
    elif path.suffix == ".pyi":
        found = ((n, m) for line, text in _comments(source) for n, m in ((line + k, w) for k, w in words_of(text)))
    elif path.name == "Makefile":
        found = page_findings(
            "\n".join(line.lstrip("# ") if line.startswith("#") else "" for line in source.splitlines())
        )
    else:
        found = page_findings(source)
    out = [Finding(name, line, text) for line, text in found]
    return out + [Finding(name, 1, f'"{word}" in the name of the file') for word in sorted(names_of(path.stem))]


def section_findings(paths: list[str]) -> Iterator[Finding]:
    """Yield what pydoclint reports about arguments, returned values and exceptions.

    Args:
        paths: files and folders to check.

    Raises:
        SystemExit: pydoclint failed.
    """
    if importlib.util.find_spec("pydoclint") is None:
        print("pydoclint is not installed: the sections of docstrings are not checked.", file=sys.stderr)
        return
    command = [sys.executable, "-m", "pydoclint.main", *OPTIONS, *paths]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1) or "Traceback" in done.stderr:
        raise SystemExit(done.stderr)
    for line in (done.stdout + done.stderr).splitlines():
        m = re.match(r"\s*(\S+\.py):(\d+): (DOC\d+): (.*)", line)
        if m is None or m[3] not in FINDINGS:
            continue
        text = m[4].split(" (Or could be")[0] + m[4].partition("on-doc103 ).")[2]
        if m[3] == "DOC103" and not _has_arguments(ROOT / m[1], int(m[2])):
            continue
        yield Finding(m[1], int(m[2]), f"{m[3]} {text}")


def _has_arguments(path: Path, line: int) -> bool:
    """Return whether the docstring of the function at a line has a section for its arguments."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.lineno == line:
            return "Args:\n" in (ast.get_docstring(node) or "")
    return False


def mood_findings(paths: list[str]) -> Iterator[Finding]:
    """Yield the first lines that ruff's rule D401 finds not to be imperative.

    Args:
        paths: files and folders to check.
    """
    options = ["check", "--isolated", "--select=D401", "--output-format=concise", "--config", "line-length=120"]
    command = [str(Path(sys.executable).parent / "ruff"), *options, *paths]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    for line in done.stdout.splitlines():
        m = re.match(r"(\S+\.py):(\d+):\d+: (D401 .*)", line)
        if m is not None and not _states_a_law(ROOT / m[1], int(m[2])):
            yield Finding(m[1], int(m[2]), m[3])


def _states_a_law(path: Path, line: int) -> bool:
    """Return whether the docstring at a line of a file is that of a test or a fixture."""
    if not path.is_relative_to(ROOT / "tests"):
        return False
    functions = (
        node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if hasattr(node, "decorator_list")
    )
    return any(_is_statement(node) for node in functions if node.body[0].lineno == line)


def list_findings(check: Callable[[list[str]], Iterator[Finding]], paths: list[str]) -> list[Finding]:
    """Return the findings of a check that runs in a process of its own."""
    return list(check(paths))


def files(paths: list[Path]) -> Iterator[Path]:
    """Yield the source files and pages that git tracks under some paths."""
    command = ["git", "-C", str(ROOT), "ls-files", "--cached", "--others", "--exclude-standard", "--", *map(str, paths)]
    listed = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()
    for name in sorted(set(listed)):
        path = ROOT / name
        if path.is_file() and (
            path.suffix in (".py", ".pyi", ".cpp", ".hpp", ".md", ".rst") or path.name == "Makefile"
        ):
            yield path


def group_of(path: str) -> str:
    """Return the package or folder to which a path is counted."""
    parts = path.split("/")
    return "/".join(parts[: 3 if path.startswith("src/tanteo/") else 1])


def main() -> None:
    """Print the findings, and exit with 1 if there are any."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("paths", nargs="*", type=Path, help="files or folders")
    parser.add_argument("--counts", action="store_true", help="number of findings for each package or folder")
    options = parser.parse_args()
    chosen = [path.resolve() for path in options.paths] or [ROOT]
    sources = chosen if options.paths else [ROOT / "src", ROOT / "benchmarks", ROOT / "tests"]
    python = [path for path in sources if path.is_dir() or path.suffix == ".py"]
    documented = [path for path in python if not path.is_relative_to(ROOT / "tests")]
    with ProcessPoolExecutor() as processes:
        checked = [
            processes.submit(list_findings, check, [str(path) for path in some])
            for check, some in ((section_findings, documented), (mood_findings, python))
            if some
        ]
        found = [one for each in processes.map(findings, files(chosen), chunksize=20) for one in each]
        found += [
            Finding(str((ROOT / one.path).relative_to(ROOT)), one.line, one.text)
            for each in checked
            for one in each.result()
        ]
    found = sorted({one for one in found if one.path not in QUOTING})
    if options.counts:
        for name, count in sorted(Counter(group_of(one.path) for one in found).items()):
            print(f"{count:5d} {name}")
    else:
        print("".join(f"{one}\n" for one in found), end="")
    sys.exit(bool(found) and not options.counts)


if __name__ == "__main__":
    main()
