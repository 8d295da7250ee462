// `render` of flights with event cameras: what is recorded, refused, and the same for any number of threads, processes
// and parts.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "tests/render_command.h"
#include "tests/run_program.h"
#include "tests/same_files.h"
#include "tests/source_folder.h"
#include "tests/tiny_city.h"
#include "tests/tiny_place.h"
#include "tileflight/capture/events/dsec_file.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/dataset.h"

namespace tileflight::events_test {
namespace {

using testing::HasSubstr;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyCity;
using tests::TinyPlace;

/// 64 x 48 pixels.
constexpr const char* kCamera = R"(cam0:
  camera_model: pinhole
  intrinsics: [40.0, 40.0, 31.5, 23.5]
  distortion_model: equidistant
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  resolution: [64, 48]
)";
constexpr const char* kPath = R"(fps: 1
speed_m_s: 60
acceleration_m_s2: 60
yaw_rate_deg_s: 40
waypoints:
  - {position: [-450, -300, 160], yaw_deg: 90, pitch_deg: -40}
  - {position: [150, -290, 170], yaw_deg: 60, pitch_deg: -30}
  - {position: [-200, -100, 165], yaw_deg: 100, pitch_deg: -35}
)";
constexpr const char* kEvents =
    "{positive_threshold: 0.05, negative_threshold: 0.05, threshold_sigma: 0.005, "
    "leak_rate_hz: 0.1, shot_noise_rate_hz: 0.5}";

class Events : public testing::Test {
 protected:
  Events() {
    TinyCity::write(folder_ / "place");
    TinyPlace::write_file(folder_ / "camera.yaml", kCamera);
    write_flight(kEvents);
  }
  void write_flight(const std::string& events, const std::string& more = "max_frames: 9\n") const {
    TinyPlace::write_file(folder_ / "flight.yaml",
                          "camera: camera.yaml\n" + (events.empty() ? "" : "events: " + events + "\n") + kPath + more);
  }
  void write_rig(const std::string& of_right) const {
    TinyPlace::write_file(folder_ / "flight.yaml",
                          std::string("cameras:\n- {name: left, camera: camera.yaml, events: ") + kEvents +
                              "}\n- {name: right, camera: camera.yaml, position: [2, 0, 0]" + of_right +
                              "}\nmax_frames: 9\n" + kPath);
  }
  std::vector<std::string> arguments(const std::string& out, const std::vector<std::string>& more) const {
    return tests::render_words(folder_.path(), out, more);
  }
  nlohmann::json render(const std::string& out, const std::vector<std::string>& more = {}) const {
    return tests::render_json(folder_.path(), out, more);
  }
  events::EventRecording recording(const std::string& dataset) const {
    return events::read_dsec_file(folder_ / dataset / "events.h5");
  }
  /// The one line with which a flight is refused.
  std::string refusal(const std::vector<std::string>& more = {}) const {
    const ProgramResult result = run_tileflight(arguments("wrong", more));
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << result.err;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "wrong"));
    return result.err;
  }

  tests::TemporaryFolder folder_;
};

TEST_F(Events, AreTheSameInPartsThreadsAndProcesses) {
  write_flight(kEvents, "");  // of several parts
  EXPECT_GT(render("whole", {"--threads", "1", "--memory", "1"})["events"], 5000);
  EXPECT_GT(render("parts", {"--threads", "2", "--memory", "0.02"})["parts"], 1);
  tests::expect_same_files(folder_ / "whole", folder_ / "parts");
  for (const char* range : {"0:4", "9:14"}) {
    ASSERT_EQ(run_tileflight(arguments("resumed", {"--frames", range})).exit_code, 0);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "resumed"));
  }
  EXPECT_GT(render("resumed", {"--resume"})["frames_taken_up"], 5);
  tests::expect_same_files(folder_ / "whole", folder_ / "resumed");
}

