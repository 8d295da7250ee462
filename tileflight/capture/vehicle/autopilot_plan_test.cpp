#include "tileflight/capture/vehicle/autopilot_plan.h"

#include <gmock/gmock.h>

#include <fstream>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"

namespace tileflight::vehicle::autopilot_plan_test {
namespace {

using testing::HasSubstr;

class AutopilotPlanFile : public testing::Test {
 protected:
  AutopilotPlan read(const std::string& text) {
    const auto file = folder_ / "flight.yaml";
    std::ofstream(file) << text;
    base::StrictSection section = base::StrictSection::load(file);
    return read_autopilot_plan(section, file);
  }
  std::string fault(const std::string& text) {
    return tests::refusal_of([&] { read(text); });
  }
  tests::TemporaryFolder folder_;
};

TEST_F(AutopilotPlanFile, VisionIsOffUnlessAskedFor) {
  const AutopilotPlan plain = read("kind: px4\n");
  EXPECT_TRUE(plain.gnss);
  EXPECT_EQ(plain.vision.source, VisionPlan::Source::kNone);
  EXPECT_EQ(read("kind: px4\nvision: {source: truth}\n").vision.source, VisionPlan::Source::kTruth);
}

TEST_F(AutopilotPlanFile, VisionHasACameraOfItsOwn) {
  const AutopilotPlan plan = read(
      "kind: px4\ngnss: false\nvision: {source: odometry, rate_hz: 20, latency_s: 0.05, width: 400, height: 300, "
      "fov_deg: 120, pitch_deg: -60, offset_m: [0.1, 0.2, -0.05]}\n");
  EXPECT_FALSE(plan.gnss);
  EXPECT_EQ(plan.vision.source, VisionPlan::Source::kOdometry);
  EXPECT_EQ(plan.vision.rate_hz, 20.0);
  EXPECT_EQ(plan.vision.latency_s, 0.05);
  EXPECT_EQ(plan.vision.width, 400);
  EXPECT_EQ(plan.vision.height, 300);
  EXPECT_EQ(plan.vision.fov_deg, 120.0);
  EXPECT_EQ(plan.vision.pitch_deg, -60.0);
  EXPECT_EQ(plan.vision.offset_m, geometry::Vec3(0.1, 0.2, -0.05));
}

TEST_F(AutopilotPlanFile, VisionIsLocatedInTilesBesideTheFileOrElsewhere) {
  const auto tiles_of = [&](const std::string& tiles) {
    const VisionPlan vision = read("kind: px4\nvision: {source: place" + tiles + "}\n").vision;
    EXPECT_EQ(vision.source, VisionPlan::Source::kPlace);
    return vision.tiles;
  };
  EXPECT_EQ(tiles_of(""), "");
  EXPECT_EQ(tiles_of(", tiles: 'ion:1234'"), "ion:1234");
}

TEST_F(AutopilotPlanFile, WhatItCannotBeIsRefused) {
  EXPECT_THAT(fault("kind: px4\nvision: {source: odometry, tiles: place}\n"), HasSubstr("is of source: place only"));
  EXPECT_THAT(fault("kind: ardupilot\nvision: {source: odometry}\n"), HasSubstr("px4 only"));
  EXPECT_THAT(fault("kind: ardupilot\ngnss: false\n"), HasSubstr("px4 only"));
  EXPECT_THAT(fault("kind: px4\nvision: {source: gps}\n"), HasSubstr("odometry"));
  EXPECT_THAT(fault("kind: px4\nvision: {width: 10}\n"), HasSubstr("64"));
  EXPECT_THAT(fault("kind: px4\nvision: {rate_hz: 0}\n"), HasSubstr("from 1 to 125"));
  EXPECT_THAT(fault("kind: px4\nvision: {latency_s: 2}\n"), HasSubstr("from 0 to 1"));
  EXPECT_THAT(fault("kind: px4\nvision: {camera: belly}\n"), HasSubstr("camera"));
}

}  // namespace
}  // namespace tileflight::vehicle::autopilot_plan_test
