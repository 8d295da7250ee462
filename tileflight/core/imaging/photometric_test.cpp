#include "tileflight/core/imaging/photometric.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::imaging::photometric_test {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

std::string response_text(std::size_t count, double exponent, double scale, double offset) {
  std::string text;
  for (std::size_t i = 0; i < count; ++i)
    text +=
        std::to_string(offset + scale * std::pow(static_cast<double>(i) / static_cast<double>(count - 1), exponent)) +
        " ";
  return text;
}

TEST(Photometric, NoFilesAreTheIdentity) {
  const PhotometricCalibration calibration = read_photometric({}, {});
  for (int i = 0; i < 256; ++i) EXPECT_EQ(calibration.inverse_response[i], static_cast<float>(i));
  EXPECT_TRUE(calibration.vignette.empty());
}

TEST(Photometric, ResponseIsRescaledTo255) {
  tests::TemporaryFolder folder;
  for (const std::size_t count : {256, 1024, 65536}) {
    base::write_file(folder / "pcalib.txt", response_text(count, 2.0, 5000, 100));
    const PhotometricCalibration calibration = read_photometric(folder / "pcalib.txt", {});
    for (int i = 0; i < 256; ++i)
      EXPECT_NEAR(calibration.inverse_response[i], 255.0 * std::pow(i / 255.0, 2.0), 1e-3) << count << " " << i;
  }
}

TEST(Photometric, ResponseRoundTrip) {
  tests::TemporaryFolder folder;
  std::array<float, 256> response{};
  for (int i = 0; i < 256; ++i) response[i] = 255.0F * std::pow(static_cast<float>(i) / 255.0F, 2.2F);
  write_pcalib(folder / "pcalib.txt", response);
  const auto back = read_photometric(folder / "pcalib.txt", {}).inverse_response;
  for (int i = 0; i < 256; ++i) EXPECT_NEAR(back[i], response[i], 1e-5F * 255.0F);
}

TEST(Photometric, VignetteRoundTrip) {
  tests::TemporaryFolder folder;
  FloatImage vignette(40, 30);
  for (int y = 0; y < 30; ++y)
    for (int x = 0; x < 40; ++x) vignette(x, y) = 1.0F - 0.4F * std::hypot(x - 20.0F, y - 15.0F) / 25.0F;
  write_vignette(folder / "vignette.png", vignette);
  const FloatImage back = read_photometric({}, folder / "vignette.png").vignette;
  ASSERT_EQ(back.width, 40);
  for (std::size_t i = 0; i < vignette.pixels.size(); ++i) EXPECT_NEAR(back.pixels[i], vignette.pixels[i], 1e-5);
}

TEST(Photometric, VignetteIsPositiveAndAtMostOne) {
  tests::TemporaryFolder folder;
  GrayImage image(3, 1);
  image.pixels = {0, 100, 200};
  write_gray(folder / "vignette.png", image);
  const FloatImage vignette = read_photometric({}, folder / "vignette.png").vignette;
  EXPECT_GT(vignette.pixels[0], 0.0F);
  EXPECT_FLOAT_EQ(vignette.pixels[1], 0.5F);
  EXPECT_FLOAT_EQ(vignette.pixels[2], 1.0F);
}

TEST(Photometric, BadFilesAreOneClearLine) {
  tests::TemporaryFolder folder;
  const auto response_error = [&](const std::string& text) -> std::string {
    base::write_file(folder / "pcalib.txt", text);
    return tests::refusal_of([&] { read_photometric(folder / "pcalib.txt", {}); });
  };
  EXPECT_THAT(response_error("1 2 3"), HasSubstr("at least 256 numbers, not 3"));
  EXPECT_THAT(response_error(""), HasSubstr("not 0"));
  EXPECT_THAT(response_error("1 2 2 3"), HasSubstr("number 3 does not increase"));
  EXPECT_THAT(response_error("1 2 x"), HasSubstr("\"x\""));
  EXPECT_THAT(response_error("1 nan"), HasSubstr("\"nan\""));
  write_gray(folder / "black.png", GrayImage(4, 4));
  EXPECT_THAT([&] { read_photometric({}, folder / "black.png"); },
              ThrowsMessage<InputError>(HasSubstr("black.png: the vignette is black everywhere")));
  EXPECT_THAT([&] { read_photometric({}, folder / "none.png"); },
              ThrowsMessage<InputError>(HasSubstr("none.png: cannot be opened")));
}

}  // namespace
}  // namespace tileflight::imaging::photometric_test
