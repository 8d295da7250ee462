"""The layering check must find what it is there for: plants faults in a copy of a small tree."""
import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import check_includes

TABLE = "| level | room | purpose | may use |\n| --- | --- | --- | --- |\n" + "".join(
    f"| {level} | `{name}` | x | {uses} |\n"
    for level, name, uses in [
        (0, "geometry", "–"), (1, "imaging", "geometry"), (1, "alignment", "geometry"), (1, "evaluation", "geometry"),
        (2, "tiles", "geometry, imaging"), (2, "scene", "geometry, imaging"), (2, "flight", "geometry"),
        (2, "odometry", "geometry, imaging"), (3, "ground_truth", "scene"), (3, "sensors", "scene, flight"),
        (3, "report", "imaging; tests: evaluation"),
        (5, "experiment", "odometry, sensors, ground_truth")])


def tree(root, files):
    (root / "docs").mkdir()
    (root / "docs/architecture.md").write_text(TABLE)
    for name, text in files.items():
        path = root / "tileflight" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def faults_of(files):
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        tree(root, files)
        return check_includes.faults(root)


def main():
    good = {"odometry/a.cpp": '#include "tileflight/core/imaging/camera.h"\n', "sensors/b.h": '#include "tileflight/core/imaging/image.h"\n',
            "experiment/c.cpp": '#include "tileflight/slam/odometry/odometry.h"\n'}
    assert faults_of(good) == [], faults_of(good)
    leak = faults_of({"odometry/a.cpp": '\n#include "tileflight/world/ground_truth/voxelize.h"\n'})
    assert leak == ["tileflight/odometry/a.cpp:2: room odometry may not include room ground_truth"], leak
    assert faults_of({"alignment/a.h": '#include "tileflight/world/scene/scene.h"\n'})
    assert faults_of({"geometry/a.h": '#include "tileflight/core/imaging/image.h"\n'})
    assert faults_of({"utils/a.h": ""})
    assert faults_of({"scene/deep/er.h": ""})
    assert faults_of({"report/a_test.cpp": '#include "tileflight/evaluation/e.h"\n'}) == []
    assert faults_of({"report/a.cpp": '#include "tileflight/evaluation/e.h"\n'})
    print("the check finds each planted fault")


main()
