"""The documentation as a site: ``make docs``. The pages of the repository are the source; this adds the interface.

The source folder is the repository, so that links between pages, examples and the pages beside ``docs`` hold. Nothing
is fetched when a page is read: mathematics becomes MathML, which browsers draw themselves.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import latex2mathml.converter
from docutils import nodes

import tanteo

ROOT = Path(__file__).resolve().parents[1]

project = "tanteo"
author = copyright = "The tanteo authors"
version = release = tanteo.__version__
root_doc = "docs/index"
include_patterns = ["docs/**", "build/notebooks/*.rst", "*.md", "LICENSE"]
exclude_patterns = [
    "docs/pictures/*.py",
    "docs/notebooks/**",
    "docs/conf.py",
    ".*",
    "build/docs",
    "src",
    "tests",
    "benchmarks",
]
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_gallery.gen_gallery"]

sphinx_gallery_conf = {
    "examples_dirs": "docs/notebooks",
    "gallery_dirs": "build/notebooks",
    "filename_pattern": r"[/\\]\d",
    "abort_on_example_error": True,
    "run_stale_examples": True,  # the program may have changed though the notebook has not
    "write_computation_times": False,
    "show_memory": False,
    "min_reported_time": 10**6,
    "download_all_examples": False,
    "show_signature": False,
    "within_subsection_order": "FileNameSortKey",
}

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_class_signature = "separated"
toc_object_entries = (
    False  # else every page carries the whole interface in its navigation, and the build takes thrice as long
)
napoleon_google_docstring = True
napoleon_use_ivar = True

html_theme = "furo"
html_title = f"tanteo {release}"
html_copy_source = False
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"

FOLDER_LINK = re.compile(r"\[([^\]]*)\]\(((?!https?:|mailto:|#)[^)\s#]+)\)")


def without_folders(app: Any, name: str, text: list[str]) -> None:
    """Links to folders are for code hosts; a site has none to show."""
    page = Path(app.env.doc2path(name))

    def words(link: re.Match[str]) -> str:
        return link[1] if (page.parent / link[2]).is_dir() else link[0]

    text[0] = FOLDER_LINK.sub(words, text[0])


def draw_math(translator: Any, node: Any) -> None:
    """A formula as MathML."""
    display = "block" if node.tagname == "math_block" else "inline"
    translator.body.append(latex2mathml.converter.convert(node.astext(), display=display))
    raise nodes.SkipNode


BESIDE = "build/notebooks/04_the_paper_equation_by_equation"
"""Page whose formulas stand beside the code."""


def finish_page(app: Any, name: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    """Captions of the contents are headings of a level, as screen readers want it; formulas beside code."""
    level = 'role="heading" aria-level="2"'
    for part in ("body", "furo_navigation_tree"):
        if context.get(part):
            context[part] = context[part].replace('role="heading"', level)
    if name == BESIDE:
        context["body"] = f'<div class="beside">{context["body"]}</div>'


HOME = '<!doctype html><meta charset="utf-8"><title>tanteo</title><meta http-equiv="refresh" content="0; url=docs/index.html">'


def lead_home(app: Any, error: Exception | None) -> None:
    """Whoever opens the folder of the site comes to its first page."""
    if error is None and app.builder.name == "html":
        page = f'{HOME}<a href="docs/index.html">tanteo</a>\n'
        (Path(app.outdir) / "index.html").write_text(page, encoding="utf-8")


def setup(app: Any) -> None:
    """What the site needs beside its extensions."""
    app.connect("source-read", without_folders)
    app.connect("html-page-context", finish_page, priority=900)
    app.connect("build-finished", lead_home)
    app.add_html_math_renderer("mathml", (draw_math, None), (draw_math, None))
