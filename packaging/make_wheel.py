#!/usr/bin/env python3
"""Packs a folder as a wheel for the Python versions whose modules it holds.

    make_wheel.py PACKAGE VERSION OUT

PACKAGE is the folder `tileflight` with everything in it (bundle.py); its modules `_core.cpython-311-….so` and so on decide which
Python versions it requires. The file's name allows every Python 3, so that pip names the versions to those who have another one.
Prints the wheel's name. The same files give the same bytes.
"""

import base64
import hashlib
import pathlib
import re
import sys
import zipfile

PLATFORM = "manylinux_2_36_x86_64"


def main() -> None:
    package, version, out = pathlib.Path(sys.argv[1]), sys.argv[2], pathlib.Path(sys.argv[3])
    checkout = pathlib.Path(__file__).parents[1]
    minors = sorted(int(re.search(r"cpython-3(\d+)", file.name)[1]) for file in package.glob("_core.cpython-3*.so"))
    if not minors:
        sys.exit(f"make_wheel.py: {package} holds no module")
    required = [f">=3.{minors[0]}", f"<3.{minors[-1] + 1}"] + [f"!=3.{minor}.*" for minor in range(minors[0], minors[-1]) if minor not in minors]
    setup = (checkout / "setup.py").read_text()
    tag = f"py3-none-{PLATFORM}"
    information = f"tileflight-{version}.dist-info"
    files = {f"tileflight/{file.relative_to(package)}": file for file in sorted(package.rglob("*"))
             if file.is_file() and "__pycache__" not in file.parts}
    made = {
        f"{information}/METADATA":
            f"Metadata-Version: 2.1\nName: tileflight\nVersion: {version}\nLicense: Apache-2.0\n"
            f"Summary: {re.search('description=.(.*).,', setup)[1]}\n"
            + "".join(f"Classifier: Programming Language :: Python :: 3.{minor}\n" for minor in minors)
            + f"Requires-Python: {','.join(required)}\nRequires-Dist: numpy\nDescription-Content-Type: text/markdown\n\n"
            + (checkout / "README.md").read_text(),
        f"{information}/WHEEL":
            "Wheel-Version: 1.0\nGenerator: tileflight packaging/make_wheel.py\nRoot-Is-Purelib: false\n"
            f"Tag: {tag}\n",
        f"{information}/entry_points.txt": "[console_scripts]\ntileflight = tileflight.__main__:main\n",
        f"{information}/LICENSE": (checkout / "LICENSE").read_text(),
    }
    record = ""
    wheel = out / f"tileflight-{version}-{tag}.whl"
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, source in [*files.items(), *made.items()]:
            data = source.encode() if isinstance(source, str) else source.read_bytes()
            executable = not isinstance(source, str) and source.stat().st_mode & 0o100
            entry = zipfile.ZipInfo(name, (2026, 1, 1, 0, 0, 0))
            entry.external_attr = (0o100755 if executable else 0o100644) << 16
            archive.writestr(entry, data, zipfile.ZIP_DEFLATED, 9)
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            record += f"{name},sha256={digest},{len(data)}\n"
        entry = zipfile.ZipInfo(f"{information}/RECORD", (2026, 1, 1, 0, 0, 0))
        entry.external_attr = 0o100644 << 16
        archive.writestr(entry, record + f"{information}/RECORD,,\n")
    print(wheel.name)


if __name__ == "__main__":
    main()
