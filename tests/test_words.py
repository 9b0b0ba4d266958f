"""The field's words, and not the private ones that they replaced: in public APIs, in options, in pages."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SRC = ROOT / "src" / "tanteo"
PAGES = [
    ROOT / "README.md",
    ROOT / "CHANGELOG.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "examples").glob("*.py")),
    *sorted((ROOT / "docs" / "notebooks").glob("*.py")),
]
NAMES = {
    "stray": "outlier",
    "astray": "outlier",
    "clutter": "outlier rate",
    "rough": "prior",
    "climb": "maximize",
    "climber": "objective",
    "belief": "posterior, or state",
    "told": "observation",
    "situation": "context",
    "kin": "near variant",
    "idea": "guess",
    "stance": "approach pose",
    "stances": "approach poses",
    "hue": "color",
    "hues": "colors",
    "ghost": "overlay",
    "ghosts": "overlays",
    "distinguish": "discriminate",
    "alpha": "significance",
    "remarks": "findings",
    "meant": "findings",
    "sheets": "samples",
    "polish": "refine",
}
"""Parts of public names, and the word to use."""

PROSE = {
    r"\bstrays?\b": "outlier",
    r"\bastray\b": "outlier",
    r"\bclutter\b": "outliers",
    r"\bnone of these\b": "unknown object",
    r"\brough poses?\b": "prior pose",
    r"\bcorner sd sd\b": "corner sd",
    r"\bfree (paths?|beams?)\b": "free-space ray",
    r"\bbare (readings?|points?|touches)\b": "unlabelled",
    r"\bclimb(s|ed|ing)?\b": "maximize",
    r"\bfree motions?\b": "unobserved direction",
    r"\bstances?\b": "approach pose",
    r"\bghosts?\b": "overlay",
    r"\b(tell|tells|told) (them |two parts |the parts )?apart\b": "discriminate",
    r"--strays\b": "--outlier-rate",
    r"--none\b": "--unknown-prior",
    r"--near\b": "--pose-prior",
    r"--alpha\b": "--significance",
    r"--most\b": "--max-measurements",
    r"--distinguish\b": "--discriminate",
}
"""Phrases, and the word to use."""


def public_names() -> list[tuple[str, str]]:
    """Return files and exported names of all packages."""
    found = []
    for path in sorted(SRC.rglob("*.py")):
        place = str(path.relative_to(SRC))
        if not path.stem.startswith("_"):
            found.append((place, path.stem))
        for node in ast.parse(path.read_text()).body:
            name = getattr(node, "name", "")
            if name and not name.startswith("_"):
                found.append((place, name))
            if isinstance(node, ast.FunctionDef) and not name.startswith("_"):
                arguments = [*node.args.args, *node.args.kwonlyargs]
                found += [(f"{place} {name}", argument.arg) for argument in arguments]
    return found


def words_of(name: str) -> list[str]:
    """Return the words of ``SensingState`` and ``sensing_state``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower().split("_")


def test_public_names_use_the_words_of_the_field():
    wrong = [
        f"{place}: {name}: say {NAMES[word]}"
        for place, name in public_names()
        for word in words_of(name)
        if word in NAMES
    ]
    assert wrong == []


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_pages_use_the_words_of_the_field(page):
    text = re.sub(r"\]\([^)]*\)", "]", page.read_text(encoding="utf-8"))
    wrong = [
        f"{m[0]}: say {word}" for pattern, word in PROSE.items() for m in re.finditer(pattern, text, re.IGNORECASE)
    ]
    assert wrong == []


def test_options_and_messages_use_the_words_of_the_field():
    wrong = []
    for path in sorted(SRC.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                wrong += [
                    f"{path.relative_to(SRC)}:{node.lineno}: {m[0]}: say {word}"
                    for pattern, word in PROSE.items()
                    for m in re.finditer(pattern, node.value, re.IGNORECASE)
                ]
    assert wrong == []
