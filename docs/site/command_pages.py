"""A page for each command, from the program's own help."""

import re
import subprocess
import sys

import rst


def help_of(program, words):
    return subprocess.run([program, *words, "--help"], capture_output=True, text=True, check=True).stdout


def parse_help(text):
    """Description, usage, groups [(title, [(names, note, meaning)])] and examples of a command's help."""
    head, _, rest = text.partition("\nUsage: ")
    usage, _, rest = rest.partition("\n")
    groups, examples, entries = [], [], None
    for line in rest.splitlines():
        if examples or re.match(r"Examples?:$", line):
            examples.append(line)
        elif re.match(r"\S.*:$", line):
            entries = []
            groups.append((line[:-1], entries))
        elif re.match(r"  \S", line):
            found = re.match(r"  (.{26,}?)  +(\S.*)$|  (\S.{0,25}?)  +(\S.*)$|  (.*)$", line)
            left = found[1] or found[3] or found[5]
            entries.append([left.strip(), found[2] or found[4] or ""])
        elif line.strip():
            if entries is None or not line.startswith(" " * 10):
                sys.exit(f"command_pages: a line of the help is not understood: {line!r}")
            entries[-1][1] = (entries[-1][1] + " " + line.strip()).strip()
    return head.strip(), usage, groups, examples[1:]


KINDS = {"TEXT": "text", "INT": "whole number", "UINT": "whole number, not negative", "FLOAT": "number"}


def parse_entry(left):
    """`--size FLOAT x 3 Excludes: --region` as (names, value, notes)."""
    left, _, excludes = left.partition(" Excludes: ")
    left, _, needs = left.partition(" Needs: ")
    if not excludes:
        needs, _, excludes = needs.partition(" Excludes: ")
    words = left.split(" ")
    names, words = words[0].replace("{false}", "").split(","), words[1:]
    notes = []
    if "REQUIRED" in words:
        words.remove("REQUIRED")
        notes.append("required")
    value = " ".join(words)
    default = re.search(r"(?<=[A-Z}\]])=(\S+)", value)
    if default:
        value = value.replace(default[0], "")
        notes.append(f"default {default[1]}")
    if needs:
        notes.append("only with " + ", ".join(f"`{name}`" for name in needs.split()))
    if excludes:
        notes.append("not with " + ", ".join(f"`{name}`" for name in excludes.split()))
    return names, value, notes


def value_in_words(value):
    """CLI11's `FLOAT:POSITIVE x 3` for people."""
    repeated = value.endswith("...")
    value = value.removesuffix("...").strip()
    value, _, times = value.partition(" x ")
    kind, _, check = value.partition(":")
    if check.startswith("{"):
        words = "one of " + ", ".join(f"`{choice}`" for choice in check.strip("{}").split(","))
    elif " in [" in check:
        low, high = re.search(r"\[(\S+) - (\S+)\]", check).groups()
        words = f"{KINDS[kind]} from {low} to {high}"
    else:
        words = KINDS.get(kind, kind.lower()) + {"POSITIVE": ", positive", "NONNEGATIVE": ", not negative", "FILE": ": an existing file"}.get(check, "")
    if times:
        words = f"{times} of: {words}, separated by commas" if words else words
    return words + (", may be repeated" if repeated else "")


def page(program, words):
    description, usage, groups, examples = parse_help(help_of(program, words))
    name = "tileflight " + " ".join(words)
    out = [rst.heading(name), rst.escape(description[:1].upper() + description[1:]) + ".\n\n", rst.code(usage)]
    if examples:
        out.append(rst.code("\n".join(examples), "sh" if all(l.startswith("  ") for l in examples if l) else "none"))
    out.append(f".. program:: {name}\n\n")
    for title, entries in groups:
        out.append(rst.heading("Arguments" if title == "Positionals" else title, "-"))
        for left, meaning in entries:
            names, value, notes = parse_entry(left)
            if title == "Positionals" or title == "Subcommands":
                signature = names[0]
            else:
                placeholder = value.split(":")[0].split(" ")[0]
                signature = ", ".join(f"{n} {placeholder}".strip() for n in names)
            about = [value_in_words(value)] if value and value != "TEXT" else []
            about = "; ".join(about + notes)
            if names == ["-h", "--help"]:
                continue
            text = rst.escape(meaning) + (f" ({rst.escape(about)})" if about else "")
            out.append(f".. option:: {signature}\n\n{rst.indented(text)}\n\n")
    return "".join(out)


def commands(program):
    """Words of all commands; one that has parts, by its parts."""
    def parts(words):
        _, _, groups, _ = parse_help(help_of(program, words))
        found = [entry[0].split(" ")[0] for title, entries in groups if title == "Subcommands" for entry in entries]
        return [w for part in found for w in parts(words + [part])] if found else [words]
    return parts([])


def write(stage, program):
    _, _, groups, _ = parse_help(help_of(program, []))
    described = {entry[0]: entry[1] for title, entries in groups if title == "Subcommands" for entry in entries}
    names = []
    rows = [".. list-table::\n   :header-rows: 1\n   :widths: 30 70\n\n   * - command\n     - does\n"]
    for words in commands(program):
        name = "-".join(words)
        names.append(name)
        stage.write(f"reference/commands/{name}.rst", page(program, words))
        rows.append(f"   * - :doc:`{' '.join(words)} <{name}>`\n     - {rst.escape(described[words[0]])}\n")
    text = rst.heading("Commands") + (
        "Generated from the program's own help when the site is built. ``tileflight COMMAND --help`` prints the same.\n\n"
    ) + "".join(rows) + "\n" + rst.toctree(names)
    stage.write("reference/commands/index.rst", text)
