"""No text of a file becomes markup."""

from __future__ import annotations

import json
from html.parser import HTMLParser

from hypothesis import given
from hypothesis import strategies as st

from tanteo.render.html.page import data, element, escape, prose


class Reader(HTMLParser):
    def __init__(self):
        super().__init__()
        self.tags, self.text, self.attributes = [], [], {}

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes.update(attrs)

    def handle_data(self, data):
        self.text.append(data)


def read(markup):
    reader = Reader()
    reader.feed(markup)
    reader.close()
    return reader


PRINTABLE = st.text(st.characters(exclude_categories=("C", "Z"), include_characters=" "))


@given(PRINTABLE, PRINTABLE)
def test_text_and_attributes_come_out_as_they_went_in(text, value):
    found = read(element("p", text, title=value).text)
    assert found.tags == ["p"]
    assert "".join(found.text) == text
    assert found.attributes == {"title": value}


@given(st.text())
def test_any_text_is_text_and_can_be_written(text):
    shown = escape(text)
    assert not set("<>\"'") & set(shown)
    shown.encode("utf-8")


@given(st.recursive(st.text() | st.integers(), lambda x: st.lists(x) | st.dictionaries(st.text(), x)))
def test_data_arrives_and_cannot_end_early(document):
    made = data(document, "scene").text
    inner = made.removeprefix('<script type="application/json" id="scene">').removesuffix("</script>")
    assert "<" not in inner
    assert json.loads(inner) == document


def test_attributes_that_are_none_are_left_out_and_true_stands():
    assert element("input", type="radio", checked=True, disabled=None).text == '<input type="radio" checked>'
    assert element("i", class_="mark", data_h=0).text == '<i class="mark" data-h="0"></i>'


@given(st.text())
def test_prose_keeps_its_text(text):
    shown = read(prose(text).text)
    assert "".join(shown.text) == "".join(read(escape(text)).text)
    assert set(shown.tags) <= {"span"}


def test_options_and_lengths_are_not_broken():
    marked = prose("Within 0.5 mm (95 %), or state --scale-sd 10ppm.").text
    for word in ("0.5 mm", "95 %", "--scale-sd"):
        assert f'<span class="word">{word}</span>' in marked
