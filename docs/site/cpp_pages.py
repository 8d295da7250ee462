"""The C++ reference: the declarations of the public headers with their comments, a page for each room.

A small reader of this repository's own style, not of C++: `///` above a declaration, namespaces opened at the margin.
What it cannot read is an error.
"""

import re
import sys

import rst


def public_headers(source):
    """{room: [paths of headers]}, as the rooms' CMakeLists.txt names them after HEADERS (tests/layering does the same)."""
    rooms = {}
    for file in sorted(source.glob("tileflight/*/*/CMakeLists.txt")):
        call = re.search(r"tileflight_room\((.*?)\)", file.read_text(), re.DOTALL)
        words = call[1].split() if call else []
        names = [w for w in words[words.index("HEADERS") + 1:] if w.endswith(".h")] if "HEADERS" in words else []
        if names:
            rooms[file.parent.name] = [f"{file.parent.relative_to(source)}/{name}" for name in sorted(names)]
    return rooms


def without_text(line):
    """A line whose strings and comments are blank, of the same length."""
    def blank(found):
        return " " * len(found[0])
    line = re.sub(r'"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])\'', blank, line)
    return re.sub(r"//.*$", blank, line)


class Reader:
    def __init__(self, text, where):
        self.lines, self.where, self.at = text.splitlines(), where, 0

    def take(self):
        """The lines of one declaration: to its `;`, or to the `}` of its body."""
        first, depth, body = self.at, 0, False
        while self.at < len(self.lines):
            plain = without_text(self.lines[self.at])
            self.at += 1
            for sign in plain:
                if sign in "{([":
                    body = body or sign == "{"
                    depth += 1
                elif sign in "})]":
                    depth -= 1
            if depth == 0 and (plain.rstrip().endswith(";") or body and plain.rstrip().endswith("}")):
                return self.lines[first:self.at]
        sys.exit(f"cpp_pages: {self.where}:{first + 1}: a declaration without an end")

    def entries(self):
        """(comment, code) of each declaration at namespace level; a comment without code is one of the file."""
        comment = []
        while self.at < len(self.lines):
            line = self.lines[self.at]
            bare = line.strip()
            if bare.startswith("///"):
                comment.append(bare[3:].removeprefix(" "))
                self.at += 1
            elif bare.startswith("#"):
                while self.lines[self.at].endswith("\\"):
                    self.at += 1
                self.at += 1
            elif not bare or bare.startswith("//") or re.match(r"(inline )?namespace [\w:]*\s*\{$|\}\s*//", bare):
                if not bare and comment and not any(l.strip() for l in self.lines[self.at - 1:self.at]):
                    comment = []
                if bare.startswith("namespace") and comment:
                    yield comment, []
                    comment = []
                self.at += 1
            else:
                code = self.take()
                yield comment, code
                comment = []


def declared(code):
    """Code without the bodies of functions and the private parts of classes."""
    text = "\n".join(code)
    plain = "\n".join(without_text(line) for line in code)
    if re.match(r"(template\s*<[^{]*>\s*)?(class|struct|enum|union)\b", plain) and "{" in plain:
        inside = re.search(r"^ ?(private|protected):.*(?=^\}[^\n]*;\s*\Z)", text, re.DOTALL | re.MULTILINE)
        if inside:
            public = re.search(r"^ ?public:.*", inside[0], re.DOTALL | re.MULTILINE)
            text = text[:inside.start()].rstrip() + "\n" + (public[0] if public else "") + text[inside.end():]
        return text
    opened = plain.find("{")
    if opened >= 0 and "(" in plain[:opened] and "=" not in plain[:plain.find("(")]:
        return text[:opened].rstrip() + ";"
    return text


def name_of(code, where):
    plain = " ".join(without_text(line) for line in code)
    plain = re.sub(r"^template\s*<(?:[^<>]|<[^<>]*>)*>\s*(requires\s+\S+\s+)?", "", plain.strip())
    found = (re.match(r"(?:class|struct|union|enum(?:\s+class)?)\s+(?:\[\[\w+\]\]\s*)?([\w:]+)", plain)
             or re.match(r"using\s+([\w:]+)", plain)
             or re.search(r"(operator\s*\S+?)\s*\(", plain)
             or re.match(r"[^=]*?([~\w]+)\s*\(", plain)
             or re.match(r".*?(\w+)\s*(?:=|\{|;|\[)", plain))
    if not found:
        sys.exit(f"cpp_pages: {where}: no name in {plain[:80]!r}")
    return found[1]


def text_of(comment):
    """`///` lines: paragraphs, and lists of lines that begin with a dash."""
    out, paragraph = [], []
    for line in [*comment, ""]:
        if not line.strip():
            if paragraph:
                out.append(rst.escape(" ".join(paragraph)))
            paragraph = []
        elif re.match(r"\s*[-*] ", line):
            if paragraph:
                out.append(rst.escape(" ".join(paragraph)))
            paragraph = []
            out.append("- " + rst.escape(line.strip()[2:]))
        elif out and out[-1].startswith("- ") and not paragraph and line.startswith("  "):
            out[-1] += " " + rst.escape(line.strip())
        else:
            paragraph.append(line.strip())
    return "\n\n".join(out)


def section(header, text):
    out = [rst.heading(header.split("/")[-1], "-"), f"``#include \"{header}\"``\n\n"]
    last = None
    for comment, code in Reader(text, header).entries():
        if not code:
            out.append(text_of(comment) + "\n\n")
            continue
        if re.fullmatch(r"(class|struct|enum( class)?) [\w:]+;", " ".join(code).strip()) or " ".join(code).startswith("using namespace"):
            continue  # a forward declaration
        name = name_of(code, header)
        if name != last:
            out.append(rst.heading(name.replace("*", "\\*"), "~"))
        last = name
        out.append((text_of(comment) + "\n\n" if comment else "") + rst.code(declared(code), "cpp"))
    return "".join(out)


def write(stage, source):
    rooms = public_headers(source)
    rows = []
    for room, headers in rooms.items():
        text = rst.heading(f"tileflight::{room}") + f".. code-block:: cmake\n\n   find_package(tileflight REQUIRED COMPONENTS {room})\n   target_link_libraries(my_program PRIVATE tileflight::{room})\n\n"
        text += "".join(section(header, (source / header).read_text(encoding="utf-8")) for header in headers)
        stage.write(f"reference/cpp/{room}.rst", text)
        rows.append(f"   * - :doc:`{room} <{room}>`\n     - {', '.join('``' + h.split('/')[-1] + '``' for h in headers)}\n")
    text = rst.heading("C++ reference") + (
        "The public headers of each room, generated from the headers when the site is built: declarations with their comments, without private\n"
        "members. How to use them in a project of your own: :doc:`../../library`; what the rooms are: :doc:`../../architecture`.\n\n"
        ".. list-table::\n   :header-rows: 1\n   :widths: 20 80\n\n   * - room\n     - headers\n") + "".join(rows) + "\n" + rst.toctree(rooms)
    stage.write("reference/cpp/index.rst", text)
