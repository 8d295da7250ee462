#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/run_program.h"
#include "tests/shared_result.h"
#include "tests/tiny_experiments.h"
#include "tests/tiny_place.h"

namespace tileflight::tests {

/// Every stage on the tiny place: an experiment of two flights, the second through everything that makes pictures worse
/// and a video; a rig with all sensors and kinds of images in bad weather; an event camera; localization; odometry in
/// its four modes.
class AllStages {
 public:
  /// Runs them in `folder` by `program`, a command line that may begin with variables of the environment. Throws
  /// std::runtime_error.
  static void run(const std::filesystem::path& folder, const std::string& program) {
    std::filesystem::create_directories(folder);
    write_inputs(folder);
    const auto in = [&folder](const char* name) { return (folder / name).string(); };
    const std::vector<std::vector<std::string>> stages{
        {"run", in("experiment.yaml"), "--out", in("run")},
        {"render", in("place"), "--flight", in("rig.yaml"), "--out", in("rig"), "--outputs",
         "depth,range,normals,segmentation,infrared,flow,visibility", "--degrade", in("light.yaml"), "--origin",
         "35.3,-80.7,190"},
        {"render", in("place"), "--flight", in("events.yaml"), "--out", in("events")},
        {"odometry", in("rig"), "--mode", "stereo", "--out", in("stereo")},
        {"odometry", in("rig"), "--mode", "inertial", "--out", in("inertial")},
        {"odometry", in("rig"), "--mode", "stereo-inertial", "--out", in("stereo-inertial")},
    };
    for (std::vector<std::string> words : stages) {
      words.emplace_back("--quiet");
      const ProgramResult result = run_command(words, program);
      if (result.exit_code != 0) throw std::runtime_error(words[0] + " " + words[1] + ": " + result.err);
    }
  }

  /// Returns the results of this build's program, to which others are compared.
  static SharedResult usual() {
    return {"all-stages", [](const std::filesystem::path& folder) { run(folder, shell_quoted(TILEFLIGHT_BINARY)); }};
  }

 private:
  /// A stereo pair with an inertial unit and every other sensor, under sun and sky, in rain and fog.
  static constexpr const char* kRig = R"(cameras:
  - {name: left, camera: camera.yaml}
  - {name: right, camera: camera.yaml, position: [0.4, 0, 0]}
weather: {rain_mm_per_h: 5, fog_visibility_m: 400}
sensors:
  imu: {rate_hz: 200}
  barometer: {}
  magnetometer: {declination_deg: 2, inclination_deg: 64, strength_ut: 48}
  range_finder: {}
  lidar: {pattern: raster, columns: 20, rows: 10, horizontal_fov_deg: 60, vertical_fov_deg: 40, rate_hz: 8}
)";
  static constexpr const char* kEvents = "camera: camera.yaml\nevents: {leak_rate_hz: 0.1, shot_noise_rate_hz: 1}\n";
  static constexpr const char* kPath = R"(fps: 10
speed_m_s: 4
acceleration_m_s2: 4
waypoints:
  - {position: [-18, -12, 116], yaw_deg: 55, pitch_deg: -45}
  - {position: [0, 2, 117], yaw_deg: 60, pitch_deg: -45}
  - {position: [18, 10, 116], yaw_deg: 70, pitch_deg: -45}
)";
  /// A second flight with everything that makes pictures worse, through a video.
  static constexpr const char* kExperiment = R"(name: all
place: {source: place/tileset.json, center_local: [0, 0, 100], size: [80, 80, 20]}
truth: {voxel: 1.0}
alignment: {start: true-poses}
odometry: {loop_closure: true, estimate_line_delay: true}
simulated:
  render: {flight: flight.yaml, outputs: "visibility, photometric"}
real:
  kind: surrogate
  reference: tiles
  render:
    flight: flight.yaml
    degrade: {exposure_time: 0.01, exposure_samples: 3, line_delay: 0.00003, vignetting: 0.4, read_noise_electrons: 5,
              white_electrons: 6000, auto_exposure: {target: 0.3, time_constant: 0.3}, sharpening: 0.3, video_crf: 20}
)";

  static void write_inputs(const std::filesystem::path& folder) {
    TinyPlace::write(folder / "place");
    TinyPlace::write_file(folder / "camera.yaml", TinyPlace::kCamera);
    TinyPlace::write_file(folder / "flight.yaml", TinyExperiments::flight(TinyExperiments::kFramesOfTwo));
    TinyPlace::write_file(folder / "rig.yaml", std::string(kRig) + kPath + "max_frames: 30\n");
    TinyPlace::write_file(folder / "events.yaml", std::string(kEvents) + kPath + "max_frames: 4\n");
    TinyPlace::write_file(folder / "light.yaml", "light: {model: sun-and-sky, time: 2024-06-21T18:00:00Z}\n");
    TinyPlace::write_file(folder / "experiment.yaml", kExperiment);
  }
};

}  // namespace tileflight::tests