TEST_F(Events, AreRecordedBesidePicturesThatStayTheSame) {
  const nlohmann::json summary = render("seeing");
  const events::EventRecording found = recording("seeing");
  EXPECT_EQ(summary["events"], found.events.size());
  EXPECT_THAT(tests::file_text(folder_ / "seeing" / "dataset.yaml"),
              testing::AllOf(HasSubstr("file: \"events.h5\""),
                             HasSubstr("positive_threshold: 0.05, negative_threshold: 0.05")));
  const dataset::Dataset pictures = dataset::read_dataset(folder_ / "seeing");
  EXPECT_EQ(found.t_offset_us, static_cast<std::int64_t>(std::floor(1e6 * pictures.frames.front().time_s)));
  const double end_us = 1e6 * (pictures.frames.back().time_s - pictures.frames.front().time_s);
  EXPECT_LE(found.events.back().t_us, end_us);
  EXPECT_GT(found.events.back().t_us, end_us - 1e5);
  EXPECT_EQ(static_cast<double>(found.ms_to_idx.size()), std::ceil(end_us / 1000.0) + 1.0);
  const std::vector<std::string> region{"--center-local", "0,0,100", "--size", "1280,1280,100"};
  render("events", region);
  write_flight("");
  render("none", region);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "none" / "events.h5"));
  for (const char* file : {"images/000003.jpg", "groundtruth.txt", "times.txt"})
    EXPECT_EQ(tests::file_text(folder_ / "events" / file), tests::file_text(folder_ / "none" / file)) << file;
}

TEST_F(Events, AreReadByPythonsUsersOfDsec) {
  render("seeing");
  const ProgramResult read =
      tests::run_command({"/usr/bin/python3", (tests::source_folder() / "tests" / "events" / "check_dsec.py").string(),
                          (folder_ / "seeing" / "events.h5").string()});
  if (read.exit_code == 77) GTEST_SKIP() << read.out;
  EXPECT_EQ(read.exit_code, 0) << read.err;
  const events::EventRecording found = recording("seeing");
  EXPECT_THAT(read.out, testing::StartsWith(std::to_string(found.events.size()) + " 64 48 "));
}

/// The events of a pixel add up to the change of its light between two images, within one threshold.
TEST_F(Events, AddUpToTheChangeBetweenPictures) {
  write_flight(
      "{positive_threshold: 0.05, negative_threshold: 0.05, threshold_sigma: 0, refractory_s: 0, leak_rate_hz: "
      "0, shot_noise_rate_hz: 0, max_motion_px: 0.2}");
  render("seeing", {"--png"});
  const events::EventRecording found = recording("seeing");
  const dataset::Dataset pictures = dataset::read_dataset(folder_ / "seeing");
  const auto rgb_at = [&](std::size_t frame) { return imaging::read_rgb(pictures.frames[frame].image); };
  const imaging::RgbImage first = rgb_at(0), last = rgb_at(5);
  const auto log_light = [](const imaging::Rgb8& rgb) {
    const auto linear = [&](std::size_t c) {
      const double v = rgb[c] / 255.0;
      return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
    };
    return std::log(0.2126 * linear(0) + 0.7152 * linear(1) + 0.0722 * linear(2) + 0.001);
  };
  std::vector<double> sum(64 * 48, 0.0);
  const double until_us = 1e6 * (pictures.frames[5].time_s - pictures.frames[0].time_s);
  for (const events::Event& event : found.events) {
    if (event.t_us <= until_us) sum[event.y * 64U + event.x] += event.polarity == 1 ? 0.05 : -0.05;
  }
  double largest = 0.0;
  for (std::size_t pixel = 0; pixel < sum.size(); ++pixel) {
    const auto &before = first.pixels[pixel], &after = last.pixels[pixel];
    const double change = log_light(after) - log_light(before);
    largest = std::max(largest, std::abs(change));
    // Half a grey level of each colour, both times: d ln L = 2.4 dv / v.
    const auto rounding = [](const imaging::Rgb8& rgb) { return 1.3 / *std::ranges::min_element(rgb); };
    EXPECT_NEAR(sum[pixel], change, 0.0501 + rounding(before) + rounding(after)) << pixel;
  }
  EXPECT_GT(largest, 0.3);
}

