"""Configuration of Sphinx for `make docs`. Sources: docs/*.md, and what site_builder writes to docs/generated/.

The site loads nothing from the network: the theme brings its own style sheets, scripts and search, and the fonts are
those of the reader's system.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[2] / "virtual_bus_tests"))

from site_builder import docstrings, modules, offline, pages, source_pages

project = "canbase"
release = modules.version()
html_title = f"canbase {release}"
copyright = "the canbase authors, Apache-2.0"  # noqa: A001  # the name that Sphinx reads

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.linkcode"]
exclude_patterns = ["site_builder"]
suppress_warnings = ["ref.python"]  # types in signatures whose short name several modules have

myst_heading_anchors = 4  # links to headings as on GitHub

autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "undoc-members": True, "show-inheritance": True}
add_module_names = False
toc_object_entries = False  # thousands of names in the navigation of every page made the build four times as long
linkcode_resolve = source_pages.link

html_theme = "furo"
html_static_path = ["theme"]
html_css_files = ["tables.css"]
html_copy_source = False
html_use_index = False


def setup(app: Any) -> None:
    """Writes the generated pages before Sphinx looks for sources, and the pages of the source code at the end."""
    pages.write(modules.ROOT)
    app.connect("autodoc-process-docstring", docstrings.as_restructured_text)
    app.connect("doctree-read", docstrings.without_builtins)
    app.connect("build-finished", _finish)


def _finish(app: Any, exception: Exception | None) -> None:
    if exception is None:
        source_pages.write(Path(app.outdir))
        (Path(app.outdir) / "_static" / "source.css").write_text(source_pages.styles(), encoding="utf-8")
        offline.check(Path(app.outdir))


autodoc_mock_imports = ["nicegui", "fastapi", "uvicorn"]
"""Of the pages in the browser: Sphinx imports modules twice, which NiceGUI does not take."""
