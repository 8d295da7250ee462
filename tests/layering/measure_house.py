#!/usr/bin/env python3
"""Prints the house in figures: wings, rooms, files and product lines (without tests), headers with one includer, and
lengths of functions.

Functions are found by clang-format's layout: a body opens at the end of a line that is no control statement and no
type, and ends with the brace below the line where its signature began.
Usage: measure_house.py REPOSITORY
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


def single_includer_headers(root):
    """(headers that at most one file besides their own source and test includes, all headers)."""
    includers = {}
    for top in ("tileflight", "apps", "python", "tests", "benchmarks"):
        for file in [*(root / top).rglob("*.h"), *(root / top).rglob("*.cpp")]:
            for name in re.findall(r'#include "(tileflight/[\w/]+\.h)"', file.read_text()):
                includers.setdefault(name, set()).add(str(file.relative_to(root)))
    headers = [str(f.relative_to(root)) for f in (root / "tileflight").rglob("*.h")]
    own = lambda h: {h[:-2] + ".cpp", h[:-2] + "_test.cpp"}
    return sum(len(includers.get(h, set()) - own(h)) <= 1 for h in headers), len(headers)


def main(root):
    root = pathlib.Path(root)
    wings = sorted(w for w in (root / "tileflight").iterdir() if w.is_dir())
    rooms = sum(r.is_dir() for w in wings for r in w.iterdir())
    texts = {}
    for name, folder in [*((w.name, w) for w in wings), ("apps", root / "apps"), ("python", root / "python")]:
        its = {f: f.read_text() for f in product_files(folder)}
        texts |= its
        print(f"{name}: {len(its)} files, {sum(len(t.splitlines()) for t in its.values())} lines")
    sizes = [len(t.splitlines()) for t in texts.values()]
    print(f"product: {len(wings)} wings, {rooms} rooms, {len(sizes)} files, {sum(sizes)} lines; a file: "
          f"{statistics.median(sizes):g} lines median, {sum(n < 40 for n in sizes)} files under 40")
    single, headers = single_includer_headers(root)
    print(f"headers with one includer: {single} of {headers}")
    lengths = sorted((n, f"{f.relative_to(root)}:{at}") for f, t in texts.items() for at, n in functions(t))
    sizes = [n for n, _ in lengths]
    print(f"functions: {len(sizes)}; lines: {statistics.median(sizes):g} median, {sizes[len(sizes) * 9 // 10]} at p90; "
          f"{sum(n > LONG for n in sizes)} over {LONG}:")
    for n, place in lengths[::-1]:
        if n > LONG:
            print(f"  {n} {place}")


if __name__ == "__main__":
    main(sys.argv[1])
