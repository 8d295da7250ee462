"""Sphinx settings of the documentation. docs/site/build_site.py copies the pages to the build folder, adds the generated
ones and runs Sphinx there: `cmake --build --preset ci --target site`."""

import os
import sys

sys.path.insert(0, os.path.join(os.environ["TILEFLIGHT_DOCS"], "site"))

project = "tileflight"
author = "the tileflight authors"
copyright = "the tileflight authors, Apache-2.0"
version = release = os.environ.get("TILEFLIGHT_VERSION", "")

extensions = ["myst_parser", "math_as_mathml"]
root_doc = "index"
exclude_patterns = ["files"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}

# Anchors of headings as GitHub makes them, so that links work in both places.
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence", "deflist"]

# Names in signatures are links where they are of this package; those of numpy and the standard library are text.
nitpick_ignore_regex = [(r"py:.*", r"(?!tileflight\b).*")]
add_module_names = False
python_use_unqualified_type_names = True

html_theme = "furo"
html_title = "tileflight"
html_static_path = [os.environ["TILEFLIGHT_DOCS"] + "/site/static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = False
html_last_updated_fmt = None  # the same sources give the same bytes
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0b5c7a", "color-brand-content": "#0b5c7a"},
    "dark_css_variables": {"color-brand-primary": "#6cc3e0", "color-brand-content": "#6cc3e0"},
}
pygments_style = "friendly"
pygments_dark_style = "monokai"
highlight_language = "none"
smartquotes = False  # quotes in options and messages are typed as they stand
