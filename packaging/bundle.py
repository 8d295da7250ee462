#!/usr/bin/env python3
"""Puts the shared libraries and the data of a program into its folder, so that it runs without the system's packages.

    bundle.py FOLDER VERSION

FOLDER holds `libexec` or `bin` with programs, or Python modules. Added are `lib` (all libraries but those of glibc),
`share/proj`, `share/tileflight/fonts`, `share/doc/tileflight/licences` (of each Debian package that something was taken from) and
`share/doc/tileflight/sbom.spdx.json` (SPDX 2.3). Needed besides Debian's base: patchelf, binutils.
"""

import datetime
import hashlib
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys

# These belong to the kernel's side of a system: they must be those of the machine on which the program runs.
OF_GLIBC = re.compile(r"(ld-linux.*|lib(c|m|mvec|dl|rt|pthread|resolv|util|anl|nsl|BrokenLocale|nss_.*))\.so\.\d+$")
FONTS = ["DejaVuSans.ttf", "DejaVuSans-Bold.ttf"]
OLDEST_GLIBC = (2, 36)


def output(*command) -> str:
    return subprocess.run([str(word) for word in command], capture_output=True, text=True, check=True).stdout


def is_elf(file: pathlib.Path) -> bool:
    with file.open("rb") as stream:
        return stream.read(4) == b"\x7fELF"


def libraries_of(file: pathlib.Path) -> dict[str, pathlib.Path]:
    """The libraries that the loader finds for a file, of all depths, by the name that is asked for."""
    found = {}
    for line in output("ldd", file).splitlines():
        name, arrow, place = (*line.split(), "", "")[:3]
        if arrow != "=>":
            continue
        if place == "not":
            sys.exit(f"bundle.py: {file}: the library {name} is not on this system")
        if not OF_GLIBC.match(name):
            found[name] = pathlib.Path(place)
    return found


def oldest_glibc(file: pathlib.Path) -> tuple[int, int]:
    needed = re.findall(r"GLIBC_(\d+)\.(\d+)", output("objdump", "-T", file))
    return max(((int(major), int(minor)) for major, minor in needed), default=(2, 0))


def packages_of_files() -> dict[str, str]:
    """The Debian package of each installed file."""
    owners = {}
    for listing in pathlib.Path("/var/lib/dpkg/info").glob("*.list"):
        owners.update(dict.fromkeys(listing.read_text().splitlines(), listing.stem))
    return owners


def package_of(file: pathlib.Path, owners: dict[str, str]) -> str:
    """The loader names files by /lib, dpkg some of them by /usr/lib, and the other way round."""
    for place in (str(file), str(file.resolve())):
        for name in (place, "/usr" + place, place.removeprefix("/usr")):
            if name in owners:
                return owners[name]
    sys.exit(f"bundle.py: no Debian package has the file {file}")


