"""Reads the include lines of every stage and fails on an edge that docs/architecture.md's table does not allow.

The table in the document is the rule: this script reads it from there, so that the two cannot differ.
Usage: check_includes.py REPOSITORY
"""
import pathlib
import re
import sys

INCLUDE = re.compile(r'^\s*#\s*include\s+"tileflight/([a-z_]+)/')
ROW = re.compile(r"^\|\s*(\d+)\s*\|\s*`([a-z_]+)`\s*\|[^|]*\|\s*([^|]*?)\s*\|\s*$")
FORBIDDEN_NAMES = {"utils", "util", "common", "helpers", "io", "misc"}


def allowed_edges(table_text):
    """stage -> set of stages whose headers it may include (itself and everything below those included)."""
    rows = [ROW.match(line) for line in table_text.splitlines()]
    levels = {m[2]: int(m[1]) for m in rows if m}
    direct = {}
    for m in filter(None, rows):
        stage, uses = m[2], m[3]
        if uses == "all":
            direct[stage] = {s for s in levels if levels[s] < levels[stage]}
        else:
            direct[stage] = {u for u in re.findall(r"[a-z_]+", uses) if u in levels}
    return {stage: closure(stage, direct) for stage in direct}


def closure(stage, direct):
    """The stage, what it may use, and what those may use."""
    reached, open_set = set(), {stage}
    while open_set:
        current = open_set.pop()
        reached.add(current)
        open_set |= direct.get(current, set()) - reached
    return reached


def faults(root):
    allowed = allowed_edges((root / "docs/architecture.md").read_text())
    if len(allowed) < 10:
        return ["docs/architecture.md: the table of stages was not found"]
    found = []
    for folder in sorted(p for p in (root / "tileflight").iterdir() if p.is_dir()):
        stage = folder.name
        if stage in FORBIDDEN_NAMES or stage not in allowed:
            found.append(f"tileflight/{stage}: not a stage of docs/architecture.md")
            continue
        for file in sorted(folder.rglob("*")):
            if file.is_dir():
                found.append(f"{file.relative_to(root)}: nothing lies deeper than tileflight/<stage>/<file>")
            elif file.suffix in (".h", ".cpp"):
                found += includes_not_allowed(root, file, stage, allowed[stage])
    return found


def includes_not_allowed(root, file, stage, allowed):
    found = []
    for number, line in enumerate(file.read_text().splitlines(), 1):
        match = INCLUDE.match(line)
        if match and match[1] not in allowed:
            found.append(f"{file.relative_to(root)}:{number}: stage {stage} may not include stage {match[1]}")
    return found


def main(root):
    found = faults(pathlib.Path(root))
    print("\n".join(found) if found else "every include follows the table")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
