"""check_names.py must find what it is there for: plants faults in small trees."""
import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import check_names


def faults_of(files):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        files = {"tileflight/w/README.md": "", **files}
        for name, text in files.items():
            path = root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return check_names.faults(root, sorted(files))


def main():
    comment = {"tileflight/w/a/x.cpp": "// as window.h has it, by solve() and std::sort()\nint solve();\n"}
    assert faults_of(comment) == ["tileflight/w/a/x.cpp:1: there is no window.h"]
    assert faults_of({**comment, "tileflight/w/a/window.h": ""}) == []
    assert faults_of({"tileflight/w/a/x.h": "/// what gone() gives\n"}) == ["tileflight/w/a/x.h:1: there is no gone()"]
    page = {"tileflight/w/a/x.h": "", "docs/a.md": "`tileflight/w/a/y.h` and [a picture](images/a.jpg), [outside](https://example.org/x)\n"}
    assert faults_of(page) == ["docs/a.md:1: there is no tileflight/w/a/y.h", "docs/a.md:1: there is no images/a.jpg"]
    assert faults_of({**page, "docs/images/a.jpg": "", "tileflight/w/a/y.h": ""}) == []
    assert faults_of({"tileflight/v/a/x.h": ""}) == ["tileflight/v: has no README.md"]
    print("the check finds each planted fault")


main()
