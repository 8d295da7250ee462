"""Runs an example in the current folder; exit code 77 where matplotlib is missing."""

import importlib.util
import runpy
import sys

if importlib.util.find_spec("matplotlib") is None:
    print("skipped: no matplotlib (python3-matplotlib)")
    sys.exit(77)
runpy.run_path(sys.argv[1], run_name="__main__")
