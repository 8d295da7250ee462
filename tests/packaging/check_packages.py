#!/usr/bin/env python3
"""Makes the Debian packages of a build, asks lintian about them, and uses what they hold from another folder.

    check_packages.py BUILD-FOLDER CPACK FOLDER PYTHON

FOLDER is made anew. That the packages install into an empty system is packaging/try-packages' to show.
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys

SKIPPED = 77
PACKAGES = {"tileflight", "tileflight-dev", "python3-tileflight", "tileflight-examples"}


def output(*command, **options) -> str:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, **options)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: exit {done.returncode}\n{done.stdout[-3000:]}{done.stderr[-3000:]}")
    return done.stdout


def files_of(package: pathlib.Path) -> set[str]:
    listed = (line.split(maxsplit=5) for line in output("dpkg-deb", "-c", package).splitlines())
    return {words[5].removeprefix(".") for words in listed if not words[0].startswith("d")}


def check_contents(files: dict[str, set[str]], program: pathlib.Path) -> None:
    names = sorted(files)
    for i, one in enumerate(names):
        for other in names[i + 1:]:
            assert not files[one] & files[other], f"{one} and {other} both hold {sorted(files[one] & files[other])[:3]}"
    for name in names:
        assert {f"/usr/share/doc/{name}/copyright", f"/usr/share/doc/{name}/changelog.gz"} <= files[name], name
    listed = output(program, "--help").split("Subcommands:")[1]
    commands = re.findall(r"^  (\w+)", listed, re.MULTILINE)
    assert len(commands) >= 18, commands
    for command in commands:
        assert f"/usr/share/man/man1/tileflight-{command}.1.gz" in files["tileflight"], f"no manual page of {command}"
    assert any(name.endswith("libtileflight_odometry.a") for name in files["tileflight-dev"])
    assert "/usr/include/tileflight/slam/odometry/odometry.h" in files["tileflight-dev"]
    assert "/usr/lib/python3/dist-packages/tileflight/_core.pyi" in files["python3-tileflight"]
    examples = {name.split("/examples/")[1] for name in files["tileflight-examples"] if "/examples/" in name}
    assert {"stadium.yaml", "consumer/CMakeLists.txt", "foxglove/play.json", "python/learn_navigation.py"} <= examples, examples


def use_extracted(root: pathlib.Path, python: str) -> None:
    """Program and module find each other and the adapters, with nothing of the build folder in reach."""
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(root), "PYTHONPATH": str(root / "usr/lib/python3/dist-packages"),
                   "PYTHONDONTWRITEBYTECODE": "1"}
    there = {"env": environment, "cwd": root}
    version = output(root / "usr/bin/tileflight", "--version", **there).splitlines()[0]
    assert '"colmap"' in output(root / "usr/bin/tileflight", "systems", "--json", **there)
    said = output(python, "-c", "import tileflight; print(tileflight.__file__); print('tileflight', tileflight.__version__);"
                                "print(tileflight.commands._find_program())", **there).splitlines()
    assert said[0].startswith(str(root)), said
    assert said[1] == version, said
    assert said[2] == str(root / "usr/bin/tileflight"), said


def main() -> int:
    build, cpack, folder, python = pathlib.Path(sys.argv[1]), sys.argv[2], pathlib.Path(sys.argv[3]), sys.argv[4]
    for program in ("dpkg-deb", "dpkg-shlibdeps", "lintian"):
        if not shutil.which(program):
            print(f"skipped: no {program} here")
            return SKIPPED
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    # Packages for users are compressed by xz, which takes most of the time and is not what is tested.
    output(cpack, "-G", "DEB", "-B", folder, "-D", "CPACK_DEBIAN_COMPRESSION_TYPE=gzip", cwd=build)
    packages = {package.name.split("_")[0]: package for package in folder.glob("*.deb")}
    assert set(packages) == PACKAGES, packages
    print(output("lintian", "--allow-root", "--fail-on", "error,warning", *packages.values()))
    check_contents({name: files_of(package) for name, package in packages.items()}, build / "bin/tileflight")
    root = folder / "root"
    for package in packages.values():
        output("dpkg-deb", "-x", package, root)
    use_extracted(root, python)
    depends = output("dpkg-deb", "-f", packages["tileflight"], "Depends")
    assert re.search("libembree[34]", depends) and "libtbb12" in depends, depends
    shutil.rmtree(folder)
    print("4 packages checked")
    return 0


if __name__ == "__main__":
    os.umask(0o022)
    sys.exit(main())
