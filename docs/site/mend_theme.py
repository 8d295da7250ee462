"""Makes the files of Debian's furo those of a site that opens from disk.

The package was made for a web server with /javascript, and without the tools that the theme is built with: its style sheet
lacks the rules for readers who prefer dark, and its script imports another one, which browsers refuse from disk.
A theme without these faults is left as it is.
"""

import pathlib
import re
import shutil


def mend(site):
    for file in (site / "_static").rglob("*.css"):
        text = old = file.read_text(encoding="utf-8")
        for address in sorted(set(re.findall(r"url\((/javascript/[^)]+)\)", text))):
            copy = file.parent / pathlib.Path(address).name
            shutil.copyfile("/usr/share" + address, copy)
            text = text.replace(f"url({address})", f"url({copy.name})")
        if file.name == "furo.css" and "prefers-color-scheme" not in text:
            dark = re.search(r'^@media not print \{\n(  body\[data-theme="dark"\] \{.*?\} \})$', text, re.DOTALL | re.MULTILINE)
            rules = dark[1].removesuffix("}").replace('[data-theme="dark"]', ':not([data-theme="light"])')
            text += f"\n@media not print {{\n@media (prefers-color-scheme: dark) {{\n{rules}}} }}\n"
        if text != old:
            file.write_text(text, encoding="utf-8")
    script = site / "_static" / "scripts" / "furo.js"
    text = script.read_text(encoding="utf-8")
    imported = re.match(r'import Gumshoe from "\./([\w.-]+)";\n', text)
    if imported:
        script.write_text((script.parent / imported[1]).read_text(encoding="utf-8") + "\n" + text[imported.end():], encoding="utf-8")
