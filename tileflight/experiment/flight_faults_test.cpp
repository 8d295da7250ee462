#include "tileflight/experiment/flight_faults.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tileflight::experiment {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(FlightFaults, RunsOfFramesGoThereAndBack) {
  EXPECT_EQ(frame_runs({}), "");
  EXPECT_EQ(frame_runs({4}), "4");
  EXPECT_EQ(frame_runs({3, 4, 5, 6, 7, 12, 20, 21}), "3-7,12,20-21");
  EXPECT_THAT(frames_of_runs("3-7,12,20-21"), ElementsAre(3, 4, 5, 6, 7, 12, 20, 21));
  EXPECT_THAT(frames_of_runs(""), IsEmpty());
  EXPECT_THAT(frames_of_runs("x,2,-3,5-,7-99999999999,9-8"), ElementsAre(2)) << "what is no run is left out";
}

TEST(FlightFaults, WhatADatasetSaysIsReadBack) {
  const std::vector<sensors::FlightFault> faults{{"camera_inside_surface", "", {2, 3, 4}},
                                                 {"path_through_surface", "", {1, 4}}};
  const auto about = described_faults(faults);
  EXPECT_EQ(about.at("warnings.camera_inside_surface"), "2-4");
  EXPECT_EQ(about.at("warnings.path_through_surface"), "1,4");
  const auto read = recorded_faults(about);
  ASSERT_EQ(read.size(), 2U);
  EXPECT_EQ(read[0].key, "camera_inside_surface");
  EXPECT_THAT(read[0].frames, ElementsAre(2, 3, 4));
  EXPECT_EQ(read[1].what, "the path to the next frame goes through a surface");
  EXPECT_TRUE(described_faults({}).empty());
  EXPECT_TRUE(
      recorded_faults({{"made_by", "x"}, {"warnings.other", "3"}, {"warnings.path_through_surface", "no"}}).empty());
}

}  // namespace
}  // namespace tileflight::experiment
