"""What keeps the house in order beyond its include edges: rooms of one purpose stay small, no edge exists for one
header alone, and comments name what exists.

Reads docs/architecture.md, so that the document and the rule cannot differ:
- a room has at most LARGEST units (a header with its source; headers for tests, test_*.h and synthetic_*.h, apart);
- where one unit of a room alone uses one header of another room, which nothing else that it uses would bring along, the
  edge needs a line `- `a` → `b`: reason` there, and such a line without such an edge is a fault, too;
- a file (`x.h`, `y.cpp`, `z.md`) or function (`name()`) that a comment names is somewhere in the repository, and so are
  the files that a document names or links (the functions of docs/algorithms.md: tests/docs).
Usage: check_rooms.py REPOSITORY
"""
import collections
import pathlib
import re
import subprocess
import sys

LARGEST = 32
INCLUDE = re.compile(r'^\s*#\s*include\s+"tileflight/([a-z_0-9]+)/([a-z_0-9]+)\.h"')
ALONE = re.compile(r"^- `([a-z_0-9]+)` → `([a-z_0-9]+)`:")
FILE = re.compile(r"(?<![<\w/.*{])([a-z_0-9]+\.(?:h|cpp|md|py|ts|cmake))\b")
FUNCTION = re.compile(r"(?<![\w:.>~])((?:[a-z_]+::)*)([A-Za-z_]\w*)\(\)")
OUTSIDE = {"std", "cv", "numpy"}  # namespaces of others


def is_for_tests(file):
    return file.stem.endswith("_test") or file.stem.startswith(("test_", "synthetic_"))


def rooms(root):
    return sorted(p for p in (root / "tileflight").iterdir() if p.is_dir())


def too_large(root):
    found = []
    for room in rooms(root):
        units = {f.stem for f in room.iterdir() if f.suffix == ".h" and not is_for_tests(f)}
        if len(units) > LARGEST:
            found.append(f"tileflight/{room.name}: {len(units)} units, at most {LARGEST}: it has two purposes")
    return found


def edges(root):
    """(room, other room) -> set of (unit that includes, header of the other); tests apart."""
    used = collections.defaultdict(set)
    for room in rooms(root):
        for file in room.iterdir():
            if file.suffix not in (".h", ".cpp") or is_for_tests(file):
                continue
            for line in file.read_text().splitlines():
                match = INCLUDE.match(line)
                if match and match[1] != room.name:
                    used[room.name, match[1]].add((file.stem, match[2]))
    return used


def reached_without(a, b, used):
    """Whether `a` gets `b` along by what else it uses."""
    seen, open_rooms = {a}, [a]
    while open_rooms:
        room = open_rooms.pop()
        for x, y in used:
            if x == room and (x, y) != (a, b) and y not in seen:
                seen.add(y)
                open_rooms.append(y)
    return b in seen


def for_one_header(root):
    reasons = {m.groups() for m in map(ALONE.match, (root / "docs/architecture.md").read_text().splitlines()) if m}
    used = edges(root)
    alone = {edge for edge, uses in used.items() if len(uses) == 1 and not reached_without(*edge, used)}
    found = [f"tileflight/{a}: one header alone, {next(iter(used[a, b]))[1]}.h, needs room {b}"
             for a, b in sorted(alone - reasons)]
    return found + [f"docs/architecture.md: `{a}` → `{b}` is no edge for one header" for a, b in sorted(reasons - alone)]


def comments(text):
    """(line number, comment) of a C++ file; strings that hold // are taken for comments seldom enough."""
    for number, line in enumerate(text.splitlines(), 1):
        at = line.find("//")
        if at >= 0 and line.count('"', 0, at) % 2 == 0:
            yield number, line[at:]


def code_of(text):
    return "\n".join(line.split("//", 1)[0] for line in text.splitlines())


def misnamed(root, files):
    names = {pathlib.PurePosixPath(f).name for f in files}
    sources = {f: (root / f).read_text() for f in files if f.endswith((".h", ".cpp", ".py", ".ts", ".mjs"))}
    names |= {m for text in sources.values() for m in re.findall(r"#\s*include <(?:[^>]*/)?([\w.]+)>", text)}
    called = set()
    for text in sources.values():
        called |= set(re.findall(r"\b([A-Za-z_]\w*)\s*(?:<[^<>;()]*>)?\s*\(", code_of(text)))
    found = []
    for file, text in sorted(sources.items()):
        if not file.endswith((".h", ".cpp")):
            continue
        for number, comment in comments(text):
            for name in FILE.findall(comment):
                if name not in names:
                    found.append(f"{file}:{number}: there is no {name}")
            for space, name in FUNCTION.findall(comment):
                if name not in called and space.split("::")[0] not in OUTSIDE:
                    found.append(f"{file}:{number}: there is no {name}()")
    return found


def misnamed_in_documents(root, files):
    found = []
    for page in sorted(f for f in files if f.endswith(".md")):
        for number, line in enumerate((root / page).read_text().splitlines(), 1):
            for path in re.findall(r"`((?:tileflight|apps|tests|benchmarks)/[\w/]+\.(?:h|cpp|py))`", line):
                if path not in files:
                    found.append(f"{page}:{number}: there is no {path}")
            for path in re.findall(r"\]\((?!\w+:)([^)#\s]+)", line):
                if not (root / page).parent.joinpath(path).exists():
                    found.append(f"{page}:{number}: there is no {path}")
    return found


def faults(root, files):
    return too_large(root) + for_one_header(root) + misnamed(root, files) + misnamed_in_documents(root, files)


def tracked(root):
    return subprocess.check_output(["git", "-C", str(root), "ls-files"], text=True).splitlines()


def main(root):
    root = pathlib.Path(root)
    found = faults(root, [f for f in tracked(root) if (root / f).is_file()])
    print("\n".join(found) if found else "rooms are small, edges have their reasons, comments name what exists")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
