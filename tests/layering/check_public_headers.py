"""What the installed library shows: the headers that rooms name after HEADERS in their CMakeLists.txt.

Fails where a public header includes one of ours that is not public (it would not compile once installed), or shows
yaml-cpp, msgpack or nlohmann/json to who includes it (forward declarations, json_fwd.hpp, are allowed).
Usage: check_public_headers.py REPOSITORY
"""
import pathlib
import re
import sys

INCLUDE = re.compile(r'^\s*#\s*include\s+[<"]([^>"]+)[>"]', re.MULTILINE)
PRIVATE_LIBRARIES = ("yaml-cpp/", "msgpack", "nlohmann/")
ALLOWED = {"nlohmann/json_fwd.hpp"}


def public_headers(root):
    found = set()
    for file in sorted(root.glob("tileflight/*/*/CMakeLists.txt")):
        call = re.search(r"tileflight_room\((.*?)\)", file.read_text(), re.DOTALL)
        words = call[1].split() if call else []
        names = words[words.index("HEADERS") + 1:] if "HEADERS" in words else []
        found |= {f"{file.parent.relative_to(root)}/{name}" for name in names if name.endswith(".h")}
    return found


def faults(root):
    public = public_headers(root)
    found = []
    for header in sorted(public):
        path = root / header
        if not path.is_file():
            found.append(f"{header}: is named as a public header and does not exist")
            continue
        for included in INCLUDE.findall(path.read_text()):
            if included.startswith("tileflight/") and included not in public:
                found.append(f"{header}: is public and includes {included}, which is not")
            if included.startswith(PRIVATE_LIBRARIES) and included not in ALLOWED:
                found.append(f"{header}: is public and shows {included}")
    return found


def main(root):
    root = pathlib.Path(root)
    found = faults(root)
    print("\n".join(found) if found else f"{len(public_headers(root))} public headers stand alone")
    return 1 if found or not public_headers(root) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
