"""Configuration of the documentation, which ``sphinx-build -W -n docs docs/_build`` makes without a network."""

import radcal

project = "radcal"
author = "The radcal developers"
copyright = author  # noqa: A001 - Sphinx's name
version = release = radcal.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "numpydoc"]
exclude_patterns = ["_build"]
myst_heading_anchors = 3
nb_execution_mode = "force"  # the notebook holds no results
nb_execution_timeout = 300
nb_execution_raise_on_error = True
html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_title = f"radcal {release}"
html_show_copyright = False

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the sections of the docstrings give shapes and units
autosummary_generate = False
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

nitpicky = True
# names of other projects
nitpick_ignore_regex = [(r"py:.*", r"(?!\.|radcal\b).*")]
