"""Every option of a command that a page's code names exists: `tileflight COMMAND … --option` in blocks and in code within lines.

    check_options.py SOURCE_DIR PROGRAM
"""

import pathlib
import re
import sys

import command_pages


def options_of(program):
    """{words of the command: its options}"""
    found = {}
    for words in command_pages.commands(program):
        _, _, groups, _ = command_pages.parse_help(command_pages.help_of(program, words))
        names = {name for title, entries in groups for left, _ in entries for name in command_pages.parse_entry(left)[0]}
        found[tuple(words)] = names | {"--help"}
    return found


def calls(text):
    """(command's words, options) of each call of the program in a page's code."""
    code = [block for block in re.findall(r"^```[^\n]*\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)]
    code += re.findall(r"`([^`\n]+)`", re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE))
    for piece in code:
        for line in piece.replace("\\\n", " ").splitlines():
            line = re.sub(r"\s#.*", "", line)
            for call in re.findall(r"(?:^|(?<!import)[\s/])tileflight ([a-z][^|;&]*)", line):
                words = call.split()
                yield words, re.findall(r"(?:^|\s)(--[a-z][\w-]*)", call)


def faults(pages, options):
    """Lines about options that no command has."""
    first_words = {words[0] for words in options}
    for name, text in pages:
        for words, named in calls(text):
            if words[0] not in first_words:
                yield f"{name}: there is no command {words[0]!r}: tileflight {' '.join(words)}"
                continue
            command = next((c for c in options if list(c) == words[:len(c)]), None)
            known = options[command] if command else set().union(*(v for c, v in options.items() if c[0] == words[0]))
            for option in named:
                if option not in known:
                    yield f"{name}: tileflight {words[0]} has no option {option}"


def main(source, program):
    source = pathlib.Path(source)
    files = [source / "README.md", source / "CONTRIBUTING.md", source / "clients/python/README.md", *sorted((source / "docs").glob("*.md"))]
    pages = [(str(file.relative_to(source)), file.read_text(encoding="utf-8")) for file in files]
    found = list(faults(pages, options_of(program)))
    for fault in found:
        print(f"check_options: {fault}", file=sys.stderr)
    count = sum(1 for _, text in pages for _ in calls(text))
    print(f"check_options: {count} calls in {len(pages)} pages")
    return 1 if found or count < 50 else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
