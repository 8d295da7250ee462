#!/usr/bin/env python3
"""The house in figures: rooms, files, product lines (without tests), lengths of functions (docs/architecture.md).

Functions are found by clang-format's layout: a body opens at the end of a line that is no control statement and no
type, and ends with the brace below the line where its signature began.
Usage: measure_rooms.py REPOSITORY
"""
import pathlib
import re
import statistics
import sys

NO_FUNCTION = re.compile(r"(template <.*?> )?\s*((namespace|class|struct|enum|union|extern|if|for|while|switch|else|do|try|catch|return)\b|\}|.*= )")
ONE_LINE = re.compile(r"\)[\w\s]*\{.*\}$")
CONTINUED = (";", "}", "{")
LONG = 60


def is_for_tests(file):
    return file.stem.endswith("_test") or file.stem.startswith(("test_", "synthetic_"))


def product_files(folder):
    return sorted(f for ending in ("h", "cpp") for f in folder.rglob(f"*.{ending}") if not is_for_tests(f))


def indent(line):
    return len(line) - len(line.lstrip())


def begin_of(lines, at):
    """The first line of the signature whose body opens on line `at`."""
    while at > 0:
        before = lines[at - 1].strip()
        if not before or before.endswith(CONTINUED) or before.startswith(("//", "#", "public:", "private:", "protected:")):
            break
        at -= 1
    return at


def functions(text):
    """(first line, number of lines) of each function."""
    lines, at, found = text.splitlines(), 0, []
    while at < len(lines):
        line, length = lines[at].rstrip(), 0
        begin = begin_of(lines, at)
        signature = " ".join(each.strip() for each in lines[begin:at + 1])
        if "(" in signature and indent(lines[begin]) <= 2 and not NO_FUNCTION.match(signature):
            if line.endswith("{"):
                close = " " * indent(lines[begin]) + "}"
                end = next((i for i in range(at + 1, len(lines)) if lines[i].rstrip() == close), None)
                length = end - begin + 1 if end else 0
            elif ONE_LINE.search(line):
                length = at - begin + 1
        if length:
            found.append((begin + 1, length))
            at = begin + length
        else:
            at += 1
    return found


def main(root):
    root = pathlib.Path(root)
    rooms = {room.name: product_files(room) for room in sorted((root / "tileflight").iterdir()) if room.is_dir()}
    files = [f for room in rooms.values() for f in room] + product_files(root / "apps")
    if (root / "python").is_dir():
        files += product_files(root / "python")
    counts = sorted((len(room) for room in rooms.values()), reverse=True)
    print(f"rooms: {len(rooms)}; files a room: {statistics.median(counts):g} median, {counts[0]} at most")
    texts = {f: f.read_text() for f in files}
    print(f"product: {len(files)} files, {sum(len(t.splitlines()) for t in texts.values())} lines")
    lengths = sorted((n, f"{f.relative_to(root)}:{at}") for f, t in texts.items() for at, n in functions(t))
    sizes = [n for n, _ in lengths]
    print(f"functions: {len(sizes)}; lines: {statistics.median(sizes):g} median, {sizes[len(sizes) * 9 // 10]} at p90; "
          f"{sum(n > LONG for n in sizes)} over {LONG}:")
    for n, place in lengths[::-1]:
        if n > LONG:
            print(f"  {n} {place}")


if __name__ == "__main__":
    main(sys.argv[1])
