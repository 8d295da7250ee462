#!/usr/bin/env python3
"""Manual pages of the program and of each command, made by help2man from `--help`.

    make_man_pages.py PROGRAM VERSION FOLDER

writes FOLDER/tileflight.1, FOLDER/tileflight-render.1 and so on.
"""

import os
import pathlib
import re
import subprocess
import sys


def help_text(program: pathlib.Path, command: str) -> str:
    return subprocess.run([program, *command.split(), "--help"], capture_output=True, text=True, check=True).stdout


def subcommands(text: str) -> list[str]:
    """Names in the list under "Subcommands:"."""
    match = re.search(r"^Subcommands:\n((?:  .*\n|\n(?=  ))+)", text, re.MULTILINE)
    return re.findall(r"^  (\S+)", match[1], re.MULTILINE) if match else []


def commands_of(program: pathlib.Path, command: str = "") -> list[str]:
    """The program itself (""), its commands and their parts ("scene stadium")."""
    below = [f"{command} {name}".strip() for name in subcommands(help_text(program, command))]
    return [command] + [name for part in below for name in commands_of(program, part)]


def man_page(program: pathlib.Path, command: str, version: str, others: list[str]) -> str:
    description = help_text(program, command).splitlines()[0].rstrip(".")
    call = f"tileflight {command}".strip()
    page = subprocess.run(
        ["help2man", "--no-info", "--name", description, "--version-string", version, call],
        env={**os.environ, "PATH": f"{program.parent}:{os.environ['PATH']}"},
        capture_output=True, text=True, check=True,
    ).stdout
    name = call.replace(" ", "-")
    page = re.sub(r'^\.TH \S+ "1" ("[^"]*") "[^"]*"', rf'.TH {name.upper()} "1" \1 "tileflight {version}"', page, flags=re.M)
    page = page.replace(f".SH NAME\n{call} \\-", f".SH NAME\n{name} \\-")
    see = ", ".join(f".BR {other.replace(' ', '-')} (1)" for other in others if other != call)
    return page + ".SH SEE ALSO\n" + see.replace(", .BR", ",\n.BR") + "\n"


def main() -> None:
    program, version, folder = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2], pathlib.Path(sys.argv[3])
    folder.mkdir(parents=True, exist_ok=True)
    commands = commands_of(program)
    for command in commands:
        below = [f"tileflight {c}" for c in commands if c] if not command else ["tileflight"]
        page = man_page(program, command, version, below)
        (folder / (f"tileflight {command}".strip().replace(" ", "-") + ".1")).write_text(page)


if __name__ == "__main__":
    main()