def sbom(program: str, version: str, taken: dict[str, list[pathlib.Path]], folder: pathlib.Path) -> dict:
    made = datetime.datetime.fromtimestamp(int(os.environ.get("SOURCE_DATE_EPOCH", 0)), datetime.timezone.utc)
    packages = [{"SPDXID": "SPDXRef-tileflight", "name": "tileflight", "versionInfo": version, "licenseDeclared": "Apache-2.0",
                 "licenseConcluded": "NOASSERTION", "copyrightText": "NOASSERTION", "downloadLocation": "NOASSERTION",
                 "filesAnalyzed": False}]
    files, relations = [], [{"spdxElementId": "SPDXRef-DOCUMENT", "relationshipType": "DESCRIBES", "relatedSpdxElement": "SPDXRef-tileflight"}]
    for name in sorted(taken):
        package_version, source, source_version = output(
            "dpkg-query", "-W", "-f", "${Version}\t${source:Package}\t${source:Version}", name).split("\t")
        plain = name.split(":")[0]
        identifier = "SPDXRef-" + re.sub(r"[^A-Za-z0-9.-]", "-", plain)
        packages.append({
            "SPDXID": identifier, "name": plain, "versionInfo": package_version, "supplier": "Organization: Debian",
            "sourceInfo": f"built from the Debian source package {source} {source_version}",
            "licenseDeclared": "NOASSERTION", "licenseConcluded": "NOASSERTION", "copyrightText": "NOASSERTION",
            "comment": f"licences: share/doc/tileflight/licences/{plain}", "downloadLocation": "NOASSERTION", "filesAnalyzed": False,
            "externalRefs": [{"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl",
                              "referenceLocator": f"pkg:deb/debian/{plain}@{package_version.replace('+', '%2B').replace(':', '%3A')}?arch=amd64"}]})
        relations.append({"spdxElementId": "SPDXRef-tileflight", "relationshipType": "CONTAINS", "relatedSpdxElement": identifier})
        for file in sorted(taken[name]):
            inner = str(file.relative_to(folder))
            file_identifier = "SPDXRef-File-" + re.sub(r"[^A-Za-z0-9.-]", "-", inner)
            files.append({"SPDXID": file_identifier, "fileName": "./" + inner, "licenseConcluded": "NOASSERTION", "copyrightText": "NOASSERTION",
                          "checksums": [{"algorithm": "SHA256", "checksumValue": hashlib.sha256(file.read_bytes()).hexdigest()},
                                        {"algorithm": "SHA1", "checksumValue": hashlib.sha1(file.read_bytes()).hexdigest()}]})
            relations.append({"spdxElementId": identifier, "relationshipType": "CONTAINS", "relatedSpdxElement": file_identifier})
    return {"spdxVersion": "SPDX-2.3", "dataLicense": "CC0-1.0", "SPDXID": "SPDXRef-DOCUMENT", "name": f"{program}-{version}",
            "documentNamespace": f"https://tileflight.invalid/spdx/{program}-{version}",
            "creationInfo": {"created": made.strftime("%Y-%m-%dT%H:%M:%SZ"), "creators": ["Tool: tileflight packaging/bundle.py"]},
            "packages": packages, "files": files, "relationships": relations}


def main() -> None:
    folder = pathlib.Path(sys.argv[1]).resolve()
    version = sys.argv[2]
    programs = [file for file in folder.rglob("*") if file.is_file() and not file.is_symlink() and is_elf(file)]
    if not programs:
        sys.exit(f"bundle.py: {folder} holds no program")
    owners = packages_of_files()
    taken: dict[str, list[pathlib.Path]] = {}

    def take(source: pathlib.Path, target: pathlib.Path) -> None:
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source.resolve(), target)
        taken.setdefault(package_of(source, owners), []).append(target)

    needed = {name: place for program in programs for name, place in libraries_of(program).items()}
    for name, place in needed.items():
        take(place, folder / "lib" / name)
        (folder / "lib" / name).chmod(0o755)
    for file in pathlib.Path("/usr/share/proj").iterdir():
        if file.is_file():
            take(file, folder / "share/proj" / file.name)
    for font in FONTS:
        take(pathlib.Path("/usr/share/fonts/truetype/dejavu") / font, folder / "share/tileflight/fonts" / font)

    for program in programs:
        up = pathlib.PurePath(os.path.relpath(folder / "lib", program.parent))
        subprocess.run(["patchelf", "--set-rpath", f"$ORIGIN/{up}", program], check=True)
    for name in needed:
        subprocess.run(["patchelf", "--set-rpath", "$ORIGIN", folder / "lib" / name], check=True)
    for file in programs + [folder / "lib" / name for name in needed]:
        if oldest_glibc(file) > OLDEST_GLIBC:
            sys.exit("bundle.py: %s needs glibc %d.%d; the oldest that is promised is %d.%d" % (file, *oldest_glibc(file), *OLDEST_GLIBC))

    licences = folder / "share/doc/tileflight/licences"
    licences.mkdir(parents=True, exist_ok=True)
    for name in taken:
        plain = name.split(":")[0]
        shutil.copyfile(f"/usr/share/doc/{plain}/copyright", licences / plain)
    for common in pathlib.Path("/usr/share/common-licenses").iterdir():  # which those files refer to
        if not common.is_symlink():
            shutil.copyfile(common, licences / f"common-{common.name}")
    (folder / "share/doc/tileflight/sbom.spdx.json").write_text(json.dumps(sbom(folder.name, version, taken, folder), indent=1) + "\n")
    print(f"{folder.name}: {len(needed)} libraries of {len(taken)} packages")


if __name__ == "__main__":
    main()
