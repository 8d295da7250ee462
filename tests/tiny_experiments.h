#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

#include "tests/run_program.h"
#include "tests/shared_result.h"
#include "tests/tiny_place.h"

namespace tileflight::tests {

/// Two small experiments over TinyPlace with their finished runs: of two flights, and of one with a barometer.
class TinyExperiments {
 public:
  static constexpr const char* kTwoFlights = R"(name: tiny
place:
  source: place/tileset.json
  center_local: [0, 0, 100]
  size: [80, 80, 20]
truth: {voxel: 1.0}
alignment: {start: true-poses}
simulated:
  render: {flight: flight.yaml, outputs: "visibility, photometric"}
real:
  kind: surrogate
  render: {flight: flight.yaml, resolution: [256, 192]}
)";

  /// Aligned by the map's points alone, at an eighth of the cost of pictures of the place: for tests of what is done
  /// when, in what order, and of what is kept.
  static constexpr const char* kOneFlight = R"(name: tiny
place: {source: place/tileset.json, center_local: [0, 0, 100], size: [80, 80, 20]}
alignment: {start: true-poses, method: point-to-mesh}
simulated:
  render: {flight: flight.yaml}
)";

  /// The first experiment without its second flight.
  static std::string without_real() {
    const std::string text = kTwoFlights;
    return text.substr(0, text.find("real:"));
  }

  /// Returns the experiment with maps that are aligned as kOneFlight's are.
  static std::string aligned_by_points(std::string experiment) {
    const std::string start = "start: true-poses";
    return experiment.insert(experiment.find(start) + start.size(), ", method: point-to-mesh");
  }

  /// Frames of each flight of the two experiments: enough for a map and all its scores.
  static constexpr int kFramesOfTwo = 50, kFramesOfOne = 45;

  /// A flight of so many frames across the middle of the place.
  static std::string flight(int frames, const std::string& more = "") {
    return "camera: camera.yaml\n" + more + R"(fps: 10
speed_m_s: 4
acceleration_m_s2: 4
max_frames: )" +
           std::to_string(frames) + R"(
waypoints:
  - {position: [-18, -12, 116], yaw_deg: 55, pitch_deg: -45}
  - {position: [0, 2, 117], yaw_deg: 60, pitch_deg: -45}
  - {position: [18, 10, 116], yaw_deg: 70, pitch_deg: -45}
)";
  }

  /// Place, camera.yaml, flight.yaml and experiment.yaml.
  static void write_two_flights(const std::filesystem::path& folder) {
    write(folder, flight(kFramesOfTwo), kTwoFlights);
  }
  /// Writes one flight and sensors.yaml.
  static void write_one_flight(const std::filesystem::path& folder) {
    write(folder, flight(kFramesOfOne, "sensors_file: sensors.yaml\n"), kOneFlight);
    TinyPlace::write_file(folder / "sensors.yaml", "barometer: {rate_hz: 10}\n");
  }

  /// Both hold the run in "out", and what it printed in "printed.json" and "progress.txt".
  static SharedResult two_flights() { return {"two-flights", make<write_two_flights>}; }
  static SharedResult one_flight() { return {"one-flight", make<write_one_flight>}; }

 private:
  static void write(const std::filesystem::path& folder, const std::string& flight, const std::string& experiment) {
    TinyPlace::write(folder / "place");
    TinyPlace::write_file(folder / "camera.yaml", TinyPlace::kCamera);
    TinyPlace::write_file(folder / "flight.yaml", flight);
    TinyPlace::write_file(folder / "experiment.yaml", experiment);
  }

  template <void (*write_inputs)(const std::filesystem::path&)>
  static void make(const std::filesystem::path& folder) {
    std::filesystem::create_directories(folder);
    write_inputs(folder);
    const ProgramResult result = run_tileflight(
        {"run", (folder / "experiment.yaml").string(), "--out", (folder / "out").string(), "--json", "--threads", "2"});
    if (result.exit_code != 0) throw std::runtime_error("tileflight run: " + result.err);
    TinyPlace::write_file(folder / "printed.json", result.out);
    TinyPlace::write_file(folder / "progress.txt", result.err);
  }
};

}  // namespace tileflight::tests
