"""Checks a finished site: every local link and anchor leads somewhere, and nothing is loaded from elsewhere.

    check_site.py FOLDER
"""

import html.parser
import pathlib
import re
import sys
import urllib.parse

#: What a browser fetches by itself; <a> it does not.
LOADED = {("link", "href"), ("script", "src"), ("img", "src"), ("img", "srcset"), ("source", "src"), ("source", "srcset"), ("iframe", "src"),
          ("video", "src"), ("audio", "src"), ("object", "data"), ("embed", "src"), ("input", "src"), ("image", "href"), ("use", "href")}
#: Relations of <link> that only name something.
NAMING = {"canonical", "author", "license", "next", "prev", "index", "search", "top", "alternate"}
OUTSIDE = re.compile(r"[a-zA-Z][a-zA-Z0-9+.-]*:|//")


class Page(html.parser.HTMLParser):
    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.anchors, self.twice, self.links, self.loads = set(), set(), [], []
        self.in_style = False
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        identifier = values.get("id")
        if identifier:
            (self.twice if identifier in self.anchors else self.anchors).add(identifier)
        if tag == "a" and values.get("name"):
            self.anchors.add(values["name"])
        self.in_style = tag == "style"
        for name, value in attributes:
            if value is None:
                continue
            if tag == "a" and name == "href":
                self.links.append(value)
            elif (tag, name) in LOADED and not (tag == "link" and set((values.get("rel") or "").split()) & NAMING):
                self.loads += [part.split()[0] for part in value.split(",") if part.strip()] if name == "srcset" else [value]
            elif name == "style":
                self.loads += urls_of_css(value)

    def handle_data(self, data):
        if self.in_style:
            self.loads += urls_of_css(data)

    def handle_endtag(self, tag):
        self.in_style = self.in_style and tag != "style"


def urls_of_css(text):
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    return [m[1].strip("'\" ") for m in re.finditer(r"url\(\s*((?:\"[^\"]*\"|'[^']*'|[^)]*))\s*\)", text)] + re.findall(r"@import\s+[\"']([^\"']+)", text)


def faults(root):
    root = pathlib.Path(root)
    pages = {file.resolve(): Page(file.read_text(encoding="utf-8")) for file in sorted(root.rglob("*.html"))}
    if not pages:
        return [f"{root}: no pages"]
    found = []

    def look(file, value, is_loaded):
        where = file.relative_to(root.resolve())
        if OUTSIDE.match(value):
            if is_loaded and not value.startswith("data:"):
                found.append(f"{where}: is loaded from elsewhere: {value}")
            return
        path, _, anchor = value.partition("#")
        path = urllib.parse.unquote(path.split("?")[0])
        target = (file.parent / path).resolve() if path else file
        if path.startswith("/") or not target.is_relative_to(root.resolve()):
            found.append(f"{where}: leads out of the site: {value}")
        elif not target.exists() or target.is_dir():
            found.append(f"{where}: leads nowhere: {value}")
        elif anchor and target in pages and urllib.parse.unquote(anchor) not in pages[target].anchors:
            found.append(f"{where}: no such anchor: {value}")

    for file, page in pages.items():
        found += [f"{file.relative_to(root.resolve())}: two elements have the id {i}" for i in sorted(page.twice)]
        for value in page.links:
            look(file, value, False)
        for value in page.loads:
            look(file, value, True)
    for file in sorted(root.rglob("*.css")):
        for value in urls_of_css(file.read_text(encoding="utf-8")):
            if not value.startswith("#"):
                look(file.resolve(), value, True)
    return found


def check(root):
    found = faults(root)
    for fault in found:
        print(f"check_site: {fault}", file=sys.stderr)
    if not found:
        print(f"check_site: {len(list(pathlib.Path(root).rglob('*.html')))} pages, every link and anchor leads somewhere, nothing is loaded from elsewhere")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(check(sys.argv[1]))
