// Datasets as they come: what is broken in a flight is said in one line or put up with and counted; no false map.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/run_program.h"
#include "tests/tiny_flight.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::odometry_input_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyFlight;

class OdometryInput : public ::testing::Test {
 protected:
  OdometryInput() { TinyFlight::copy_to(dataset_); }

  fs::path image(int index) const {
    std::string id = std::to_string(index);
    return dataset_ / "images" / (std::string(6 - id.size(), '0') + id + ".jpg");
  }

  ProgramResult run(std::vector<std::string> more = {}) const {
    std::vector<std::string> call{"odometry", dataset_.string(), "--out", out_.string(), "--json"};
    call.insert(call.end(), more.begin(), more.end());
    return run_tileflight(call);
  }

  json expect_done(const std::vector<std::string>& more = {}) const {
    const ProgramResult result = run(more);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.exit_code == 0 ? json::parse(result.out) : json{{"frames_tracked", 0}};
  }

  template <class Matcher>
  void expect_fails(const Matcher& matcher, const std::vector<std::string>& more = {}) const {
    const ProgramResult result = run(more);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
    EXPECT_THAT(result.err, matcher);
    EXPECT_EQ(result.out, "");
  }

  /// Exit 1 with a reason, and what was written holds no points.
  template <class Matcher>
  void expect_no_map(const Matcher& matcher) const {
    expect_fails(matcher);
    if (!fs::exists(out_)) return;
    const json about = json::parse(tests::file_text(out_ / "odometry.json"));
    EXPECT_TRUE(about["lost"].get<bool>());
    EXPECT_EQ(about["points"], 0);
    EXPECT_EQ(about["frames_tracked"], 0);
  }

  void for_images(const std::function<void(imaging::RgbImage&)>& change) const {
    for (int i = 0; i < TinyFlight::kFrames; ++i) {
      imaging::RgbImage picture = imaging::read_rgb(image(i));
      change(picture);
      imaging::write_rgb(image(i), picture);
    }
  }

  void replace_in(const fs::path& file, const std::string& from, const std::string& to) const {
    std::string text = tests::file_text(file);
    const std::size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    std::ofstream(file, std::ios::binary) << text;
  }

  tests::TemporaryFolder folder_;
  fs::path dataset_ = folder_ / "dataset", out_ = folder_ / "out";
};

TEST_F(OdometryInput, AWholeFlightIsTracked) {
  const json about = expect_done();
  EXPECT_EQ(about["frames"], TinyFlight::kFrames);
  EXPECT_GE(about["frames_tracked"].get<int>(), TinyFlight::kFrames - 2);
  EXPECT_EQ(about["frames_skipped"], 0);
  EXPECT_FALSE(about["lost"].get<bool>());
}

TEST_F(OdometryInput, TruncatedPicturesInTheMiddleAreLeftOutAndCounted) {
  for (const int i : {20, 27}) fs::resize_file(image(i), fs::file_size(image(i)) / 2);
  std::ofstream(image(24), std::ios::binary) << "";  // empty
  const json about = expect_done();
  EXPECT_EQ(about["frames_skipped"], 3);
  EXPECT_EQ(about["frames"], TinyFlight::kFrames - 3);
  EXPECT_GE(about["frames_tracked"].get<int>(), TinyFlight::kFrames - 5);
  ASSERT_EQ(about["warnings"].size(), 1U);
  EXPECT_THAT(about["warnings"][0]["message"].get<std::string>(),
              AllOf(HasSubstr("3 images"), HasSubstr("000020.jpg")));
}

TEST_F(OdometryInput, APictureOfAnotherSizeIsNamed) {
  imaging::write_rgb(image(22), imaging::RgbImage(200, 100, {90, 90, 90}));
  expect_fails(AllOf(HasSubstr("000022.jpg"), HasSubstr("200x100"), HasSubstr("280x180")));
  EXPECT_FALSE(fs::exists(out_));
}

TEST_F(OdometryInput, RepeatedTimesAreNamed) {
  replace_in(dataset_ / "times.txt", "\n000010 0.33", "\n000010 0.23");
  expect_fails(AllOf(HasSubstr("times.txt"), HasSubstr("000010")));
}

TEST_F(OdometryInput, MissingTimesArePutUpWithAndSaid) {
  fs::remove(dataset_ / "times.txt");
  const json about = expect_done();
  EXPECT_THAT(about["warnings"].dump(), HasSubstr("1/30 s"));
  EXPECT_GE(about["frames_tracked"].get<int>(), TinyFlight::kFrames - 2);
}

TEST_F(OdometryInput, ALineOfTimesWithoutItsPictureIsNamed) {
  fs::remove(image(12));
  expect_fails(HasSubstr("000012"));
}

TEST_F(OdometryInput, SixteenBitAndColourPicturesAreTracked) {
  // 16-bit grey PNG for one half, 8-bit colour PNG for the other.
  for (int i = 0; i < TinyFlight::kFrames; ++i) {
    imaging::RgbImage picture = TinyFlight::sequence().images[i];
    fs::path png = image(i);
    fs::remove(png);
    png.replace_extension(".png");
    if (i % 2 == 0) {
      imaging::Gray16Image deep(picture.width, picture.height);
      for (std::size_t k = 0; k < deep.pixels.size(); ++k)
        deep.pixels[k] = static_cast<std::uint16_t>(257 * picture.pixels[k][0]);
      const auto bytes = imaging::encode_png(deep);
      std::ofstream(png, std::ios::binary)
          .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    } else {
      imaging::write_rgb(png, picture);
    }
  }
  const json about = expect_done();
  EXPECT_GE(about["frames_tracked"].get<int>(), TinyFlight::kFrames - 2);
}

