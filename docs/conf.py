"""Settings of the documentation: ``python -m sphinx -W docs docs/_build``. Needs no network."""

import re
import sys
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import idm_sumo  # noqa: E402

project = "idm-sumo"
author = "The idm-sumo authors"
copyright = "2026, the idm-sumo authors"
version = release = idm_sumo.__version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx-mathjax-offline",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "examples"]
root_doc = "index"
templates_path = ["_templates"]

myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence"]
myst_heading_anchors = 3

autosummary_generate = True
autosummary_ignore_module_all = False
# The extra `rl` is not needed to read about it.
autodoc_mock_imports = [name for name in ("gymnasium", "stable_baselines3", "torch") if find_spec(name) is None]
autodoc_typehints = "none"  # the numpydoc sections say them
autodoc_member_order = "bysource"
numpydoc_show_class_members = False

# The tests run the examples; here they are only shown, which takes no time.
sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "plot_gallery": False,
    "filename_pattern": r"\.py$",
    "download_all_examples": False,
    "show_memory": False,
}

html_theme = "pydata_sphinx_theme"
html_title = f"idm-sumo {release}"
html_show_sourcelink = False
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_sidebars = {"effects": []}
html_theme_options = {
    "navigation_with_keys": False,
    "show_toc_level": 2,
    "secondary_sidebar_items": {"**": ["page-toc"], "effects": []},
}


def setup(app):
    """Leave out what scikit-learn adds to every estimator."""
    added = re.compile(r"set_\w+_request|get_metadata_routing")  # they refer to pages of scikit-learn's own
    app.connect(
        "autodoc-skip-member", lambda app, what, name, member, skip, options: skip or bool(added.fullmatch(name))
    )
