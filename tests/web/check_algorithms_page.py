"""Every file that docs/algorithms.md names is there, and every function that a line names stands in one of that line's files.

Usage: check_algorithms_page.py REPOSITORY
"""
import pathlib
import re
import sys


def faults(root):
    page = (root / "docs/algorithms.md").read_text(encoding="utf-8")
    rows = [line.split(" | ") for line in page.splitlines() if line.startswith("| ") and "`tileflight/" in line]
    if len(rows) < 40:
        return ["docs/algorithms.md: its tables were not found"]
    found = []
    for row in rows:
        files = re.findall(r"`(tileflight/[^`]+)`", row[-1])
        missing = [name for name in files if not (root / name).exists()]
        found += [f"docs/algorithms.md: {name} is not there" for name in missing]
        text = "".join((root / name).read_text(encoding="utf-8") for name in files if name not in missing)
        for function in re.findall(r"`([^`]+)`", row[-2]):
            for part in function.split("::"):
                if not re.search(rf"\b{re.escape(part)}\b", text):
                    found.append(f"docs/algorithms.md: `{function}` is not in {', '.join(files)}")
    return found


if __name__ == "__main__":
    problems = faults(pathlib.Path(sys.argv[1]))
    print("\n".join(problems) or "every function is where docs/algorithms.md says")
    sys.exit(bool(problems))
