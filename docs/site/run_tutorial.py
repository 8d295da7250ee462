"""Follows the tutorial's first half in an empty folder: its files are written, its commands run, in order.

    run_tutorial.py TUTORIAL.md PROGRAM [COMMAND FOLDER]

COMMAND is one that was run already, for several tests: its last word is copied from FOLDER, which it wrote.
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

END = "## Your own place"


def main(page, program, made=None, made_folder=None):
    text, found, _ = pathlib.Path(page).read_text(encoding="utf-8").partition(END)
    if not found:
        sys.exit(f"run_tutorial: no heading {END!r}")
    environment = {**os.environ, "PATH": f"{pathlib.Path(program).resolve().parent}:{os.environ['PATH']}"}
    commands = 0
    with tempfile.TemporaryDirectory() as folder:
        for kind, block in re.findall(r"^```(\w+)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
            if kind == "yaml":
                name = re.match(r"# ([\w.-]+)\n", block)
                if not name:
                    sys.exit(f"run_tutorial: a file without a name: {block[:60]!r}")
                pathlib.Path(folder, name[1]).write_text(block, encoding="utf-8")
            elif kind == "sh":
                for line in block.splitlines():
                    print(f"$ {line}", flush=True)
                    if line == made:
                        shutil.copytree(made_folder, pathlib.Path(folder, line.split()[-1]))
                        made = None
                    else:
                        subprocess.run(line, shell=True, cwd=folder, env=environment, check=True)
                    commands += 1
        if made:
            sys.exit(f"run_tutorial: {made!r} is no command of the tutorial")
        if commands < 9 or not pathlib.Path(folder, "run", "report.html").stat().st_size:
            sys.exit("run_tutorial: the tutorial has lost commands, or made no report")


if __name__ == "__main__":
    main(*sys.argv[1:])
