"""The layering check must find what it is there for: plants faults in a copy of a small tree."""
import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import check_includes

ROOMS = [("core", "geometry", "–"), ("core", "imaging", "geometry"), ("core", "alignment", "geometry"),
         ("evaluation", "metrics", "geometry"), ("tiles", "tileset", "geometry, imaging"), ("world", "scene", "geometry, imaging"),
         ("capture", "flight_path", "geometry"), ("slam", "odometry", "geometry, imaging"), ("world", "ground_truth", "scene"),
         ("capture", "sensors", "scene, flight_path"), ("experiments", "report", "imaging; tests: metrics"),
         ("experiments", "experiment", "odometry, sensors, ground_truth")]


def table(rooms):
    return "| wing | room | purpose | may use |\n| --- | --- | --- | --- |\n" + "".join(
        f"| `{wing}` | `{name}` | x | {uses} |\n" for wing, name, uses in rooms)


def faults_of(files, rooms=tuple(ROOMS)):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        (root / "docs").mkdir()
        (root / "docs/architecture.md").write_text(table(rooms))
        for name, text in files.items():
            path = root / "tileflight" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return check_includes.faults(root)


def main():
    good = {"slam/odometry/a.cpp": '#include "tileflight/core/imaging/camera.h"\n',
            "capture/sensors/b.h": '#include "tileflight/core/imaging/image.h"\n',
            "experiments/experiment/c.cpp": '#include "tileflight/slam/odometry/odometry.h"\n',
            "slam/README.md": "", "CMakeLists.txt": "set(slam_ROOMS odometry)\nset(core_ROOMS geometry\n  imaging)\n"}
    assert faults_of(good) == [], faults_of(good)
    leak = faults_of({"slam/odometry/a.cpp": '\n#include "tileflight/world/ground_truth/voxelize.h"\n'})
    assert leak == ["tileflight/slam/odometry/a.cpp:2: room odometry may not include room ground_truth"], leak
    assert faults_of({"core/alignment/a.h": '#include "tileflight/world/scene/scene.h"\n'})
    assert faults_of({"core/geometry/a.h": '#include "tileflight/core/imaging/image.h"\n'})
    assert faults_of({"core/utils/a.h": ""})
    assert faults_of({"world/imaging/a.h": ""}), "a room in another wing"
    assert faults_of({"attic/scene/a.h": ""}), "an unknown wing"
    assert faults_of({"world/scene/deep/er.h": ""})
    assert faults_of({"experiments/report/a_test.cpp": '#include "tileflight/evaluation/metrics/e.h"\n'}) == []
    assert faults_of({"experiments/report/a.cpp": '#include "tileflight/evaluation/metrics/e.h"\n'})
    assert faults_of({"CMakeLists.txt": "set(slam_ROOMS odometry loops)\n", "core/geometry/a.h": ""}) == [
        "tileflight/CMakeLists.txt: slam/loops is not in the table of docs/architecture.md"]
    wrong = [(w, r, "scene" if r == "odometry" else u) for w, r, u in ROOMS]
    assert faults_of({"core/geometry/a.h": ""}, wrong)[0].endswith("room odometry of wing slam may not use room scene of wing world")
    around = [(w, r, "imaging" if r == "geometry" else u) for w, r, u in ROOMS]
    assert any(fault.endswith("use each other") for fault in faults_of({"core/geometry/a.h": ""}, around))
    print("the check finds each planted fault")


main()
