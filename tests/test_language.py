"""The check of the language finds the words, fragments and sections that the style rejects."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import language

ROOT = Path(__file__).parents[1]


def messages(found):
    return [text for _, text in found]


@pytest.mark.parametrize(
    "text", ["The sensor tells the face.", "A door of the package.", "Parts are left out.", "It is of another part."]
)
def test_words_and_fragments_are_found(text):
    assert len(list(language.words_of(text))) == 1


@pytest.mark.parametrize(
    "text", ["The sensor reports the face.", "Read ``told`` and `asked`.", "[look](told.md)", "Type hints are exact."]
)
def test_plain_text_and_code_pass(text):
    assert list(language.words_of(text)) == []


def test_docstrings_comments_messages_and_names_are_scanned():
    source = (
        '"""Module."""\n'
        "# the door\n"
        "def told(look, k):\n"
        '    """Whether it fits."""\n'
        '    raise ValueError("nobody said so")\n'
    )
    assert sorted({line for line, _ in language.python_findings(source)}) == [2, 3, 4, 5]


def test_properties_may_have_noun_phrases():
    source = 'class A:\n    @property\n    def size(self):\n        """The size [m]."""\n'
    assert list(language.python_findings(source)) == []


def test_comments_strings_and_names_of_cpp_are_scanned():
    source = '// The told pose.\nint told_pose = 0;\nauto s = "asked for";\n'
    assert sorted({line for line, _ in language.cpp_findings(source)}) == [1, 2, 3]


def test_long_sentences_are_found_in_prose_only():
    assert len(list(language.long_sentences("word " * 41 + "."))) == 1
    assert list(language.page_findings("```\n" + "word " * 60 + "\n```\n")) == []


def test_arguments_of_docstrings_are_compared_with_the_signature(tmp_path):
    pytest.importorskip("pydoclint", reason="pydoclint is not installed")
    file = tmp_path / "one.py"
    file.write_text(
        'def f(a: int) -> int:\n    """Return it.\n\n    Args:\n        b: number.\n    """\n    return a\n'
    )
    assert any("DOC103" in one.text for one in language.section_findings([str(file)]))
