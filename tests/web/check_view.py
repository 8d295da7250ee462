"""The report's view in a browser: installs the tools of package-lock.json, makes a report from a synthetic run, and runs check_view.mjs.

Usage: check_view.py WRITE_SYNTHETIC_REPORT WORK_FOLDER [CHROMIUM [OPTION]]; `check_view.py --types WEB_FOLDER WORK_FOLDER` checks the types of
the view's sources instead. Exits with 77 (skipped) where there is no node or browser, npm cannot fetch, or the program was built without the view.
"""
import fcntl
import pathlib
import shutil
import subprocess
import sys

SKIPPED = 77
HERE = pathlib.Path(__file__).parent


def skip(why):
    print(f"skipped: {why}")
    sys.exit(SKIPPED)


def install(work):
    """The packages of package-lock.json, once for as long as it is the same; tests that run at once wait for each other."""
    if not shutil.which("node") or not shutil.which("npm"):
        skip("node and npm are not installed")
    work.mkdir(parents=True, exist_ok=True)
    with open(work / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        wanted = (HERE / "package-lock.json").read_text()
        fetched = work / "fetched"
        shutil.copy(HERE / "check_view.mjs", work)
        if fetched.exists() and fetched.read_text() == wanted:
            return
        for name in ("package.json", "package-lock.json"):
            shutil.copy(HERE / name, work)
        command = ["npm", "ci", "--prefer-offline", "--ignore-scripts", "--no-audit", "--no-fund"]
        done = subprocess.run(command, cwd=work, capture_output=True, text=True, timeout=200)
        if done.returncode != 0:
            skip("npm ci failed: " + (done.stderr.strip().splitlines() or ["without a word"])[-1])
        fetched.write_text(wanted)


def check_types(web, work):
    """tsc, in a folder that has the sources and the types beside each other."""
    install(work)
    sources = work / "types"
    shutil.rmtree(sources, ignore_errors=True)
    shutil.copytree(web / "src", sources / "src")
    shutil.copy(web / "tsconfig.json", sources)
    sys.exit(subprocess.run(["node", str(work / "node_modules/typescript/bin/tsc"), "-p", "."], cwd=sources).returncode)


def check_view(writer, work, chromium=None, *options):
    if not chromium or chromium.endswith("NOTFOUND"):
        skip("no chromium here")
    install(work)
    run, pictures = work / "run", work / "pictures"
    shutil.rmtree(run, ignore_errors=True)
    pictures.mkdir(exist_ok=True)
    subprocess.run([writer, run], check=True)
    if 'id="view-host"' not in (run / "report.html").read_text(encoding="utf-8"):
        skip("the program was built without the view")
    command = ["node", "check_view.mjs", run / "report.html", chromium, HERE / "golden-view.png", pictures, *options]
    sys.exit(subprocess.run(command, cwd=work).returncode)


if __name__ == "__main__":
    if sys.argv[1] == "--types":
        check_types(pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3]))
    check_view(sys.argv[1], pathlib.Path(sys.argv[2]), *sys.argv[3:])
