"""Equations as MathML, which browsers draw themselves: no script, no font and no network is needed.

Pages write them as GitHub shows them: a fenced block ```math of LaTeX, or $…$ within a line; docutils converts it.
"""

import re

from docutils import nodes
from docutils.utils.math import latex2mathml
from sphinx.util import logging

try:
    from docutils.utils.math import MathError
except ImportError:  # docutils before 0.21 (Debian 12)
    MathError = SyntaxError

logger = logging.getLogger(__name__)


def mathml(node, is_block):
    try:
        if MathError is SyntaxError:
            return latex2mathml.tex2mathml(node.astext(), inline=not is_block)
        return latex2mathml.tex2mathml(node.astext(), as_block=is_block)
    except MathError as fault:
        logger.warning("equation not understood: %s: %s", fault, node.astext(), location=node)
        return ""


def visit_inline(translator, node):
    translator.body.append(mathml(node, False))
    raise nodes.SkipNode


def visit_block(translator, node):
    translator.body.append(f'<div class="equation">{mathml(node, True)}</div>\n')
    raise nodes.SkipNode


def read_fences(app, docname, source):
    if not re.search(r"^```math$", source[0], flags=re.MULTILINE):
        return  # elsewhere a dollar is a dollar
    parts = re.split(r"(^```.*?^```$|`[^`\n]*`)", source[0], flags=re.MULTILINE | re.DOTALL)
    for i in range(0, len(parts), 2):
        parts[i] = re.sub(r"\$([^$\n]+)\$", r"{math}`\1`", parts[i])
    source[0] = re.sub(r"^```math$", "```{math}", "".join(parts), flags=re.MULTILINE)


def setup(app):
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_block, None))
    app.config.html_math_renderer = "mathml"
    app.connect("source-read", read_fences)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
