#include "tileflight/capture/events/dsec_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"

namespace tileflight::events::dsec_file_test {
namespace {

using testing::HasSubstr;

/// The times of DSEC's own example of ms_to_idx (scripts/utils/eventslicer.py of its repository).
std::vector<Event> example() {
  std::vector<Event> events;
  for (const std::uint32_t t_us : {0U, 500U, 2100U, 5000U, 5000U, 7100U, 7200U, 7200U, 8100U, 9000U})
    events.push_back({t_us, static_cast<std::uint16_t>(t_us % 640), static_cast<std::uint16_t>(t_us % 480),
                      static_cast<std::uint8_t>(t_us % 3 == 0)});
  return events;
}

std::vector<Event> many(std::size_t count) {
  std::vector<Event> events;
  for (std::uint32_t i = 0; i < count; ++i)
    events.push_back({i * 7, static_cast<std::uint16_t>(i * 31 % 640), static_cast<std::uint16_t>(i * 17 % 480),
                      static_cast<std::uint8_t>(i % 2)});
  return events;
}

TEST(DsecFile, IndexIsThatOfItsOwnExample) {
  const tests::TemporaryFolder folder;
  DsecWriter writer(folder.path() / "events.h5");
  writer.add(example());
  writer.finish(123456789012, 9500);
  const EventRecording read = read_dsec_file(folder.path() / "events.h5");
  EXPECT_EQ(read.events, example());
  EXPECT_EQ(read.t_offset_us, 123456789012);
  // Ours goes on to the end of the recording.
  EXPECT_EQ(read.ms_to_idx, (std::vector<std::uint64_t>{0, 2, 2, 3, 3, 3, 5, 5, 8, 9, 10}));
}

TEST(DsecFile, BytesDoNotDependOnHowEventsCome) {
  const tests::TemporaryFolder folder;
  const std::vector<Event> events = many(200000);
  DsecWriter at_once(folder.path() / "a.h5"), in_parts(folder.path() / "b.h5");
  at_once.add(events);
  for (std::size_t k = 0; k < events.size(); k += 333)
    in_parts.add(std::span(events).subspan(k, std::min<std::size_t>(333, events.size() - k)));
  at_once.finish(0, 1400000);
  in_parts.finish(0, 1400000);
  EXPECT_EQ(base::read_text(folder.path() / "a.h5"), base::read_text(folder.path() / "b.h5"));
  EXPECT_EQ(read_dsec_file(folder.path() / "b.h5").events, events);
}

TEST(DsecFile, MayHoldNoEvent) {
  const tests::TemporaryFolder folder;
  DsecWriter(folder.path() / "events.h5").finish(-5, 2001);
  const EventRecording read = read_dsec_file(folder.path() / "events.h5");
  EXPECT_TRUE(read.events.empty());
  EXPECT_EQ(read.t_offset_us, -5);
  EXPECT_EQ(read.ms_to_idx, (std::vector<std::uint64_t>{0, 0, 0, 0}));
}

TEST(DsecFile, BadFilesAreNamed) {
  const tests::TemporaryFolder folder;
  const auto file = folder.path() / "events.h5";
  EXPECT_THAT(tests::refusal_of([&] { read_dsec_file(file); }), HasSubstr("events.h5"));
  base::write_file(file, "no HDF5");
  EXPECT_THAT(tests::refusal_of([&] { read_dsec_file(file); }), HasSubstr("events.h5: HDF5 failed: "));
  DsecWriter writer(folder.path() / "whole.h5");
  writer.add(many(70000));
  writer.finish(0, 490000);
  const std::string bytes = base::read_text(folder.path() / "whole.h5");
  for (std::size_t size = 0; size < bytes.size(); size += bytes.size() / 23) {
    base::write_file(file, bytes.substr(0, size));
    EXPECT_THAT(tests::refusal_of([&] { read_dsec_file(file); }), HasSubstr("events.h5"));
  }
  EXPECT_THAT(tests::refusal_of([&] { read_dsec_file(folder.path() / "whole.h5", 100); }), HasSubstr("more than 100"));
  EXPECT_THAT(tests::refusal_of([&] { DsecWriter(folder.path() / "none" / "events.h5"); }), HasSubstr("HDF5 failed"));
}

}  // namespace
}  // namespace tileflight::events::dsec_file_test

