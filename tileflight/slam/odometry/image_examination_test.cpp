#include "tileflight/slam/odometry/image_examination.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

namespace tileflight::odometry::image_examination_test {
namespace {

using imaging::GrayImage;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr int kWidth = 160, kHeight = 90;

/// Smooth texture of one of several scenes, seen at a position along a flight.
GrayImage view(double position, int scene = 0) {
  GrayImage image(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double u = x + position + 500.0 * scene, v = y;
      const double value = std::sin(0.083 * u) + std::sin(0.061 * v + 0.02 * u + 2.0 * std::sin(0.011 * u)) +
                           std::sin(0.037 * u * (1.0 + 0.3 * std::sin(0.5 * scene)) - 0.09 * v) +
                           std::sin(0.147 * u + 0.05 * v + 3.0 * std::cos(0.019 * u + scene));
      image(x, y) = static_cast<std::uint8_t>(128 + 28 * value);
    }
  }
  return image;
}

/// `images` of a flight, by their positions.
ImageReader reader_of(const std::vector<GrayImage>& images) {
  return [&images](std::size_t i) { return images[i]; };
}

std::vector<ImageSummary> summaries(const std::vector<GrayImage>& images) {
  return summarize_images(images.size(), reader_of(images));
}

std::vector<GrayImage> flight(int count, double step = 2.0) {
  std::vector<GrayImage> images;
  for (int i = 0; i < count; ++i) images.push_back(view(step * i));
  return images;
}

std::string name_of(std::size_t i) { return "f" + std::to_string(i); }

std::string fault_of(const std::vector<GrayImage>& images) {
  const auto fault = find_image_fault(summaries(images), name_of);
  return fault ? fault->cause : "";
}

TEST(ImageExamination, ACleanFlightHasNoFault) {
  const std::vector<GrayImage> images = flight(60);
  EXPECT_EQ(fault_of(images), "");
  EXPECT_TRUE(find_cuts(summaries(images)).empty());
  EXPECT_TRUE(find_static_pixels(images.size(), reader_of(images)).empty());
}

TEST(ImageExamination, EveryCutIsFound) {
  std::vector<GrayImage> images;
  for (int i = 0; i < 20; ++i) images.push_back(view(2.0 * i, 0));
  for (int i = 0; i < 30; ++i) images.push_back(view(2.0 * i, 3));
  for (int i = 0; i < 15; ++i) images.push_back(view(2.0 * i, 7));
  EXPECT_THAT(find_cuts(summaries(images)), ElementsAre(20U, 50U));
}

TEST(ImageExamination, WhatCoversTheLensForAWhileIsNoCut) {
  std::vector<GrayImage> images = flight(60, 1.0);
  for (std::size_t i = 30; i < 34; ++i) images[i] = view(0.0, 3);
  EXPECT_TRUE(find_cuts(summaries(images)).empty());
  for (std::size_t i = 30; i < 34; ++i) images[i] = GrayImage(kWidth, kHeight, 0);
  EXPECT_TRUE(find_cuts(summaries(images)).empty());
}

TEST(ImageExamination, TwelveBitsInSixteenAreNearlyBlack) {
  std::vector<GrayImage> images = flight(20);
  for (GrayImage& image : images)
    for (std::uint8_t& value : image.pixels) value /= 16;
  EXPECT_THAT(fault_of(images), HasSubstr("the images are nearly black (largest value 1"));
}

TEST(ImageExamination, WhiteAndFlatImagesAreTold) {
  EXPECT_THAT(fault_of(std::vector<GrayImage>(20, GrayImage(kWidth, kHeight, 255))),
              HasSubstr("nearly white (smallest value 255 of 255)"));
  EXPECT_THAT(fault_of(std::vector<GrayImage>(20, GrayImage(kWidth, kHeight, 120))), HasSubstr("without contrast"));
}

TEST(ImageExamination, NamesWithoutPaddingAreAWrongOrder) {
  std::vector<std::pair<std::string, GrayImage>> named;
  for (int i = 1; i <= 60; ++i) named.emplace_back(std::to_string(i), view(2.0 * i));
  std::ranges::sort(named, {}, &std::pair<std::string, GrayImage>::first);
  std::vector<GrayImage> images;
  for (auto& [name, image] : named) images.push_back(std::move(image));
  EXPECT_THAT(fault_of(images), HasSubstr("not in the order"));
}

TEST(ImageExamination, BlankImagesAreNamedByTheirPlace) {
  std::vector<GrayImage> images = flight(60);
  for (std::size_t i = 0; i < 12; ++i) images[i] = GrayImage(kWidth, kHeight, 2);
  images[30] = GrayImage(kWidth, kHeight, 250);
  images[31] = GrayImage(kWidth, kHeight, 100);
  std::vector<std::string> found;
  for (const BlankImages& run : find_blank_images(summaries(images)))
    found.push_back(std::to_string(run.first) + "-" + std::to_string(run.last) + " " + run.look);
  EXPECT_THAT(found, ElementsAre("0-11 nearly black", "30-30 nearly white", "31-31 without contrast"));
  EXPECT_TRUE(find_blank_images(summaries(flight(20))).empty());
}

TEST(ImageExamination, TextOutsideOfAGivenMaskIsFoundAlone) {
  std::vector<GrayImage> images = flight(40, 5.0);
  const auto write_text = [](GrayImage& image, int left, int top) {
    for (int y = top; y < top + 10; ++y)
      for (int x = left; x < left + 30; ++x) image(x, y) = (x / 3) % 2 == 0 ? 255 : 0;
  };
  GrayImage given(kWidth, kHeight, 255);
  for (int y = 10; y < 30; ++y)
    for (int x = 30; x < 80; ++x) given(x, y) = 0;
  for (GrayImage& image : images) write_text(image, 40, 15);
  EXPECT_TRUE(find_static_pixels(images.size(), reader_of(images), given).empty()) << "all of it is masked already";
  for (GrayImage& image : images) write_text(image, 110, 60);
  const GrayImage mask = find_static_pixels(images.size(), reader_of(images), given);
  ASSERT_EQ(mask.width, kWidth);
  EXPECT_EQ(mask(120, 65), 0);
  EXPECT_EQ(mask(60, 20), 255) << "known";
}

TEST(ImageExamination, TextOnTheImagesIsMasked) {
  std::vector<GrayImage> images = flight(40, 5.0);
  for (GrayImage& image : images)
    for (int y = 20; y < 30; ++y)
      for (int x = 40; x < 80; ++x) image(x, y) = (x / 3) % 2 == 0 ? 255 : 0;
  const GrayImage mask = find_static_pixels(images.size(), reader_of(images));
  ASSERT_EQ(mask.width, kWidth);
  EXPECT_EQ(mask(60, 25), 0);
  EXPECT_EQ(mask(41, 21), 0);
  EXPECT_EQ(mask(20, 25), 255);
  EXPECT_EQ(mask(60, 60), 255);
}

}  // namespace
}  // namespace tileflight::odometry::image_examination_test