TEST_F(OdometryInput, RepeatedImagesAreCountedAndBlackOnesAreNot) {
  const auto warnings = [&] { return expect_done({"--force"})["warnings"].dump(); };
  EXPECT_THAT(warnings(), Not(HasSubstr("repeat the one before")));
  for (const int i : {10, 15, 20}) fs::copy_file(image(i), image(i + 1), fs::copy_options::overwrite_existing);
  EXPECT_THAT(warnings(), HasSubstr("3 of " + std::to_string(TinyFlight::kFrames) + " images repeat the one before"));
  const imaging::RgbImage seen = imaging::read_rgb(image(0));
  for (const int i : {0, 1, 2}) imaging::write_rgb(image(i), imaging::RgbImage(seen.width, seen.height));
  EXPECT_THAT(warnings(), HasSubstr("3 of " + std::to_string(TinyFlight::kFrames) + " images repeat the one before"));
}

TEST_F(OdometryInput, CalibrationForAnotherSizeIsNamed) {
  replace_in(dataset_ / "camera.yaml", "resolution: [280, 180]", "resolution: [560, 360]");
  expect_fails(AllOf(HasSubstr("560x360"), HasSubstr("280x180")));
}

TEST_F(OdometryInput, NaNInTheCalibrationIsNamed) {
  replace_in(dataset_ / "camera.yaml", "intrinsics: [", "intrinsics: [.nan, ");
  expect_fails(HasSubstr("camera.yaml"));
  replace_in(dataset_ / "camera.yaml", "139.5", "");
  expect_fails(HasSubstr("camera.yaml"));
}

TEST_F(OdometryInput, AnEmptyFolderIsNamed) {
  fs::remove_all(dataset_ / "images");
  fs::create_directory(dataset_ / "images");
  expect_fails(AllOf(HasSubstr("images"), HasSubstr("no images")));
}

TEST_F(OdometryInput, OnePictureIsNoMap) {
  const ProgramResult result = run({"--to", "1"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("no parallax"));
}

TEST_F(OdometryInput, NoParallaxIsNoMap) {
  const imaging::RgbImage still = imaging::read_rgb(image(0));
  for_images([&](imaging::RgbImage& picture) { picture = still; });
  expect_no_map(HasSubstr("no parallax"));
}

TEST_F(OdometryInput, BlackPicturesAreNoMap) {
  for_images(
      [](imaging::RgbImage& picture) { std::fill(picture.pixels.begin(), picture.pixels.end(), imaging::Rgb8{}); });
  expect_no_map(HasSubstr("nearly black (largest value 0 of 255)"));
}

TEST_F(OdometryInput, SaturatedPicturesAreNoMap) {
  for_images([](imaging::RgbImage& picture) {
    std::fill(picture.pixels.begin(), picture.pixels.end(), imaging::Rgb8{255, 255, 255});
  });
  expect_no_map(HasSubstr("nearly white (smallest value 255 of 255)"));
}

TEST_F(OdometryInput, PartlySaturatedPicturesAreTracked) {
  for_images([](imaging::RgbImage& picture) {
    for (imaging::Rgb8& pixel : picture.pixels)
      for (std::uint8_t& value : pixel) value = static_cast<std::uint8_t>(std::min(255.0, 1.5 * value));
  });
  EXPECT_GE(expect_done()["frames_tracked"].get<int>(), TinyFlight::kFrames - 3);
}

TEST_F(OdometryInput, AMaskOfAnotherSizeIsNamed) {
  imaging::write_gray(folder_ / "mask.png", imaging::GrayImage(100, 50, 255));
  expect_fails(AllOf(HasSubstr("mask.png"), HasSubstr("100x50")), {"--mask", (folder_ / "mask.png").string()});
}

TEST_F(OdometryInput, AMaskThatLeavesNothingIsNoMap) {
  imaging::write_gray(folder_ / "mask.png", imaging::GrayImage(280, 180, 0));
  expect_fails(HasSubstr("no parallax"), {"--mask", (folder_ / "mask.png").string()});
}

TEST_F(OdometryInput, KnownPosesOfAnotherClockAreRefused) {
  geometry::Trajectory late = TinyFlight::truth();
  for (geometry::StampedPose& pose : late.poses) pose.time_s += 500.0;
  geometry::write_tum(folder_ / "late.txt", late);
  expect_fails(HasSubstr("known poses"), {"--init-from", (folder_ / "late.txt").string()});
  expect_fails(HasSubstr("nowhere.txt"), {"--init-from", (folder_ / "nowhere.txt").string()});
}

TEST_F(OdometryInput, ALensThatColmapDoesNotKnowIsRefused) {
  std::ofstream(dataset_ / "camera.yaml")
      << "cam0:\n  camera_model: ds\n  intrinsics: [0.0, 0.5, 123.4, 123.4, 139.5, 89.5]\n"
         "  resolution: [280, 180]\n";
  expect_fails(HasSubstr("COLMAP"), {"--colmap"});
}

}  // namespace
}  // namespace tileflight::odometry_input_test
