"""check_public_headers.py must find what it is there for: plants faults in small trees."""
import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import check_public_headers


def faults_of(headers, public):
    with tempfile.TemporaryDirectory() as folder:
        room = pathlib.Path(folder) / "tileflight/w/a"
        room.mkdir(parents=True)
        (room / "CMakeLists.txt").write_text(f"tileflight_room(a USES b\n  HEADERS {public})\n")
        for name, text in headers.items():
            (room / name).write_text(text)
        return check_public_headers.faults(pathlib.Path(folder))


def main():
    x, y = {"x.h": '#include "tileflight/w/a/y.h"\n'}, {"y.h": "#include <vector>\n"}
    assert faults_of({**x, **y}, "x.h y.h") == []
    assert faults_of({**x, **y}, "x.h") == ["tileflight/w/a/x.h: is public and includes tileflight/w/a/y.h, which is not"]
    assert faults_of(y, "y.h z.h") == ["tileflight/w/a/z.h: is named as a public header and does not exist"]
    assert faults_of({"x.h": "#include <nlohmann/json_fwd.hpp>\n"}, "x.h") == []
    for library in ("nlohmann/json.hpp", "yaml-cpp/yaml.h", "msgpack.hpp"):
        assert faults_of({"x.h": f"#include <{library}>\n"}, "x.h") == [f"tileflight/w/a/x.h: is public and shows {library}"]
    print("the check finds each planted fault")


main()
