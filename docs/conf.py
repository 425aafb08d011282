"""Settings of the documentation site; CONTRIBUTING.md says how to build it.

Markdown, docstrings and comments stay as they read best in the sources; the functions below
translate what Sphinx would read otherwise.
"""

from __future__ import annotations

import inspect
import re
from importlib.metadata import version as installed_version
from pathlib import Path

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util.inspect import TypeAliasForwardRef

import tiltsim_controllers

project = "tiltsim"
author = project_copyright = "The tiltsim developers"
release = installed_version("tiltsim")
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
suppress_warnings = ["ref.python"]  # a name of several modules, written without its module

CONTROLLERS = Path(tiltsim_controllers.__file__).parent
INCLUDED = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
}

highlight_language = "none"  # output, where a page names no language
# Backticks in docstrings: a link where the name is on the site, else code.
default_role = "py:obj"
nitpick_ignore_regex = [("py:(class|obj)", ".*")]

myst_heading_anchors = 4  # as GitHub has them
myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]
nb_execution_mode = "cache"  # until the notebook changes, or build is removed
nb_execution_raise_on_error = True
nb_execution_in_temp = True
nb_execution_timeout = 180  # s, a cell; one compiles a gradient

add_module_names = False
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
ALIASES = ("ArrayLike", "Floats", "Pair", "Triple", "Quad", "Values", "Vector")
autodoc_type_aliases = {"npt.ArrayLike": "ArrayLike"} | {name: name for name in ALIASES}
TypeAliasForwardRef.__repr__ = lambda alias: alias.name  # inside of a list or tuple, too
FLOATS = r"[~\w.]*ndarray\[[^]]*\], [~\w.]*dtype\[[~\w.]*float64\]\]"  # in types from elsewhere
napoleon_attr_annotations = False  # the signature has them
napoleon_use_ivar = True
python_maximum_signature_line_length = 88
python_use_unqualified_type_names = True

html_theme = "furo"
pygments_dark_style = "a11y-high-contrast-dark"
html_title = "tiltsim"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"  # needs no script
html_copy_source = False
html_show_sphinx = False


def link_pages_outside(app, docname, source):
    """Lead links to pages outside of docs to the pages that include them."""
    for page, including in INCLUDED.items():
        source[0] = source[0].replace(f"](../{page}", f"]({including}")


def list_modules(app, docname, source):
    """Append the modules of a folder of tiltsim_controllers to its page of the API reference."""
    folder = CONTROLLERS / docname.removeprefix("api/")
    for file in sorted(folder.glob("[!_]*.py")) if docname.startswith("api/") else ():
        module = f"tiltsim_controllers.{folder.name}.{file.stem}"
        directive = f".. automodule:: {module}\n   :members:"
        source[0] += f"\n## {file.stem}\n\n```{{eval-rst}}\n{directive}\n```\n"


def describe_fields(app, what, name, obj, options, lines):
    """List the fields of a record; the comments beside them tell shape, unit and axes."""
    if what in ("attribute", "data"):
        lines.insert(0, "")  # else napoleon takes what is before a colon for a type
    if what != "class" or "Attributes:" in lines or not getattr(obj, "__annotations__", None):
        return
    try:
        source = inspect.getsource(obj)
    except OSError:  # made of a law's keys, which the page of the scenario lists
        return
    fields = re.findall(r"^    (\w+): .*?  # (.*)$", source, re.MULTILINE)
    if fields:
        lines += ["", "Attributes:", *(f"    {field}: {comment}" for field, comment in fields)]


def tidy_signature(app, what, name, obj, options, signature, returned):
    """Name the type of arrays, and show no tables of a scenario: their page lists all keys."""
    if hasattr(obj, "model_fields"):
        return "(...)", returned
    signature = signature and re.sub(FLOATS, "Floats", signature)
    returned = returned and re.sub(FLOATS, "Floats", returned)
    return signature, returned


def skip_described(app, what, name, obj, skip, options):
    """Leave out the entry of each field of a named tuple: `describe_fields` lists them."""
    return True if type(obj).__name__ == "_tuplegetter" else None


def link_unqualified(app, env, node, content):
    """Find a name of ours that is written without its module, if it is unique."""
    package, _, name = node["reftarget"].rpartition(".")
    if node["refdomain"] != "py" or (package and not package.startswith("tiltsim")):
        return None
    found = env.get_domain("py").find_obj(env, "", "", name, None, 1)
    found = [(full, entry) for full, entry in found if not entry.aliased]
    if len(found) != 1:
        return None
    docname, anchor = found[0][1].docname, found[0][1].node_id
    reference = nodes.reference("", "", content, internal=True)
    reference["refuri"] = f"{app.builder.get_relative_uri(node['refdoc'], docname)}#{anchor}"
    return reference


def mathml(writer, node):
    """Write a formula as MathML, which browsers show without a script and without the network."""
    block = isinstance(node, nodes.math_block)
    formula = tex2mathml(node.astext(), as_block=block)
    writer.body.append(f'<div class="math">{formula}</div>' if block else formula)
    raise nodes.SkipNode


def setup(app):
    """Connect the functions above."""
    app.add_html_math_renderer("mathml", (mathml, None), (mathml, None))
    app.connect("source-read", link_pages_outside)
    app.connect("source-read", list_modules)
    app.connect("autodoc-process-docstring", describe_fields, priority=400)
    app.connect("autodoc-process-signature", tidy_signature)
    app.connect("autodoc-skip-member", skip_described)
    app.connect("missing-reference", link_unqualified)
