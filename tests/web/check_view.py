"""The report's view in a browser: installs the tools of package-lock.json, makes a report from a synthetic run, and runs check_view.mjs.

Usage: check_view.py WRITE_SYNTHETIC_REPORT WORK_FOLDER [CHROMIUM [OPTION]]; `check_view.py --types WEB_FOLDER WORK_FOLDER` checks the types of
the view's sources instead. Exits with 77 (skipped) where there is no node or browser, npm cannot fetch, or the program was built without the view.
"""
import pathlib
import shutil
import subprocess
import sys

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
from npm_packages import install, skip  # noqa: E402


def check_types(web, work):
    """tsc, in a folder that has the sources and the types beside each other."""
    install(HERE, work, "check_view.mjs")
    sources = work / "types"
    shutil.rmtree(sources, ignore_errors=True)
    shutil.copytree(web / "src", sources / "src")
    shutil.copy(web / "tsconfig.json", sources)
    sys.exit(subprocess.run(["node", str(work / "node_modules/typescript/bin/tsc"), "-p", "."], cwd=sources).returncode)


def check_view(writer, work, chromium=None, *options):
    if not chromium or chromium.endswith("NOTFOUND"):
        skip("no chromium here")
    install(HERE, work, "check_view.mjs")
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
