"""Plain text of the program and of docstrings as reStructuredText."""

import re


def escape(text):
    """Text in which only `code` is markup."""
    parts = re.split(r"`([^`]+)`", text)
    out = []
    for i, part in enumerate(parts):
        out.append(f"\\ ``{part}``\\ " if i % 2 else re.sub(r"([\\*`|_])", r"\\\1", part))
    return "".join(out)


def heading(text, underline="="):
    return f"{text}\n{underline * max(4, len(text))}\n\n"


def indented(text, by=3):
    return "\n".join(" " * by + line if line.strip() else "" for line in text.splitlines())


def code(text, language="none"):
    return f".. code-block:: {language}\n\n{indented(text)}\n\n"


def toctree(names, options=("hidden",)):
    lines = "".join(f"   :{option}:\n" for option in options)
    return f".. toctree::\n{lines}\n" + "".join(f"   {name}\n" for name in names) + "\n"
