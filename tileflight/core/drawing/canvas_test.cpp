#include "tileflight/core/drawing/canvas.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace tileflight::drawing::canvas_test {
namespace {

using geometry::Vec2;

const imaging::Rgb8 kWhite{255, 255, 255};
const Ink kBlack{0, 0, 0, 1};

/// Amount of black on white, in pixels.
double ink_on(const imaging::RgbImage& image) {
  double sum = 0;
  for (const imaging::Rgb8& pixel : image.pixels) sum += 1.0 - pixel[1] / 255.0;
  return sum;
}

/// Centre of the black area: row and column.
Vec2 middle_of_ink(const imaging::RgbImage& image) {
  Vec2 sum = Vec2::Zero();
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) sum += (1.0 - image(x, y)[1] / 255.0) * Vec2(x + 0.5, y + 0.5);
  }
  return sum / ink_on(image);
}

TEST(Canvas, ShapesCoverTheirArea) {
  Canvas canvas(100, 80, kWhite);
  canvas.fill_rectangle(10.25, 20.5, 30.5, 11, kBlack);
  EXPECT_NEAR(ink_on(canvas.image()), 30.5 * 11, 1.0);
  EXPECT_NEAR(middle_of_ink(canvas.image()).x(), 10.25 + 15.25, 0.05);
  EXPECT_NEAR(middle_of_ink(canvas.image()).y(), 26.0, 0.05);

  Canvas disc(100, 80, kWhite);
  disc.fill_disc({50, 40}, 20, kBlack);
  EXPECT_NEAR(ink_on(disc.image()), std::numbers::pi * 400, 4.0);

  Canvas ring(100, 80, kWhite);  // the even-odd rule: a polygon that goes round a hole
  ring.fill_polygon(
      {{10, 10}, {50, 10}, {50, 50}, {10, 50}, {10, 10}, {20, 20}, {40, 20}, {40, 40}, {20, 40}, {20, 20}}, kBlack);
  EXPECT_NEAR(ink_on(ring.image()), 40 * 40 - 20 * 20, 4.0);
}

TEST(Canvas, LinesHaveTheirWidthAndDashes) {
  Canvas canvas(200, 40, kWhite);
  canvas.draw_line({{20, 20}, {180, 20}}, {kBlack, 3});
  EXPECT_NEAR(ink_on(canvas.image()), 160 * 3, 2.0);
  Canvas dashed(200, 40, kWhite);
  dashed.draw_line({{20, 20}, {180, 20}}, {kBlack, 3, {8, 8}});
  EXPECT_NEAR(ink_on(dashed.image()), 80 * 3, 2.0);
}

TEST(Canvas, OpacityMixesWithWhatIsThere) {
  Canvas canvas(10, 10, {100, 200, 0});
  canvas.fill_rectangle(0, 0, 10, 10, {1, 1, 1, 0.5});
  EXPECT_NEAR(canvas.image()(5, 5)[0], 178, 1);
  EXPECT_NEAR(canvas.image()(5, 5)[1], 228, 1);
  EXPECT_NEAR(canvas.image()(5, 5)[2], 128, 1);
}

TEST(Canvas, PicturesComeBackPixelByPixel) {
  imaging::RgbImage image(7, 5);
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 7; ++x) image(x, y) = {static_cast<std::uint8_t>(30 * x), static_cast<std::uint8_t>(50 * y), 7};
  }
  Canvas canvas(20, 20, kWhite);
  canvas.draw_image(4, 9, image);
  const imaging::RgbImage drawn = canvas.image();
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 7; ++x) EXPECT_EQ(drawn(x + 4, y + 9), image(x, y));
  }
  EXPECT_EQ(drawn(3, 9), kWhite);
  EXPECT_EQ(drawn(11, 9), kWhite);
}

TEST(Canvas, ClipsUntilItIsTakenAway) {
  Canvas canvas(40, 40, kWhite);
  canvas.clip(10, 10, 5, 5);
  canvas.fill_rectangle(0, 0, 40, 40, kBlack);
  EXPECT_NEAR(ink_on(canvas.image()), 25, 0.1);
  canvas.unclip();
  canvas.fill_rectangle(0, 0, 40, 40, kBlack);
  EXPECT_NEAR(ink_on(canvas.image()), 1600, 0.1);
}

imaging::RgbImage written(const std::string& words, const TextStyle& lettering) {
  Canvas canvas(400, 400, kWhite);
  canvas.draw_text(200, 200, words, lettering);
  return canvas.image();
}

TEST(Canvas, TextStandsWhereItIsAnchored) {
  const std::string words = "nnnnnnnn";
  const double width = Canvas(1, 1, kWhite).text_width(words, {.size_px = 20});
  EXPECT_GT(width, 60);
  EXPECT_NEAR(Canvas(1, 1, kWhite).text_width(words, {.size_px = 40}), 2 * width, 1e-6);
  const auto middle = [&](TextAnchor anchor) {
    return middle_of_ink(written(words, {.size_px = 20, .anchor = anchor})).x();
  };
  EXPECT_NEAR(middle(TextAnchor::kStart), 200 + width / 2, 1.5);
  EXPECT_NEAR(middle(TextAnchor::kMiddle), 200, 1.5);
  EXPECT_NEAR(middle(TextAnchor::kEnd), 200 - width / 2, 1.5);
}

TEST(Canvas, TurnedTextReadsUpwards) {
  const imaging::RgbImage upright = written("north", {.size_px = 20});
  const imaging::RgbImage turned = written("north", {.size_px = 20, .rotation_rad = -std::numbers::pi / 2});
  const Vec2 a = middle_of_ink(upright), b = middle_of_ink(turned);
  EXPECT_NEAR(b.y() - 200, -(a.x() - 200), 0.5);
  EXPECT_NEAR(b.x() - 200, a.y() - 200, 0.5);
  EXPECT_NEAR(ink_on(turned), ink_on(upright), 0.03 * ink_on(upright));
}

TEST(Canvas, LettersBeyondAsciiAreDrawn) {
  const imaging::RgbImage none = written("", {});
  EXPECT_EQ(ink_on(none), 0.0);
  EXPECT_NE(written("°", {}).pixels, written("²", {}).pixels);
  EXPECT_NE(written("©", {}).pixels, written("é", {}).pixels);
  EXPECT_EQ(written("a\xff", {}).pixels, written("a?", {}).pixels) << "what is no text is a question mark";
  EXPECT_EQ(written("a\xe2\x82", {}).pixels, written("a??", {}).pixels);
}

TEST(Canvas, AHaloIsReadOnAnyGround) {
  Canvas canvas(60, 40, {0, 0, 0});
  canvas.draw_text(10, 30, "I", {.size_px = 30, .halo = Ink{1, 1, 1, 1}});
  EXPECT_LT(ink_on(canvas.image()), 60 * 40 - 60);
}

TEST(Canvas, SameDrawingSameBytes) {
  const TextStyle style{.size_px = 17, .bold = true, .rotation_rad = 0.3};
  EXPECT_EQ(written("Machángara 12.5 m", style).pixels, written("Machángara 12.5 m", style).pixels);
}

}  // namespace
}  // namespace tileflight::drawing::canvas_test
