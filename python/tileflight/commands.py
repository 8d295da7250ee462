"""The program's commands as functions, made from the program's own descriptions of its options.

A positional argument of a command is one of the function, an option `--truth-trajectory FILE` the keyword
`truth_trajectory=`; a list of numbers may be any sequence, a flag is True or False. `progress` is a callable
`(done, total, what)`, called every 20 ms at most. Ctrl-C ends a command within a step of its work, and nothing is half
written. Where a command prints a JSON object, the function returns it as a dictionary.
"""

from __future__ import annotations

import inspect as _inspect
import keyword as _keyword
import os as _os
import pathlib as _pathlib
from typing import Any, Callable

from . import _core

#: Servers, which run until a signal (`Simulator` does the same within the process), and a command for shells only.
_LEFT_OUT = {"serve", "play", "completion"}
#: Options of the terminal, which a function has no use for.
_TERMINAL = {"json", "quiet"}

Progress = Callable[[int, int, str], None]


def _find_program() -> str:
    """The program that was built with the module, for commands that start others (`study`, `odometry --system`)."""
    package = _pathlib.Path(__file__).parent
    built_with_it = [package / "bin" / "tileflight", package.parents[1] / "bin" / "tileflight"]  # wheel, build folder
    if package.parent.name == "dist-packages":  # Debian's package: PREFIX/lib/python3/dist-packages/tileflight
        built_with_it.append(package.parents[3] / "bin" / "tileflight")
    found = [str(program) for program in built_with_it if program.exists()]
    return _os.environ.get("TILEFLIGHT_BINARY") or (found[0] if found else "")


# A run reuses results of the same program only. Without a program, the module's file identifies it.
_core._set_program(_find_program() or _core.__file__)


def _parameter_name(option: dict[str, Any]) -> str:
    name = option["name"].lower().replace("-", "_").replace(" ", "_")
    return name + "_" if _keyword.iskeyword(name) else name


def _texts(option: dict[str, Any], value: Any) -> list[str]:
    """Returns the words of an option's value on a command line."""
    is_list = isinstance(value, (list, tuple)) or type(value).__module__ == "numpy" and getattr(value, "ndim", 0) > 0
    values = [_os.fspath(v) if isinstance(v, _os.PathLike) else str(v) for v in (value if is_list else [value])]
    if is_list and option["delimiter"]:
        return [option["delimiter"].join(values)]
    if is_list and not option["repeated"]:
        raise TypeError(f"{_parameter_name(option)} takes one value, not {len(values)}")
    return values


def _arguments(command: dict[str, Any], values: dict[str, Any]) -> list[str]:
    words = command["name"].split()
    positional = []
    for option in command["options"]:
        value = values.get(_parameter_name(option))
        if value is None or value is False:
            continue
        if option["positional"]:
            positional += _texts(option, value)
        elif option["is_flag"]:
            words.append("--" + option["name"])
        else:
            words += [f"--{option['name']}={text}" for text in _texts(option, value)]
    # Words after a bare -- are positional, even where they begin with a dash.
    return words + ["--"] + positional if positional else words


def _parameters(command: dict[str, Any]) -> list[_inspect.Parameter]:
    positional, keywords = [], []
    for option in command["options"]:
        if option["name"] in _TERMINAL:
            continue
        default = _inspect.Parameter.empty if option["required"] else (False if option["is_flag"] else None)
        kind = _inspect.Parameter.POSITIONAL_OR_KEYWORD if option["positional"] else _inspect.Parameter.KEYWORD_ONLY
        (positional if option["positional"] else keywords).append(
            _inspect.Parameter(_parameter_name(option), kind, default=default)
        )
    keywords.sort(key=lambda p: p.default is not _inspect.Parameter.empty)
    return positional + keywords + [_inspect.Parameter("progress", _inspect.Parameter.KEYWORD_ONLY, default=None)]


def _documentation(command: dict[str, Any]) -> str:
    lines = [command["description"].capitalize() + ".", ""]
    for option in command["options"]:
        if option["name"] not in _TERMINAL:
            lines.append(f"{_parameter_name(option)}: {option['description']}")
    return "\n".join(lines + ["progress: a callable (done, total, what)", "", "Raises InputError."])


def _make_function(command: dict[str, Any]) -> Callable[..., Any]:
    signature = _inspect.Signature(_parameters(command))

    def function(*args: Any, progress: Progress | None = None, **kwargs: Any) -> Any:
        values = signature.bind(*args, **kwargs).arguments
        return _core._run_command(_arguments(command, values), progress)

    function.__name__ = function.__qualname__ = command["name"].replace("scene ", "make_")  # "scene town": make_town
    function.__doc__ = _documentation(command)
    function.__signature__ = signature  # type: ignore[attr-defined]
    function.__module__ = __name__
    return function


__all__ = []
for _command in _core._commands():
    if _command["name"] not in _LEFT_OUT:
        _function = _make_function(_command)
        globals()[_function.__name__] = _function
        __all__.append(_function.__name__)
