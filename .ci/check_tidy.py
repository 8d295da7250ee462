#!/usr/bin/env python3
"""Runs clang-tidy and prints what it finds, once each; exit 1 if there is anything.

  .ci/check_tidy.py BUILD --changed [--seconds N]   files that differ from the main branch (on main: from the commit before)
  .ci/check_tidy.py BUILD --all                     every file
  .ci/check_tidy.py BUILD FILE...                   these files, and sources of headers among them

BUILD is a configured build folder (build/ci). Its unity sources tell how each file is compiled; --all checks these sources
themselves, so that headers are read once for each room. .clang-tidy has the checks.
"""
import argparse
import json
import os
import re
import subprocess
import sys
import time
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FINDING = re.compile(r"^(/\S+?):(\d+):(\d+): (warning|error): (.*)$")
# More files of one room than this are checked together, as the room's unity source.
APART = 2


def git(*arguments):
    """Lines that git prints; None if it fails."""
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True)
    return done.stdout.split("\n")[:-1] if done.returncode == 0 else None


def base_of_change():
    """The commit where this branch left main; the commit before HEAD on main itself. None in a clone without history."""
    for main in ("main@{upstream}", "origin/main", "main"):
        base = git("merge-base", "HEAD", main)
        if base and base != git("rev-parse", "HEAD"):
            return base[0]
    before = git("rev-parse", "--verify", "--quiet", "HEAD~1")
    return before[0] if before else None


def changed_files():
    base = base_of_change()
    if base is None:
        print("clang-tidy: this clone has no earlier commit to compare with")
        return []
    names = git("diff", "--name-only", "--diff-filter=d", base) + git("ls-files", "--others", "--exclude-standard")
    return [ROOT / name for name in names if name.endswith((".cpp", ".h"))]


def read_units(build):
    """[(command, directory, unity source, sources in it)] of the build's compile commands."""
    units = []
    for entry in json.loads((build / "compile_commands.json").read_text()):
        source = Path(entry["file"])
        sources = [source]
        if source.name.startswith("unity_"):
            sources = [Path(name) for name in re.findall(r'^#include "(/.*\.cpp)"', source.read_text(), re.M)]
        sources = [one for one in sources if one.is_relative_to(ROOT) and not one.is_relative_to(build)]
        if sources:
            units.append((entry["command"], entry["directory"], source, sources))
    return units


def sources_of(files, units):
    """Source files, and for each header the source of its name, or else one that includes it, nearest first."""
    all_sources = [one for unit in units for one in unit[3]]
    found = []
    for file in files:
        if file.suffix == ".cpp":
            found.append(file)
            continue
        include = f'#include "{file.relative_to(ROOT)}"', f'#include "{file.name}"'
        near = sorted(all_sources, key=lambda one: (one != file.with_suffix(".cpp"), one.parent != file.parent))
        found += next(([one] for one in near if any(line in one.read_text() for line in include)), [])
    return set(found)


def jobs_of(files, units):
    """[(unit, file to check, files whose findings are printed)]; None for all findings."""
    wanted = sources_of(files, units)
    jobs = []
    for unit in units:
        mine = [one for one in unit[3] if one in wanted]
        if len(mine) > APART:
            jobs.append((unit, unit[2], files))
        else:
            jobs += [(unit, one, files) for one in mine]
    return jobs


def check(job, folder):
    """{(file, line, column, message)} of one file. Compiler warnings are left to the compilers."""
    (command, directory, source, sources), file, only = job
    command = re.sub(r"^\S*ccache ", "", command).replace(" -Werror", "").replace(str(source), str(file)) + " -w"
    place = folder / re.sub(r"\W", "_", str(file))
    place.mkdir(parents=True, exist_ok=True)
    (place / "compile_commands.json").write_text(
        json.dumps([{"directory": directory, "command": command, "file": str(file)}]))
    done = subprocess.run(["clang-tidy", "-p", place, f"--config-file={ROOT / '.clang-tidy'}", "--quiet", file],
                          capture_output=True, text=True)
    found = set()
    for line in done.stdout.split("\n"):
        match = FINDING.match(line)
        if match and (only is None or match[4] == "error" or Path(os.path.normpath(match[1])) in only):
            found.add((os.path.relpath(match[1], ROOT), int(match[2]), int(match[3]), match[5]))
    if done.returncode < 0:  # a fault of clang-tidy, not of the file
        if file == source and len(sources) > 1:
            return set().union(*(check(((*job[0][:3], [one]), one, only), folder) for one in sources))
        print(f"clang-tidy: crashed on {os.path.relpath(file, ROOT)}, which is left out", flush=True)
    elif done.returncode != 0 and not found:
        found.add((os.path.relpath(file, ROOT), 0, 0, "clang-tidy failed: " + done.stderr.strip().split("\n")[-1]))
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=Path)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--changed", action="store_true")
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no file after this time")
    options = parser.parse_args()

    # The versions of clang-tidy differ in their checks; Debian 12 has 14.
    version = re.search(r"version (\d+)", subprocess.run(["clang-tidy", "--version"], capture_output=True, text=True, check=True).stdout)
    if version is None or version[1] != "14":
        print(f"clang-tidy: not checked: this is version {version[1] if version else 'unknown'}, and .clang-tidy has the checks of 14")
        return 0

    units = read_units(options.build.resolve())
    files = changed_files() if options.changed else [file.resolve() for file in options.files]
    jobs = [(unit, unit[2], None) for unit in units] if options.all else jobs_of(files, units)
    findings = defaultdict(set)
    left_out = []
    end = time.monotonic() + options.seconds
    folder = options.build.resolve() / "clang-tidy"

    def work(job):
        if time.monotonic() > end:
            left_out.append(job)
            return set()
        return check(job, folder)

    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        for job, found in zip(jobs, pool.map(work, jobs)):
            for file, line, column, message in sorted(found - set().union(*findings.values())):
                print(f"{file}:{line}:{column}: {message}", flush=True)
                findings[job[1]].add((file, line, column, message))
    count = sum(map(len, findings.values()))
    print(f"clang-tidy: {count} findings in {len(jobs) - len(left_out)} translation units" +
          (f"; no time for {len(left_out)} more, which ./test --all checks" if left_out else ""))
    return 1 if count else 0


sys.exit(main())
