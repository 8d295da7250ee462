"""Reads the include lines of every room and fails on an edge that docs/architecture.md's table does not allow.

The table in the document is the rule: this script reads it from there, so that the two cannot differ.
Usage: check_includes.py REPOSITORY
"""
import pathlib
import re
import sys

INCLUDE = re.compile(r'^\s*#\s*include\s+"tileflight/([a-z_0-9]+)/')
ROW = re.compile(r"^\|\s*(\d+)\s*\|\s*`([a-z_0-9]+)`\s*\|[^|]*\|\s*([^|]*?)\s*\|\s*$")
TESTS = "; tests:"
FORBIDDEN_NAMES = {"utils", "util", "common", "helpers", "io", "misc"}


def allowed_edges(table_text):
    """room -> set of rooms whose headers it may include (itself and everything below those included)."""
    rows = [ROW.match(line) for line in table_text.splitlines()]
    levels = {m[2]: int(m[1]) for m in rows if m}
    direct = {}
    for m in filter(None, rows):
        direct[m[2]] = {u for u in re.findall(r"[a-z_0-9]+", m[3].split(TESTS)[0]) if u in levels}
    return {room: closure(room, direct) for room in direct}


def test_edges(table_text, allowed):
    """room -> set of rooms whose headers its tests may include, too."""
    rows = filter(None, map(ROW.match, table_text.splitlines()))
    direct = {m[2]: re.findall(r"[a-z_0-9]+", m[3].partition(TESTS)[2]) for m in rows}
    return {room: allowed[room].union(*(allowed[u] for u in uses if u in allowed)) for room, uses in direct.items()}


def is_for_tests(file):
    return file.stem.endswith("_test") or file.stem.startswith(("test_", "synthetic_"))


def closure(room, direct):
    """The room, what it may use, and what those may use."""
    reached, open_set = set(), {room}
    while open_set:
        current = open_set.pop()
        reached.add(current)
        open_set |= direct.get(current, set()) - reached
    return reached


def faults(root):
    table = (root / "docs/architecture.md").read_text()
    allowed = allowed_edges(table)
    for_tests = test_edges(table, allowed)
    if len(allowed) < 10:
        return ["docs/architecture.md: the table of rooms was not found"]
    found = []
    for folder in sorted(p for p in (root / "tileflight").iterdir() if p.is_dir()):
        room = folder.name
        if room in FORBIDDEN_NAMES or room not in allowed:
            found.append(f"tileflight/{room}: not a room of docs/architecture.md")
            continue
        for file in sorted(folder.rglob("*")):
            if file.is_dir():
                found.append(f"{file.relative_to(root)}: nothing lies deeper than tileflight/<room>/<file>")
            elif file.suffix in (".h", ".cpp"):
                found += includes_not_allowed(root, file, room, (for_tests if is_for_tests(file) else allowed)[room])
    return found


def includes_not_allowed(root, file, room, allowed):
    found = []
    for number, line in enumerate(file.read_text().splitlines(), 1):
        match = INCLUDE.match(line)
        if match and match[1] not in allowed:
            found.append(f"{file.relative_to(root)}:{number}: room {room} may not include room {match[1]}")
    return found


def main(root):
    found = faults(pathlib.Path(root))
    print("\n".join(found) if found else "every include follows the table")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
