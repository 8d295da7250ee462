#!/usr/bin/env python3
"""No function is written twice: two bodies in different files that differ in nothing but the names of their parameters,
and have at least SMALLEST tokens, are a fault. Comments and layout do not count; functions are found as by
measure_house.py.

Usage: check_duplicates.py REPOSITORY
"""
import collections
import pathlib
import re
import sys

import measure_house

SMALLEST = 50  # below, two functions are alike by chance: conversions of three numbers, getters, one formula
TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|[A-Za-z_]\w*|\d[\w.]*|\S')
NAME = re.compile(r"[A-Za-z_]\w*")


def body_of(lines, begin, length):
    """The parameters' names and the tokens of a function's body."""
    text = "\n".join(line.split("//", 1)[0] for line in lines[begin - 1:begin - 1 + length])
    signature, brace, body = text.partition("{")
    return set(NAME.findall(signature)), TOKEN.findall(brace + body)


def renamed(parameters, tokens):
    """The tokens with the parameters numbered in order of use."""
    numbers = {}
    return tuple(f"${numbers.setdefault(t, len(numbers))}" if t in parameters and NAME.fullmatch(t) else t for t in tokens)


def faults(texts):
    """`texts`: of each file, by its name."""
    found = collections.defaultdict(list)
    for file, text in sorted(texts.items()):
        lines = text.splitlines()
        for begin, length in measure_house.functions(text):
            tokens = renamed(*body_of(lines, begin, length))
            if len(tokens) >= SMALLEST:
                found[tokens].append((file, begin))
    return [" and ".join(f"{file}:{line}" for file, line in places) + ": the same function, written more than once"
            for places in found.values() if len({file for file, _ in places}) > 1]


def main(root):
    root = pathlib.Path(root)
    files = [f for top in ("tileflight", "apps", "python") for f in measure_house.product_files(root / top)]
    found = faults({str(f.relative_to(root)): f.read_text() for f in files})
    print("\n".join(found) if found else "no function is written twice")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
