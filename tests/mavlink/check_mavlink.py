"""Our MAVLink against an independent codec (npm node-mavlink), both ways.

Usage: check_mavlink.py MAVLINK_EXCHANGE FOLDER_OF_THIS_TEST WORK_FOLDER
Exits with 77 (skipped) where there is no node, or npm cannot fetch the packages.
"""
import pathlib
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))
from npm_packages import install  # noqa: E402


def main():
    exchange, source, work = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    install(source, work, "check_mavlink.mjs")
    done = subprocess.run(["node", "check_mavlink.mjs", exchange], cwd=work, capture_output=True, text=True, check=False)
    print(done.stdout + done.stderr)
    sys.exit(0 if done.returncode == 0 else 1)


main()
