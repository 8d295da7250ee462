#!/usr/bin/env python3
"""Makes the archive's folder of a build, and checks that it takes no library from the system but those of glibc.

    check_archive.py SOURCES BUILD-FOLDER CMAKE FOLDER

FOLDER is made anew. That the archive works in an empty system is packaging/try-release's to show.
"""

import json
import pathlib
import platform
import re
import shutil
import subprocess
import sys

SKIPPED = 77
# The oldest glibc that the archive is promised to run with (packaging/bundle.py).
PROMISED = (2, 36)


def output(*command, **options) -> str:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, **options)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: exit {done.returncode}\n{done.stdout[-3000:]}{done.stderr[-3000:]}")
    return done.stdout


def main() -> int:
    sources, build, cmake, folder = (pathlib.Path(word) for word in sys.argv[1:5])
    for program in ("patchelf", "objdump", "dpkg-query"):
        if not shutil.which(program):
            print(f"skipped: no {program} here")
            return SKIPPED
    libc = platform.libc_ver()[1]
    if tuple(map(int, libc.split("."))) > PROMISED:
        print(f"skipped: glibc {libc} is newer than {'.'.join(map(str, PROMISED))}; the archive is made on Debian 12")
        return SKIPPED
    shutil.rmtree(folder, ignore_errors=True)
    output(cmake, "--install", build, "--component", "runtime", "--strip", "--prefix", folder)
    (folder / "libexec").mkdir()
    (folder / "bin/tileflight").rename(folder / "libexec/tileflight")
    shutil.copy(sources / "packaging/start", folder / "bin/tileflight")
    print(output(sys.executable, "-B", sources / "packaging/bundle.py", folder, "0.0.1"))

    moved = folder.parent / "archive moved elsewhere"
    shutil.rmtree(moved, ignore_errors=True)
    folder.rename(moved)
    resolved = [line.split("=>") for line in output("ldd", moved / "libexec/tileflight", env={"PATH": "/usr/bin:/bin"}).splitlines() if "=>" in line]
    assert len(resolved) > 100, resolved
    for name, place in resolved:
        of_glibc = re.match(r"\s*(ld-linux|lib(c|m|mvec|dl|rt|pthread|resolv|util)\.so)", name)
        assert of_glibc or place.strip().startswith(str(moved)), f"{name} is taken from{place}"
    alone = {"env": {"PATH": "/usr/bin:/bin", "HOME": str(moved)}, "cwd": moved}
    assert output(moved / "bin/tileflight", "--version", **alone).startswith("tileflight ")
    assert '"colmap"' in output(moved / "bin/tileflight", "systems", "--json", **alone)

    bill = json.loads((moved / "share/doc/tileflight/sbom.spdx.json").read_text())
    listed = {file["fileName"].removeprefix("./") for file in bill["files"]}
    assert {f"lib/{file.name}" for file in (moved / "lib").iterdir()} <= listed
    assert {"share/proj/proj.db", "share/tileflight/fonts/DejaVuSans.ttf"} <= listed
    for package in bill["packages"][1:]:
        assert (moved / "share/doc/tileflight/licences" / package["name"]).stat().st_size > 0, package["name"]
    shutil.rmtree(moved)
    return 0


if __name__ == "__main__":
    sys.exit(main())
