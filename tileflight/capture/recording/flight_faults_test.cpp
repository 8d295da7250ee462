#include "tileflight/capture/recording/flight_faults.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tileflight::recording::flight_faults_test {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(FlightFaults, RunsOfFramesGoThereAndBack) {
  EXPECT_EQ(format_frame_ranges({}), "");
  EXPECT_EQ(format_frame_ranges({4}), "4");
  EXPECT_EQ(format_frame_ranges({3, 4, 5, 6, 7, 12, 20, 21}), "3-7,12,20-21");
  EXPECT_THAT(parse_frame_ranges("3-7,12,20-21"), ElementsAre(3, 4, 5, 6, 7, 12, 20, 21));
  EXPECT_THAT(parse_frame_ranges(""), IsEmpty());
  EXPECT_THAT(parse_frame_ranges("x,2,-3,5-,7-99999999999,9-8"), ElementsAre(2)) << "what is no run is left out";
}

TEST(FlightFaults, WhatADatasetSaysIsReadBack) {
  const std::vector<render::FlightFault> faults{{"camera_inside_surface", "", {2, 3, 4}},
                                                {"path_through_surface", "", {1, 4}}};
  const auto about = faults_to_metadata(faults);
  EXPECT_EQ(about.at("warnings.camera_inside_surface"), "2-4");
  EXPECT_EQ(about.at("warnings.path_through_surface"), "1,4");
  const auto read = faults_from_metadata(about);
  ASSERT_EQ(read.size(), 2U);
  EXPECT_EQ(read[0].key, "camera_inside_surface");
  EXPECT_THAT(read[0].frames, ElementsAre(2, 3, 4));
  EXPECT_EQ(read[1].what, "the path to the next frame goes through a surface");
  EXPECT_TRUE(faults_to_metadata({}).empty());
  EXPECT_TRUE(faults_from_metadata({{"made_by", "x"}, {"warnings.other", "3"}, {"warnings.path_through_surface", "no"}})
                  .empty());
}

}  // namespace
}  // namespace tileflight::recording::flight_faults_test
