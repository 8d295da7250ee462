"""Checks that comments and documents name what exists, and that each wing has its page.

A file (`x.h`, `y.cpp`, `z.md`) or function (`name()`) that a comment names must be somewhere in the repository, and so
must the files that a document names or links (the functions of docs/algorithms.md: tests/docs). Each wing has a README.md.
Usage: check_names.py REPOSITORY
"""
import pathlib
import re
import subprocess
import sys

FILE = re.compile(r"(?<![<\w/.*{])([a-z_0-9]+\.(?:h|cpp|md|py|ts|cmake))\b")
FUNCTION = re.compile(r"(?<![\w:.>~])((?:[a-z_]+::)*)([A-Za-z_]\w*)\(\)")
OUTSIDE = {"std", "cv", "numpy"}  # namespaces of others


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


def without_page(root, files):
    wings = {pathlib.PurePosixPath(f).parts[1] for f in files if re.match(r"tileflight/\w+/\w+/", f)}
    return [f"tileflight/{wing}: has no README.md" for wing in sorted(wings) if f"tileflight/{wing}/README.md" not in files]


def faults(root, files):
    return misnamed(root, files) + misnamed_in_documents(root, files) + without_page(root, files)


def tracked(root):
    return subprocess.check_output(["git", "-C", str(root), "ls-files"], text=True).splitlines()


def main(root):
    root = pathlib.Path(root)
    found = faults(root, [f for f in tracked(root) if (root / f).is_file()])
    print("\n".join(found) if found else "comments and documents name what exists")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
