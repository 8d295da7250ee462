#include "tileflight/core/imaging/image_similarity.h"

#include <gmock/gmock.h>

#include <cmath>
#include <random>

#include "tests/refusal.h"

namespace tileflight::imaging::image_similarity_test {
namespace {

GrayImage noise(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  GrayImage image(width, height);
  for (auto& pixel : image.pixels) pixel = static_cast<std::uint8_t>(random() % 200 + 20);
  return image;
}

/// The definition, window by window and pixel by pixel.
double ssim_by_definition(const GrayImage& a, const GrayImage& b, const GrayImage& mask) {
  double sum = 0;
  int windows = 0;
  for (int y = 5; y < a.height - 5; ++y) {
    for (int x = 5; x < a.width - 5; ++x) {
      double w = 0, ma = 0, mb = 0;
      bool counts = true;
      const auto each = [&](const auto& take) {
        for (int j = -5; j <= 5; ++j)
          for (int i = -5; i <= 5; ++i) take(std::exp(-(i * i + j * j) / (2 * 1.5 * 1.5)), x + i, y + j);
      };
      each([&](double weight, int i, int j) {
        w += weight, ma += weight * a(i, j), mb += weight * b(i, j);
        counts = counts && (mask.empty() || mask(i, j) != 0);
      });
      if (!counts) continue;
      ma /= w, mb /= w;
      double va = 0, vb = 0, ab = 0;
      each([&](double weight, int i, int j) {
        va += weight / w * (a(i, j) - ma) * (a(i, j) - ma);
        vb += weight / w * (b(i, j) - mb) * (b(i, j) - mb);
        ab += weight / w * (a(i, j) - ma) * (b(i, j) - mb);
      });
      const double c1 = 6.5025, c2 = 58.5225;  // (0.01 * 255)^2, (0.03 * 255)^2
      sum += (2 * ma * mb + c1) * (2 * ab + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
      ++windows;
    }
  }
  return sum / windows;
}

TEST(ImageSimilarity, IsWhatTheDefinitionsSay) {
  const GrayImage a = noise(41, 33, 1);
  GrayImage b = noise(41, 33, 2), mask(41, 33, 255);
  for (std::size_t i = 0; i < b.pixels.size(); ++i)
    b.pixels[i] = static_cast<std::uint8_t>((b.pixels[i] + a.pixels[i]) / 2);
  for (int y = 0; y < 33; ++y) mask(7, y) = 0;
  EXPECT_NEAR(compute_image_similarity(a, b).ssim, ssim_by_definition(a, b, {}), 1e-9);
  EXPECT_NEAR(compute_image_similarity(a, b, mask).ssim, ssim_by_definition(a, b, mask), 1e-9);
  double n = 0, ma = 0, mb = 0, va = 0, vb = 0, ab = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i)
    if (mask.pixels[i] != 0) ++n, ma += a.pixels[i], mb += b.pixels[i];
  ma /= n, mb /= n;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    if (mask.pixels[i] == 0) continue;
    va += std::pow(a.pixels[i] - ma, 2), vb += std::pow(b.pixels[i] - mb, 2),
        ab += (a.pixels[i] - ma) * (b.pixels[i] - mb);
  }
  EXPECT_NEAR(compute_image_similarity(a, b, mask).ncc, ab / std::sqrt(va * vb), 1e-12);
}

TEST(ImageSimilarity, OfAPictureWithItselfIsOne) {
  const GrayImage a = noise(64, 48, 3);
  EXPECT_NEAR(compute_image_similarity(a, a).ncc, 1.0, 1e-12);
  EXPECT_NEAR(compute_image_similarity(a, a).ssim, 1.0, 1e-12);
  GrayImage darker = a, negative = a;
  for (auto& pixel : darker.pixels) pixel = static_cast<std::uint8_t>(pixel / 2 + 10);
  for (auto& pixel : negative.pixels) pixel = static_cast<std::uint8_t>(255 - pixel);
  EXPECT_GT(compute_image_similarity(a, darker).ncc, 0.999) << "gain and offset do not count";
  EXPECT_LT(compute_image_similarity(a, darker).ssim, 0.9) << "here they do";
  EXPECT_NEAR(compute_image_similarity(a, negative).ncc, -1.0, 1e-12);
}

TEST(ImageSimilarity, WithoutContrastOrRoomIsNotANumber) {
  const GrayImage flat(20, 20, 7), small = noise(8, 8, 4), none(20, 20, 0);
  EXPECT_TRUE(std::isnan(compute_image_similarity(flat, noise(20, 20, 5)).ncc));
  EXPECT_TRUE(std::isnan(compute_image_similarity(small, small).ssim));
  EXPECT_NEAR(compute_image_similarity(small, small).ncc, 1.0, 1e-12);
  EXPECT_TRUE(std::isnan(compute_image_similarity(flat, flat, none).ssim));
  EXPECT_THAT(tests::refusal_of([&] { compute_image_similarity(flat, small); }), testing::HasSubstr("20x20 and 8x8"));
  EXPECT_THAT(tests::refusal_of([&] { compute_image_similarity(flat, flat, small); }), testing::HasSubstr("mask 8x8"));
}

}  // namespace
}  // namespace tileflight::imaging::image_similarity_test
