"""`python3 -m tileflight COMMAND` is the program that came with the package."""

import os
import sys

from . import commands


def main() -> None:
    program = commands._find_program()
    if not program:
        sys.exit("tileflight: the program is not beside the package; name its file in TILEFLIGHT_BINARY")
    os.execv(program, [program, *sys.argv[1:]])


if __name__ == "__main__":
    main()
