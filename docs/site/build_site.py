"""Builds the documentation site: pages of docs/ and generated ones, by Sphinx, into OUT/html.

    build_site.py SOURCE_DIR OUT --program TILEFLIGHT --python PACKAGE_FOLDER [--examples FOLDER] [--check]

Warnings are errors. With --check the finished pages are checked too (check_site.py). Exit code 77: Sphinx or another
program is missing, which the last line names.
"""

import argparse
import importlib.util
import os
import pathlib
import re
import shutil
import subprocess
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import check_site
import command_pages
import cpp_pages
import mend_theme
import python_pages
import schema_pages

NEEDED = {"sphinx": "python3-sphinx", "furo": "furo", "myst_parser": "python3-myst-parser", "matplotlib": "python3-matplotlib"}

#: Pages that lie elsewhere in the repository, and where the site has them.
ELSEWHERE = {
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "benchmarks/BENCHMARKS.md": "benchmarks.md",
    "clients/python/README.md": "python-client.md",
    "README.md": "index.md",
}
LINK = re.compile(r"(!?\[[^\]]*\]\()(<[^>]*>|[^)\s]+)((?:\s+\"[^\"]*\")?\))")


class Stage:
    """The folder that Sphinx reads: a copy of the pages, with links that lead out of docs/ turned to what the site has."""

    def __init__(self, source, folder):
        self.source, self.folder = source, folder
        self.pages = {source / old: new for old, new in ELSEWHERE.items() if (source / old).exists()}
        self.pages.update({page: page.name for page in (source / "docs").glob("*.md")})
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)

    def turned(self, page, target):
        """The target of a link of a page, from the root of the site."""
        if re.match(r"[a-z+]+:|#|/", target) or not target:
            return target
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve()
        if file in self.pages:
            return self.pages[file] + ("#" + anchor if anchor else "")
        if file.is_dir() and file / "README.md" in self.pages:
            return self.pages[file / "README.md"]
        if not file.is_file() or not file.is_relative_to(self.source):
            sys.exit(f"build_site: {page.relative_to(self.source)}: the link {target} leads nowhere")
        docs = self.source / "docs"
        inside = file.relative_to(docs) if file.is_relative_to(docs) else "files" / file.relative_to(self.source)
        (self.folder / inside).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, self.folder / inside)
        return str(inside)

    def text(self, page):
        """A page's text with its links turned; code is left as it is."""
        parts = re.split(r"(^```.*?^```[ \t]*$|``[^`]*``|`[^`\n]*`)", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
        # A link's text may hold code: what is code is put aside while links are looked for.
        kept = []

        def put_aside(code):
            kept.append(code)
            return f"\0{len(kept) - 1}\0"

        whole = "".join(put_aside(part) if i % 2 else part for i, part in enumerate(parts))
        whole = LINK.sub(lambda m: m[1] + self.turned(page, m[2].strip("<>")) + m[3], whole)
        return re.sub("\0(\\d+)\0", lambda m: kept[int(m[1])], whole)

    def copy_pages(self):
        for page, name in self.pages.items():
            if page != self.source / "README.md":
                self.write(name, self.text(page))
        docs = self.source / "docs"
        for files in ("images", "flights"):
            shutil.copytree(docs / files, self.folder / files, dirs_exist_ok=True)
        shutil.copytree(docs / "examples", self.folder / "examples", dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))

    def write(self, name, text):
        file = self.folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")


def draw_pictures(source, folder, package):
    """Runs the examples whose picture is not there or is older than the script and the package."""
    folder.mkdir(parents=True, exist_ok=True)
    built = max(file.stat().st_mtime for file in (package / "tileflight").iterdir())
    for script in sorted((source / "docs" / "examples").glob("*.py")):
        picture = folder / (script.stem + ".png")
        if picture.exists() and picture.stat().st_mtime > max(built, script.stat().st_mtime):
            continue
        environment = {**os.environ, "PYTHONPATH": str(package), "MPLBACKEND": "Agg", "PYTHONDONTWRITEBYTECODE": "1"}
        done = subprocess.run([sys.executable, script], cwd=folder, env=environment, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"build_site: docs/examples/{script.name} failed:\n{done.stderr}")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("source", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--program", required=True)
    parser.add_argument("--python", type=pathlib.Path, required=True)
    parser.add_argument("--examples", type=pathlib.Path)
    parser.add_argument("--check", action="store_true")
    arguments = parser.parse_args()
    missing = [package for module, package in NEEDED.items() if importlib.util.find_spec(module) is None]
    if missing:
        print(f"skipped: no {', '.join(missing)}")
        return 77

    source, out = arguments.source.resolve(), arguments.out.resolve()
    examples = (arguments.examples or out / "examples").resolve()
    draw_pictures(source, examples, arguments.python.resolve())

    stage = Stage(source, out / "pages")
    stage.copy_pages()
    for picture in examples.glob("*.png"):
        shutil.copy(picture, out / "pages" / "examples")
    command_pages.write(stage, arguments.program)
    schema_pages.write(stage, source / "schemas")
    python_pages.write(stage, arguments.python / "tileflight")
    cpp_pages.write(stage, source)

    version = subprocess.run([arguments.program, "--version"], capture_output=True, text=True, check=True).stdout.split()[1]
    environment = {**os.environ, "TILEFLIGHT_DOCS": str(source / "docs"), "TILEFLIGHT_VERSION": version, "PYTHONDONTWRITEBYTECODE": "1"}
    shutil.rmtree(out / "html", ignore_errors=True)
    built = subprocess.run([sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-n", "-E", "-b", "html", "-d", out / "doctrees",
                            "-c", source / "docs", stage.folder, out / "html"], env=environment)
    if built.returncode:
        return built.returncode
    mend_theme.mend(out / "html")
    print(f"site: {out / 'html' / 'index.html'}")
    return check_site.check(out / "html") if arguments.check else 0


if __name__ == "__main__":
    sys.exit(main())
