"""check_rooms.py must find what it is there for: plants faults in small trees."""
import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import check_rooms


def faults_of(files, reasons=""):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        files = {"docs/architecture.md": reasons, **files}
        for name, text in files.items():
            path = root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return check_rooms.faults(root, sorted(files))


def room(name, units):
    return {f"tileflight/{name}/u{i}.h": "" for i in range(units)}


def main():
    assert faults_of(room("a", check_rooms.LARGEST)) == []
    assert faults_of({**room("a", check_rooms.LARGEST), "tileflight/a/test_x.h": "", "tileflight/a/u1_test.cpp": ""}) == []
    assert faults_of(room("a", check_rooms.LARGEST + 1)) == [
        f"tileflight/a: {check_rooms.LARGEST + 1} units, at most {check_rooms.LARGEST}: it has two purposes"]

    one = {"tileflight/a/x.cpp": '#include "tileflight/b/y.h"\n', "tileflight/b/y.h": ""}
    assert faults_of(one) == ["tileflight/a: one header alone, y.h, needs room b"]
    assert faults_of(one, "- `a` → `b`: it is b's front door\n") == []
    two = {**one, "tileflight/a/z.cpp": '#include "tileflight/b/y.h"\n'}
    assert faults_of(two) == []
    assert faults_of(two, "- `a` → `b`: no longer so\n") == ["docs/architecture.md: `a` → `b` is no edge for one header"]
    along = {**one, "tileflight/a/w.cpp": '#include "tileflight/c/v.h"\n', "tileflight/a/u.cpp": '#include "tileflight/c/v.h"\n',
             "tileflight/c/v.h": '#include "tileflight/b/y.h"\n', "tileflight/c/t.h": '#include "tileflight/b/y.h"\n'}
    assert faults_of(along) == [], "c brings b along"
    assert faults_of({"tileflight/a/x_test.cpp": '#include "tileflight/b/y.h"\n', "tileflight/b/y.h": ""}) == []

    comment = {"tileflight/a/x.cpp": "// as window.h has it, by solve() and std::sort()\nint solve();\n"}
    assert faults_of(comment) == ["tileflight/a/x.cpp:1: there is no window.h"]
    assert faults_of({**comment, "tileflight/a/window.h": ""}) == []
    assert faults_of({"tileflight/a/x.h": "/// what gone() gives\n"}) == ["tileflight/a/x.h:1: there is no gone()"]
    page = {"tileflight/a/x.h": "", "docs/a.md": "`tileflight/a/y.h` and [a picture](images/a.jpg), [outside](https://example.org/x)\n"}
    assert faults_of(page) == ["docs/a.md:1: there is no tileflight/a/y.h", "docs/a.md:1: there is no images/a.jpg"]
    assert faults_of({**page, "docs/images/a.jpg": "", "tileflight/a/y.h": ""}) == []
    print("the check finds each planted fault")


main()
