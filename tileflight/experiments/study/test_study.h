#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include "tests/temporary_folder.h"

namespace tileflight::study::test_support {

namespace fs = std::filesystem;

inline void write(const fs::path& file, const std::string& text) {
  fs::create_directories(file.parent_path());
  std::ofstream(file) << text;
}

/// A folder with two experiments that need no data to be read, two adapters, a camera, and a program that stands in for
/// tileflight: it makes the outputs that the tasks declare.
struct StudyFolder {
  StudyFolder() {
    for (const char* name : {"first", "second"}) {
      write(folder / (std::string(name) + ".yaml"),
            "place: {source: place/tileset.json, center_local: [0, 0, 0], size: [10, 10, 10]}\n"
            "simulated:\n  render: {flight: flight.yaml}\n" +
                std::string(name == std::string("first") ? "real:\n  kind: surrogate\n  render: {flight: flight.yaml}\n"
                                                         : ""));
    }
    write(folder / "flight.yaml", "camera: camera.yaml\n");
    write(folder / "camera.yaml", "wide\n");
    for (const char* name : {"good", "bad"}) {
      write(folder / "adapters" / name / "adapter.yaml",
            "name: " + std::string(name) + "\ntakes: {inputs: [images], lenses: [any]}\nleaves: {map: m.ply}\n");
      write(folder / "adapters" / name / "run", "#!/bin/sh\n");
    }
    write(folder / "tileflight", kProgram);
    fs::permissions(folder / "tileflight", fs::perms::owner_all);
  }

  fs::path study(const std::string& text) const {
    write(folder / "study.yaml", text);
    return folder / "study.yaml";
  }

  static constexpr const char* kStudy = R"(name: test
repetitions: 2
places: {one: first.yaml, two: second.yaml}
systems:
  good: {adapter: adapters/good}
  bad: {adapter: adapters/bad}
)";
  /// Notes its calls in "calls" of the study's folder; runs of the system "bad" fail.
  static constexpr const char* kProgram = R"(#!/bin/sh
echo "$*" >> calls
while [ $# -gt 0 ]; do
  case $1 in
    run|odometry|align|evaluate|report) command=$1 ;;
    --out) out=$2; shift ;;
    --system) system=$2; shift ;;
  esac
  shift
done
[ -e fault ] && { echo "no disk" >&2; exit 3; }
case $command in
  run) for part in simulated real; do mkdir -p "$out/$part/dataset"; echo x > "$out/$part/dataset/dataset.yaml"; done
       mkdir -p "$out/truth"; echo '{}' > "$out/truth/extract.json" ;;
  odometry)
    mkdir -p "$out"
    case $system in *bad) completed=false; reason='exit status 1: lost' ;; *) completed=true; reason= ;; esac
    echo '{"frames": 10, "frames_tracked": 9, "points": 5, "system": {"applicable": true, "completed": '$completed',
      "reason": "'$reason'", "seconds": 2.5, "cpu_seconds": 4.5, "peak_memory_mb": 100}}' > "$out/odometry.json"
    [ $completed = true ] || { echo lost >&2; exit 1; }
    : > "$out/map.ply" ;;
  align) echo '{}' > "$out" ;;
  evaluate) echo '{"surface": {"f_score": {"0.2": 0.25}, "accuracy": {"0.2": 0.5}, "completeness": {"0.2": 0.2}, "median": 0.1},
      "trajectory": {"ate_rmse": 0.05}, "error_budget": {"alignment": {"metres": 0.01}}, "warnings": []}' > "$out" ;;
  report) echo '{}' > study.json; echo page > study.html ;;
esac
)";

  tests::TemporaryFolder folder;
};

}  // namespace tileflight::study::test_support