namespace tileflight::events::dsec_export_test {
namespace {

namespace fs = std::filesystem;
using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;

TEST(RectifyMap, OfAPinholeIsTheIdentity) {
  const imaging::Camera camera = imaging::make_pinhole(33, 21, 70.0);
  const auto map = rectify_map(camera, rectified_camera(camera), Mat3::Identity());
  for (int y = 0; y < 21; ++y) {
    for (int x = 0; x < 33; ++x) {
      EXPECT_NEAR(map(x, y)[0], x, 1e-4);
      EXPECT_NEAR(map(x, y)[1], y, 1e-4);
    }
  }
}

TEST(RectifyMap, OfAFisheyeIsThatOfItsRays) {
  const imaging::Camera camera = imaging::make_fisheye(64, 64, 200.0);
  const auto map = rectify_map(camera, rectified_camera(camera), Mat3::Identity());
  const double focal_px = 64.0 / (200.0 * M_PI / 180.0);  // equidistant: pixels a radian
  int outside = 0;
  for (int x = 0; x < 64; ++x) {
    const double angle = (x - 31.5) / focal_px, row = 0.5 / focal_px, theta = std::hypot(angle, row);
    if (theta > 0.99 * M_PI / 2.0) {
      ++outside;
    } else {
      EXPECT_NEAR(map(x, 32)[0], 31.5 + focal_px * std::tan(theta) * angle / theta, 0.02 * std::exp(theta));
    }
  }
  EXPECT_GT(outside, 4);
  EXPECT_TRUE(std::isnan(map(0, 0)[0]));
}

TEST(RectifyingRotations, PutAPointIntoOneRow) {
  const SE3 T_left_right(geometry::so3_exp(Vec3(0.05, -0.1, 0.2)), Vec3(0.5, 0.04, -0.1));
  const auto rotations = rectifying_rotations(T_left_right);
  for (const Vec3& point : {Vec3(1, 2, 9), Vec3(-3, 0.5, 4), Vec3(0, -2, 30)}) {
    const Vec3 left = rotations[0] * point, right = rotations[1] * (T_left_right.inverse() * point);
    EXPECT_NEAR(left.y() / left.z(), right.y() / right.z(), 1e-12);
    EXPECT_NEAR((left - right).x(), T_left_right.translation.norm(), 1e-12);
  }
  EXPECT_TRUE(rectifying_rotations(SE3(Mat3::Identity(), Vec3(0.3, 0, 0)))[0].isIdentity(1e-12));
}

/// A dataset of one camera with two pictures and three events.
fs::path dataset_with_events(const fs::path& folder) {
  dataset::DatasetWriter writer(folder, {imaging::make_pinhole(32, 24, 70.0), {}, 0.0}, {});
  for (std::size_t i = 0; i < 2; ++i) writer.add_frame(i, 2.5 + 0.1 * static_cast<double>(i), 0.0, {32, 24});
  DsecWriter events(writer.temporary_folder() / "events.h5");
  events.add(std::vector<Event>{{5, 1, 2, 1}, {99, 31, 23, 0}, {70000, 4, 4, 1}});
  events.finish(2500000, 100000);
  writer.finish();
  return folder;
}

TEST(DsecExport, HoldsEventsPicturesAndMaps) {
  const tests::TemporaryFolder folder;
  const dataset::Rig rig = dataset::read_rig(dataset_with_events(folder / "dataset"));
  const exports::ExportResult result = export_dsec(rig, folder / "dsec", false);
  EXPECT_EQ(result.frames, 2U);
  EXPECT_EQ(read_dsec_file(folder / "dsec" / "events" / "left" / "events.h5").events.size(), 3U);
  EXPECT_TRUE(fs::exists(folder / "dsec" / "events" / "left" / "rectify_map.h5"));
  EXPECT_FALSE(fs::exists(folder / "dsec" / "events" / "right"));
  EXPECT_TRUE(fs::exists(folder / "dsec" / "images" / "left" / "distorted" / "000001.png"));
  EXPECT_TRUE(fs::exists(folder / "dsec" / "calibration" / "left.yaml"));
  EXPECT_EQ(base::read_text(folder / "dsec" / "images" / "timestamps.txt"), "2500000\n2600000\n");
  EXPECT_THAT(result.notes, testing::ElementsAre(testing::HasSubstr("true poses")));
}

TEST(DsecExport, KeepsTheWarningsOfTheDataset) {
  const tests::TemporaryFolder folder;
  fs::remove(dataset_with_events(folder / "dataset") / "times.txt");
  const dataset::Rig rig = dataset::read_rig(folder / "dataset");
  EXPECT_THAT(export_dsec(rig, folder / "dsec", false).notes,
              testing::ElementsAre(testing::HasSubstr("no times.txt"), testing::HasSubstr("true poses")));
}

TEST(DsecExport, NeedsEvents) {
  const tests::TemporaryFolder folder;
  fs::remove(dataset_with_events(folder / "dataset") / "events.h5");
  const dataset::Rig rig = dataset::read_rig(folder / "dataset");
  EXPECT_THAT(tests::refusal_of([&] { export_dsec(rig, folder / "dsec", false); }),
              testing::HasSubstr("has no events.h5; render the flight with 'events'"));
  EXPECT_FALSE(fs::exists(folder / "dsec"));
}

}  // namespace
}  // namespace tileflight::events::dsec_export_test
