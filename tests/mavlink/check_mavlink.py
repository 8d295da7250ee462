"""Our MAVLink against an independent codec (npm node-mavlink), both ways.

Usage: check_mavlink.py MAVLINK_EXCHANGE FOLDER_OF_THIS_TEST WORK_FOLDER
Exits with 77 (skipped) where there is no node, or npm cannot fetch the packages.
"""
import pathlib
import shutil
import subprocess
import sys

SKIPPED = 77


def skip(why):
    print(f"skipped: {why}")
    sys.exit(SKIPPED)


def install(source, work):
    """The packages of package-lock.json, once."""
    if not shutil.which("node") or not shutil.which("npm"):
        skip("node and npm are not installed")
    work.mkdir(parents=True, exist_ok=True)
    for name in ("package.json", "package-lock.json", "check_mavlink.mjs"):
        shutil.copy(source / name, work / name)
    if (work / "node_modules/node-mavlink").is_dir():
        return
    done = subprocess.run(["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund"], cwd=work, capture_output=True,
                          text=True, timeout=120)
    if done.returncode != 0:
        skip("npm ci failed: " + (done.stderr.strip().splitlines() or ["without a word"])[-1])


def main():
    exchange, source, work = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    install(source, work)
    done = subprocess.run(["node", "check_mavlink.mjs", exchange], cwd=work, capture_output=True, text=True, check=False)
    print(done.stdout + done.stderr)
    sys.exit(0 if done.returncode == 0 else 1)


main()
