// All stages from tiles to scores give the same bytes whatever a processor has. Variants of libraries that can be
// forced on one machine stand for other processors.

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>
#include <vector>

#include "tests/same_files.h"
#include "tests/temporary_folder.h"
#include "tests/tiny_experiments.h"

namespace tileflight::processors_test {
namespace {

namespace fs = std::filesystem;
using tests::TinyExperiments;
using tests::TinyPlace;

/// A stereo pair with an inertial unit and every other sensor, in rain and fog.
constexpr const char* kRig = R"(cameras:
  - {name: left, camera: camera.yaml}
  - {name: right, camera: camera.yaml, position: [0.4, 0, 0]}
weather: {rain_mm_per_h: 5, fog_visibility_m: 400}
sensors:
  imu: {rate_hz: 200}
  barometer: {}
  magnetometer: {year: 2026.5}
  range_finder: {}
  lidar: {pattern: raster, columns: 20, rows: 10, horizontal_fov_deg: 60, vertical_fov_deg: 40, rate_hz: 8}
)";
constexpr const char* kEvents = "camera: camera.yaml\nevents: {leak_rate_hz: 0.1, shot_noise_rate_hz: 1}\n";
constexpr const char* kPath = R"(fps: 10
speed_m_s: 4
acceleration_m_s2: 4
waypoints:
  - {position: [-18, -12, 116], yaw_deg: 55, pitch_deg: -45}
  - {position: [0, 2, 117], yaw_deg: 60, pitch_deg: -45}
  - {position: [18, 10, 116], yaw_deg: 70, pitch_deg: -45}
)";
/// A second flight with everything that makes pictures worse, through a video.
constexpr const char* kExperiment = R"(name: all
place: {source: place/tileset.json, center_local: [0, 0, 100], size: [80, 80, 20]}
truth: {voxel: 1.0}
alignment: {start: true-poses}
simulated:
  render: {flight: flight.yaml, outputs: "visibility, photometric"}
real:
  kind: surrogate
  render:
    flight: flight.yaml
    degrade: {exposure_time: 0.01, exposure_samples: 3, line_delay: 0.00003, vignetting: 0.4, read_noise_electrons: 5,
              white_electrons: 6000, auto_exposure: {target: 0.3, time_constant: 0.3}, sharpening: 0.3, video_crf: 20}
  odometry: {loop_closure: true, estimate_line_delay: true}
)";

void write_inputs(const fs::path& folder) {
  TinyPlace::write(folder / "place");
  TinyPlace::write_file(folder / "camera.yaml", TinyPlace::kCamera);
  TinyPlace::write_file(folder / "flight.yaml", TinyExperiments::flight(TinyExperiments::kFramesOfTwo));
  TinyPlace::write_file(folder / "rig.yaml", std::string(kRig) + kPath + "max_frames: 30\n");
  TinyPlace::write_file(folder / "events.yaml", std::string(kEvents) + kPath + "max_frames: 4\n");
  TinyPlace::write_file(folder / "experiment.yaml", kExperiment);
}

/// Runs all stages in `folder` by `program`, a command line that may begin with variables of the environment.
void run_all_stages(const fs::path& folder, const std::string& program) {
  write_inputs(folder);
  const auto in = [&folder](const char* name) { return (folder / name).string(); };
  const std::vector<std::vector<std::string>> stages{
      {"run", in("experiment.yaml"), "--out", in("run")},
      {"render", in("place"), "--flight", in("rig.yaml"), "--out", in("rig"), "--outputs",
       "depth,range,normals,segmentation,infrared,flow,visibility"},
      {"render", in("place"), "--flight", in("events.yaml"), "--out", in("events")},
      {"odometry", in("rig"), "--mode", "stereo", "--out", in("stereo")},
      {"odometry", in("rig"), "--mode", "inertial", "--out", in("inertial")},
      {"odometry", in("rig"), "--mode", "stereo-inertial", "--out", in("stereo-inertial")},
  };
  for (std::vector<std::string> words : stages) {
    words.emplace_back("--quiet");
    const tests::ProgramResult result = tests::run_command(words, program);
    if (result.exit_code != 0) throw std::runtime_error(words[0] + " " + words[1] + ": " + result.err);
  }
}

tests::SharedResult usual() {
  return {"all-stages", [](const fs::path& folder) {
            fs::create_directories(folder);
            run_all_stages(folder, tests::shell_quoted(TILEFLIGHT_BINARY));
          }};
}

/// Files with times or the machine in them; what they state of the flight stands in the others.
bool holds_times(const std::string& file) {
  for (const char* name :
       {"report.html", "report.json", "results.json", "dataset.yaml", "odometry.json", "extract.json", ".file-hashes"})
    if (file.ends_with(name)) return true;
  return file.starts_with("run/stages/");
}

void expect_the_usual_bytes(const std::string& program) {
  const fs::path expected = usual().made();
  const tests::TemporaryFolder folder;
  run_all_stages(folder.path(), program);
  int compared = 0;
  for (const std::string& file : tests::files_of(folder.path())) {
    if (holds_times(file)) continue;
    EXPECT_TRUE(tests::file_text(folder / file) == tests::file_text(expected / file)) << file;
    ++compared;
  }
  EXPECT_GT(compared, 400);
}

struct Variant {
  const char* name;
  const char* environment;
};

class Processors : public testing::TestWithParam<Variant> {};

TEST_P(Processors, GiveTheSameBytes) {
  expect_the_usual_bytes(std::string(GetParam().environment) + " " + tests::shell_quoted(TILEFLIGHT_BINARY));
}

INSTANTIATE_TEST_SUITE_P(
    All, Processors,
    testing::Values(
        // Both spellings of the C library's features: of releases before 2.33 and after.
        Variant{"CLibraryWithoutFusedOperations",
                "GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable"},
        Variant{"EmbreeWithSse2", "TILEFLIGHT_EMBREE=isa=sse2"}, Variant{"JpegWithoutVectors", "JSIMD_FORCENONE=1"},
        Variant{"FfmpegWithoutVectors", "TILEFLIGHT_FFMPEG=0"},
        Variant{"BlasOfAnOldProcessor", "OPENBLAS_CORETYPE=Prescott OPENBLAS_NUM_THREADS=1"}),
    [](const auto& info) { return std::string(info.param.name); });

/// Another build: for another architecture or system, started as TILEFLIGHT_OTHER_PROGRAM says (.ci/arm64).
TEST(OtherPrograms, GiveTheSameBytes) {
  const char* const program = std::getenv("TILEFLIGHT_OTHER_PROGRAM");
  if (program == nullptr) GTEST_SKIP() << "TILEFLIGHT_OTHER_PROGRAM names no program";
  expect_the_usual_bytes(program);
}

}  // namespace
}  // namespace tileflight::processors_test