TEST_F(Events, EachCameraOfARigHasItsOwn) {
  write_rig(std::string(", events: ") + kEvents);
  render("rig");
  const ProgramResult tasks = run_tileflight(arguments("tasks", {"--jobs", "2", "--no-snakemake"}));
  ASSERT_EQ(tasks.exit_code, 0) << tasks.err;
  tests::expect_same_files(folder_ / "rig", folder_ / "tasks");
  const events::EventRecording left = recording("rig"), right = recording("rig/cameras/right");
  EXPECT_GT(right.events.size(), 5000U);
  EXPECT_NE(left.events, right.events);
  const std::vector<std::string> region{"--center-local", "0,0,100", "--size", "1280,1280,100"};
  write_rig("");
  render("one", region);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "one" / "cameras" / "right" / "events.h5"));
  write_flight(kEvents);
  render("alone", region);
  EXPECT_EQ(recording("alone").events, recording("one").events);
}

TEST_F(Events, AreExportedAsASequenceOfDsec) {
  write_rig(std::string(", events: ") + kEvents);
  render("rig");
  const auto exported = [&](const std::string& dataset, const std::string& out) {
    return run_tileflight(
        {"export", (folder_ / dataset).string(), "--layout", "dsec", "--out", (folder_ / out).string()});
  };
  const ProgramResult result = exported("rig", "dsec");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::filesystem::path events = folder_ / "dsec" / "events";
  EXPECT_EQ(tests::file_text(events / "right" / "events.h5"),
            tests::file_text(folder_ / "rig" / "cameras" / "right" / "events.h5"));
  for (const char* side : {"left", "right"}) {
    const ProgramResult read = tests::run_command(
        {"/usr/bin/python3", (tests::source_folder() / "tests" / "events" / "check_dsec.py").string(),
         (events / side / "events.h5").string(), (events / side / "rectify_map.h5").string()});
    EXPECT_TRUE(read.exit_code == 0 || read.exit_code == 77) << read.err;
  }
  write_flight("");
  render("none");
  const ProgramResult refused = exported("none", "wrong");
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, HasSubstr("has no events.h5; render the flight with 'events'"));
}

TEST_F(Events, WhatMovesIsSeen) {
  const std::string still = "{threshold_sigma: 0, leak_rate_hz: 0, shot_noise_rate_hz: 0}";
  const std::string hover = R"(camera: camera.yaml
trajectory: path.txt
)";
  TinyPlace::write_file(folder_ / "path.txt", "0 0 0 130 1 0 0 0\n0.5 0 0 130 1 0 0 0\n1 0 0 130 1 0 0 0\n");
  TinyPlace::write_file(folder_ / "flight.yaml", hover + "events: " + still + "\n");
  EXPECT_EQ(render("still")["events"], 0);
  TinyPlace::write_file(
      folder_ / "flight.yaml",
      hover + "events: " + still + "\nactors:\n- {model: car, path: [{at: [-8, 0]}, {at: [8, 0]}], speed_m_s: 12}\n");
  EXPECT_GT(render("car")["events"], 200);
}

TEST_F(Events, WhatIsWrongIsNamedInOneLine) {
  const auto with = [&](const std::string& events) {
    write_flight(events);
    return refusal();
  };
  EXPECT_THAT(with("{positive_threshold: 0}"), HasSubstr("'events.positive_threshold' is 0, out of range"));
  EXPECT_THAT(with("{negative_threshold: -0.2}"), HasSubstr("events.negative_threshold"));
  EXPECT_THAT(with("{refractory_s: -1}"), HasSubstr("events.refractory_s"));
  EXPECT_THAT(with("{threshold: 0.2}"), HasSubstr("did you mean"));
  EXPECT_THAT(with("{leak_rate_hz: .nan}"), HasSubstr("leak_rate_hz"));
  EXPECT_THAT(with("dvs"), HasSubstr("events"));
  EXPECT_THAT(with("{positive_threshold: 0.01, max_rate_hz: 0.5}"),
              HasSubstr("events: more than 0.5 a second and pixel"));
  write_rig(", events: {max_rate_hz: 0.001}");
  EXPECT_THAT(refusal(), HasSubstr("camera right: events: more than 0.001"));
  TinyPlace::write_file(folder_ / "flight.yaml",
                        std::string("cameras: [{name: a, camera: camera.yaml}]\nevents: {}\n") + kPath);
  EXPECT_THAT(refusal(), HasSubstr("of a rig stands in the entry of its camera"));
  write_flight(kEvents);
  EXPECT_THAT(refusal({"--memory", "0.001"}), HasSubstr("memory"));
}

}  // namespace
}  // namespace tileflight::events_test
