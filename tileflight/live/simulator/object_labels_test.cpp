#include "tileflight/live/simulator/object_labels.h"

#include <gmock/gmock.h>

#include <set>
#include <vector>

namespace tileflight::simulator::object_labels_test {
namespace {

TEST(SegmentationIds, ThePaletteHasAirSimsColoursAndNoneTwice) {
  const auto& palette = segmentation_palette();
  EXPECT_EQ(palette[1], (imaging::Rgb8{153, 108, 6}));
  EXPECT_EQ(palette[2], (imaging::Rgb8{112, 105, 191}));
  EXPECT_EQ(palette[7], (imaging::Rgb8{115, 176, 195}));
  EXPECT_EQ(std::set<imaging::Rgb8>(palette.begin(), palette.end()).size(), 256U);
  EXPECT_EQ(default_segmentation_id("Ab1"), 5 + 97 + 98);
}

TEST(SegmentationIds, EverySegmentationIdHasAColourOfItsOwn) {
  std::vector<bool> used(1U << 24U);
  for (int id = 0; id <= kMaxSegmentationId; ++id) {
    const imaging::Rgb8 c = segmentation_colour(id);
    const std::size_t number = (std::size_t{c[0]} << 16U) | (std::size_t{c[1]} << 8U) | c[2];
    ASSERT_FALSE(used[number]) << id;
    used[number] = true;
  }
  EXPECT_EQ(segmentation_colour(7), segmentation_palette()[7]);
  EXPECT_EQ(segmentation_colour(-1), segmentation_palette()[0]);
}

}  // namespace
}  // namespace tileflight::simulator::object_labels_test
