"""Writes the type stubs of the extension module and of the commands, from the signatures that pybind11 puts into
docstrings and from the commands' own descriptions.

Usage: make_stubs.py FOLDER   (of the package, importable from its parent)
"""

import inspect
import pathlib
import re
import sys

HEADER = '''# Written by python/make_stubs.py.
from __future__ import annotations

import os
from typing import Any, Callable, Iterator, Optional, Sequence, Union

import numpy
from numpy.typing import ArrayLike, NDArray

'''
RENAMED = [
    (r"tileflight\._core\.", ""),
    (r"numpy\.ndarray\[numpy\.(\w+)(, flags\.\w+)*(\[[^\]]*\])?[^\]]*\]", r"NDArray[numpy.\1]"),
    (r"\bList\[", "list["),
    (r"\bDict\[", "dict["),
    (r"\bTuple\[", "tuple["),
    (r"list\[(\w+)\[\d+\]\]", r"Sequence[\1]"),
    (r"list\[(\w+)\]", r"Sequence[\1]"),
    (r"Annotated\[(\w+\[\w+\]), [^\]]*\]", r"\1"),
    (r"\bos\.PathLike\b", "Union[str, os.PathLike[str]]"),
    (r"\bobject\b", "Any"),
    (r"\bcapsule\b", "Any"),
    (r"= (<[^>]*>|PosixPath\([^)]*\)|\[[^\]]*\]|\{[^}]*\})", "= ..."),
    (r"\*args", "*args: Any"),
    (r"\*\*kwargs", "**kwargs: Any"),
]


def plain(signature):
    for old, new in RENAMED:
        signature = re.sub(old, new, signature)
    # An argument may be anything that numpy converts to an array.
    given, arrow, result = signature.rpartition(" -> ")
    given = re.sub(r"NDArray\[[\w.]+\]", "ArrayLike", given)
    return given + arrow + result


def documented(indent, doc):
    return [f'{indent}    """{doc}"""'] if doc else []


def function_stub(name, function, indent=""):
    signature, _, doc = (function.__doc__ or "").partition("\n")
    if not signature.startswith(name + "("):
        return [f"{indent}def {name}(*args: Any, **kwargs: Any) -> Any: ..."]
    lines = [f"{indent}def {plain(signature)}:"] + documented(indent, doc.strip())
    return lines + [f"{indent}    ..."]


def property_stub(name, member):
    doc = (member.__doc__ or "").strip()
    found = re.search(r"-> (.+)", (getattr(member.fget, "__doc__", "") or "").strip().split("\n")[0])
    kind = plain("x() -> " + found[1]).rpartition(" -> ")[2] if found else "Any"
    return ["    @property", f"    def {name}(self) -> {kind}:"] + documented("    ", doc) + ["        ..."]


def class_stub(name, kind):
    bases = [base.__name__ for base in kind.__bases__ if base.__module__ == "builtins" and base is not object]
    base = f"({bases[0]})" if bases and not bases[0].startswith("pybind11") else ""
    lines = [f"class {name}{base}:"] + documented("", (kind.__doc__ or "").strip())
    for member_name, member in sorted(vars(kind).items()):
        if isinstance(member, property):
            lines += property_stub(member_name, member)
        elif member_name in ("__init__", "__len__", "__iter__", "__next__", "__enter__", "__exit__") or (
            callable(getattr(kind, member_name)) and not member_name.startswith("_")
        ):
            if isinstance(member, staticmethod):
                lines.append("    @staticmethod")
            lines += function_stub(member_name, getattr(kind, member_name), "    ")
    return lines + ["    ..."]


def core_stub(core):
    lines = []
    for name, member in sorted(vars(core).items()):
        if name.startswith("__") and name != "__version__":
            continue
        if inspect.isclass(member):
            lines += class_stub(name, member)
        elif callable(member):
            lines += function_stub(name, member)
        else:
            lines.append(f"{name}: {type(member).__name__}")
        lines.append("")
    return HEADER + "\n".join(lines)


def command_stub(commands):
    lines = ["Progress = Callable[[int, int, str], None]", "Value = Union[str, os.PathLike[str], int, float, Sequence[Any]]", ""]
    for name in sorted(commands.__all__):
        function = getattr(commands, name)
        parameters, starred = [], False
        for parameter in inspect.signature(function).parameters.values():
            if parameter.kind is parameter.KEYWORD_ONLY and not starred:
                parameters.append("*")
                starred = True
            is_flag = parameter.default is False
            kind = "Optional[Progress]" if parameter.name == "progress" else "bool" if is_flag else "Optional[Value]"
            kind = "Value" if parameter.default is parameter.empty else kind
            default = "" if parameter.default is parameter.empty else f" = {parameter.default}"
            parameters.append(f"{parameter.name}: {kind}{default}")
        lines.append(f"def {name}({', '.join(parameters)}) -> Any:")
        lines += documented("", function.__doc__.replace("\n", "\n    "))
        lines += ["    ...", ""]
    return HEADER + "\n".join(lines)


def main():
    folder = pathlib.Path(sys.argv[1])
    sys.path.insert(0, str(folder.parent))
    from tileflight import _core, commands

    for name, text in (("_core", core_stub(_core)), ("commands", command_stub(commands))):
        compile(text, name + ".pyi", "exec")
        (folder / f"{name}.pyi").write_text(text)


if __name__ == "__main__":
    main()
