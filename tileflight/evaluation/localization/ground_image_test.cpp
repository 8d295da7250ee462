#include "tileflight/evaluation/localization/ground_image.h"

#include <gtest/gtest.h>

namespace tileflight::localization::ground_image_test {
namespace {

using geometry::Vec2;
using imaging::GrayImage;

TEST(GroundImage, PositionsAndPixelsAreInverse) {
  const GroundImage image{.grey = {}, .seen = {}, .height = {}, .pixel_size = 0.25, .origin = Vec2(10.0, 20.0)};
  EXPECT_EQ(image.position(0, 0), Vec2(10.0, 20.0));
  EXPECT_EQ(image.position(4, 8), Vec2(11.0, 18.0));  // right is east, down is south
  EXPECT_LT((image.to_pixel(image.position(3.5, 1.25)) - Vec2(3.5, 1.25)).norm(), 1e-12);
}

TEST(GroundImage, HeightIsThatOfTheNearestSample) {
  GroundImage image{
      .grey = {}, .seen = {}, .height = imaging::FloatImage(3, 2), .pixel_size = 1.0, .origin = Vec2(0, 0)};
  image.height(1, 0) = 5.0F;
  image.height(2, 1) = std::nanf("");
  EXPECT_EQ(image.height_at(Vec2(5.9, -1.9)).value(), 5.0);
  EXPECT_EQ(image.height_at(Vec2(6.1, -1.9)).value(), 0.0);
  EXPECT_FALSE(image.height_at(Vec2(8.0, -4.0)));  // unknown
  EXPECT_FALSE(image.height_at(Vec2(11.0, 0.0)));  // outside
  EXPECT_FALSE(image.height_at(Vec2(0.0, 3.0)));
}

TEST(GroundImage, WhatWasSeenStaysAndTheRestIsBetweenIt) {
  GrayImage grey(61, 47), seen(61, 47);
  for (int y = 0; y < 47; ++y) {
    for (int x = 0; x < 61; ++x) {
      if (x >= 20 && x < 40) continue;
      grey(x, y) = x < 20 ? 60 : 180;
      seen(x, y) = 255;
    }
  }
  const GrayImage before = grey;
  fill_unseen(grey, seen);
  for (int y = 0; y < 47; ++y) {
    for (int x = 0; x < 61; ++x) {
      if (seen(x, y) != 0) {
        EXPECT_EQ(grey(x, y), before(x, y));
      }
      EXPECT_GE(grey(x, y), 60);
      EXPECT_LE(grey(x, y), 180);
    }
  }
  EXPECT_LT(grey(21, 20), grey(38, 20));
}

TEST(GroundImage, NothingSeenStaysAsItIs) {
  GrayImage grey(9, 7, 0);
  fill_unseen(grey, GrayImage(9, 7));
  for (const auto value : grey.pixels) EXPECT_EQ(value, 0);
  GrayImage none;
  fill_unseen(none, GrayImage());
}

}  // namespace
}  // namespace tileflight::localization::ground_image_test
