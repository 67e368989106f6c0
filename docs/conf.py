"""The manual: Sphinx reads the Markdown pages of this folder. `make docs` builds it."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "extensions"))

from shm import __version__

project = "shm"
author = "the authors of shm"
copyright = author
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "drawn_math"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["examples", "extensions", "static", "trials/figures", "trials/real_cases"]

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
myst_dmath_double_inline = True

html_theme = "furo"
html_title = f"shm {__version__}"
html_math_renderer = "drawn"
html_show_copyright = False
html_copy_source = False
html_static_path = ["static"]

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
default_role = "code"
nitpicky = True
nitpick_ignore_regex = [("py:.*", ".*")]
suppress_warnings = ["myst.header"]
