"""Reads the include lines of every room and fails on an edge that docs/architecture.md's table of wings and rooms does not
allow.

The table in the document is the rule: this script reads it from there, so that the two cannot differ. A row is
`| `wing` | `room` | purpose | rooms that it may use; tests: further rooms for its tests |`.
Usage: check_includes.py REPOSITORY
"""
import pathlib
import re
import sys

INCLUDE = re.compile(r'^\s*#\s*include\s+"tileflight/([a-z_0-9]+)/([a-z_0-9]+)/')
ROW = re.compile(r"^\|\s*`([a-z_0-9]+)`\s*\|\s*`([a-z_0-9]+)`\s*\|[^|]*\|\s*([^|]*?)\s*\|\s*$")
TESTS = "; tests:"
FORBIDDEN_NAMES = {"utils", "util", "common", "helpers", "io", "misc"}
# A wing that other programs use alone, and the wings that it may see.
ALONE = {"slam": {"core", "data", "slam"}}


def rows(table_text):
    return [m.groups() for m in map(ROW.match, table_text.splitlines()) if m]


def wings(table_text):
    """room -> wing"""
    return {room: wing for wing, room, _ in rows(table_text)}


def allowed_edges(table_text):
    """room -> set of rooms whose headers it may include (itself and everything below those included)."""
    rooms = wings(table_text)
    direct = {room: {u for u in re.findall(r"[a-z_0-9]+", uses.split(TESTS)[0]) if u in rooms}
              for _, room, uses in rows(table_text)}
    return {room: closure(room, direct) for room in direct}


def test_edges(table_text, allowed):
    """room -> set of rooms whose headers its tests may include, too."""
    direct = {room: re.findall(r"[a-z_0-9]+", uses.partition(TESTS)[2]) for _, room, uses in rows(table_text)}
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


def table_faults(wing_of, allowed):
    """Rooms that use each other, and wings that must stand alone and do not."""
    found = []
    for room, used in allowed.items():
        for other in sorted(used - {room}):
            if room in allowed[other]:
                found.append(f"docs/architecture.md: rooms {room} and {other} use each other")
            if wing_of[other] not in ALONE.get(wing_of[room], {wing_of[other]}):
                found.append(f"docs/architecture.md: room {room} of wing {wing_of[room]} may not use room {other} of wing {wing_of[other]}")
    return found


def built_rooms(root):
    """(wing, room) of each room that tileflight/CMakeLists.txt builds; none without that file."""
    file = root / "tileflight/CMakeLists.txt"
    text = file.read_text() if file.is_file() else ""
    return [(wing, room) for wing, names in re.findall(r"set\((\w+)_ROOMS ([^)]*)\)", text) for room in names.split()]


def faults(root):
    table = (root / "docs/architecture.md").read_text()
    wing_of, allowed = wings(table), allowed_edges(table)
    for_tests = test_edges(table, allowed)
    if len(allowed) < 10:
        return ["docs/architecture.md: the table of wings and rooms was not found"]
    found = table_faults(wing_of, allowed)
    found += [f"tileflight/CMakeLists.txt: {wing}/{room} is not in the table of docs/architecture.md"
              for wing, room in built_rooms(root) if wing_of.get(room) != wing]
    for wing in sorted(p for p in (root / "tileflight").iterdir() if p.is_dir()):
        if wing.name not in wing_of.values():
            found.append(f"tileflight/{wing.name}: not a wing of docs/architecture.md")
            continue
        for folder in sorted(p for p in wing.iterdir() if p.is_dir()):
            found += room_faults(root, folder, wing_of, allowed, for_tests)
    return found


def room_faults(root, folder, wing_of, allowed, for_tests):
    room = folder.name
    if room in FORBIDDEN_NAMES or wing_of.get(room) != folder.parent.name:
        return [f"{folder.relative_to(root)}: not a room of docs/architecture.md"]
    found = []
    for file in sorted(folder.rglob("*")):
        if file.is_dir():
            found.append(f"{file.relative_to(root)}: nothing lies deeper than tileflight/<wing>/<room>/<file>")
        elif file.suffix in (".h", ".cpp"):
            found += includes_not_allowed(root, file, room, (for_tests if is_for_tests(file) else allowed)[room])
    return found


def includes_not_allowed(root, file, room, allowed):
    found = []
    for number, line in enumerate(file.read_text().splitlines(), 1):
        match = INCLUDE.match(line)
        if match and match[2] not in allowed:
            found.append(f"{file.relative_to(root)}:{number}: room {room} may not include room {match[2]}")
    return found


def main(root):
    found = faults(pathlib.Path(root))
    print("\n".join(found) if found else "every include follows the table")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
