"""The documentation as a site: ``make docs``. The pages of the repository are the source; this adds the interface.

The source folder is the repository, so that links between pages, examples and the pages beside ``docs`` hold. Nothing
is fetched when a page is read: mathematics becomes MathML, which browsers draw themselves.
"""

from __future__ import annotations

import importlib
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
include_patterns = ["docs/**", "build/notebooks/*.rst", "build/api/*.rst", "*.md", "LICENSE"]
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

# decisions are listed by docs/README.md: in the contents of every page they would cost a third of the time
suppress_warnings = ["toc.not_included"]

highlight_language = "none"  # a block that names no language is a command or what it prints

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
    """Write a formula as MathML; a display formula scrolls in a narrow window."""
    block = node.tagname == "math_block"
    formula = latex2mathml.converter.convert(node.astext(), display="block" if block else "inline")
    translator.body.append(f'<div class="formula" tabindex="0">{formula}</div>' if block else formula)
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


HOME = (
    '<!doctype html><html lang="en"><meta charset="utf-8"><title>tanteo</title>'
    '<meta http-equiv="refresh" content="0; url=docs/index.html"><a href="docs/index.html">tanteo</a></html>\n'
)


def lead_home(app: Any, error: Exception | None) -> None:
    """Write a page in the folder of the site that redirects to its first page."""
    if error is None and app.builder.name == "html":
        (Path(app.outdir) / "index.html").write_text(HOME, encoding="utf-8")


INTERFACE = ROOT / "docs" / "api.rst"
PACKAGES = re.compile(r"^(tanteo[.\w]*)\n-+\n(.*?)(?=^tanteo[.\w]*\n-|\Z)", re.MULTILINE | re.DOTALL)
"""Sections of the interface: a package and what is shown of it."""


def write_package_pages(app: Any) -> None:
    """Write a page for each package of the interface, so that a search leads to it."""
    folder = ROOT / "build" / "api"
    folder.mkdir(parents=True, exist_ok=True)
    packages = {name for name, _ in PACKAGES.findall(INTERFACE.read_text(encoding="utf-8"))}
    for page in folder.glob("*.rst"):
        if page.stem not in packages:  # of an older layout
            page.unlink()
    for name, body in PACKAGES.findall(INTERFACE.read_text(encoding="utf-8")):
        page, text = folder / f"{name}.rst", f"{name}\n{'=' * len(name)}\n{body}"
        if not page.is_file() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")


def interface_contents(app: Any, name: str, text: list[str]) -> None:
    """List the packages on the page of the interface."""
    if name == "docs/api":
        names = [name for name, _ in PACKAGES.findall(text[0])]
        pages = "".join(f"   ../build/api/{name}\n" for name in names)
        lines = "".join(f"* :doc:`{name} <../build/api/{name}>`: {first_line(name)}\n" for name in names)
        text[0] = f"{PACKAGES.sub('', text[0])}\n{lines}\n.. toctree::\n   :hidden:\n\n{pages}"


def first_line(module: str) -> str:
    """Return the first line of a module's docstring."""
    return (importlib.import_module(module).__doc__ or "").split("\n", 1)[0]


def setup(app: Any) -> None:
    """Connect the functions of this file to Sphinx."""
    app.connect("builder-inited", write_package_pages)
    app.connect("source-read", without_folders)
    app.connect("source-read", interface_contents)
    app.connect("html-page-context", finish_page, priority=900)
    app.connect("build-finished", lead_home)
    app.add_html_math_renderer("mathml", (draw_math, None), (draw_math, None))
