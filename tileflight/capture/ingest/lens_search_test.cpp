#include "tileflight/capture/ingest/lens_search.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tests/metadata_track.h"
#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tests/test_data.h"
#include "tileflight/core/base/files.h"
#include "tileflight/data/video/video.h"

namespace tileflight::ingest::lens_search_test {
namespace {

using nlohmann::json;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

struct ProfileOptions {
  std::string model = "HERO5 Black", lens = "Wide", note = "";
  int width = 1920, height = 1080;
  double fps = 30, focal_px = 880, error_px = 0.3;
  bool is_official = false;
  json modes = json::array();
};

class LensSearchTest : public testing::Test {
 protected:
  void add(const std::string& name, const ProfileOptions& o) {
    const json text{{"camera_brand", "GoPro"},
                    {"camera_model", o.model},
                    {"lens_model", o.lens},
                    {"note", o.note},
                    {"fps", o.fps},
                    {"official", o.is_official},
                    {"frame_readout_time", 10.8},
                    {"calib_dimension", {{"w", o.width}, {"h", o.height}}},
                    {"compatible_settings", o.modes},
                    {"fisheye_params",
                     {{"RMS_error", o.error_px},
                      {"camera_matrix", {{o.focal_px, 0, 0.5 * o.width}, {0, o.focal_px, 0.5 * o.height}, {0, 0, 1}}},
                      {"distortion_coeffs", {0.05, 0.01, 0, 0}}}}};
    base::write_file(folder_ / "profiles" / name, text.dump());
  }
  LensSearchResult search(int width = 1920, int height = 1080, double fps = 29.97, const std::string& lens = "") {
    recording_.mode.width = width;
    recording_.mode.height = height;
    recording_.mode.frames_per_second = fps;
    return find_lenses({recording_, folder_ / "profiles", lens});
  }
  static std::vector<std::string> names(const LensSearchResult& result) {
    std::vector<std::string> found;
    for (const LensMatch& match : result.matches) found.push_back(match.file.filename().string());
    return found;
  }

  LensSearchTest() { std::filesystem::create_directories(folder_ / "profiles/deeper"); }
  tests::TemporaryFolder folder_;
  RecordingIdentity recording_{"GoPro HERO5 Black", "--model"};
};

TEST_F(LensSearchTest, TheBestIsOfTheSizeThenOfTheRateThenUnstabilisedThenOfficialThenExact) {
  add("exact.json", {.error_px = 0.2});
  add("official.json", {.is_official = true});
  add("plain.json", {});
  add("eis.json", {.note = "EIS", .error_px = 0.1, .is_official = true});
  add("other-rate.json", {.fps = 120, .is_official = true});
  add("no-rate.json", {.fps = 0, .is_official = true});
  add("deeper/scaled.json", {.width = 3840, .height = 2160, .focal_px = 1760, .is_official = true});
  add("four-by-three.json", {.width = 1920, .height = 1440, .is_official = true});
  add("session.json", {.model = "HERO5 Session", .is_official = true});
  base::write_file(folder_ / "profiles/notes.json", "[1, 2]");
  base::write_file(folder_ / "profiles/readme.txt", "no profile");
  const LensSearchResult result = search();
  EXPECT_THAT(names(result), ElementsAre("official.json", "exact.json", "plain.json", "eis.json", "no-rate.json",
                                         "other-rate.json", "scaled.json"));
  EXPECT_EQ(result.profiles, 9U);
  EXPECT_EQ(result.of_other_size, 1U);
  EXPECT_THAT(result.skipped, ElementsAre(HasSubstr("notes.json")));
  EXPECT_THAT(result.warnings, IsEmpty());
  EXPECT_THAT(result.matches[0].reasons,
              ElementsAre("same size", "same frame rate", "official", "reprojection error 0.3 px"));
  EXPECT_THAT(result.matches[5].reasons, Contains("of 120 frames per second"));
  EXPECT_THAT(result.matches[6].reasons, Contains("scaled from 3840x2160"));
}

TEST_F(LensSearchTest, ModesOfAProfileCountAsItsOwn) {
  add("a.json", {.width = 3840,
                 .height = 2160,
                 .fps = 60,
                 .focal_px = 1760,
                 .modes = {{{"width", 1920}, {"height", 1080}, {"fps", 120.0}, {"frame_readout_time", 5.4}},
                           {{"width", 1920}, {"height", 1080}, {"fps", 29.97}, {"frame_readout_time", 8.0}}}});
  const LensSearchResult result = search();
  ASSERT_EQ(result.matches.size(), 1U);
  EXPECT_EQ(result.matches[0].size, SizeMatch::kSame);
  EXPECT_THAT(result.warnings, IsEmpty());
  const imaging::Calibration calibration = calibration_of(result.matches[0], recording_);
  EXPECT_NEAR(calibration.line_delay_s, 0.008 / 1080, 1e-15);
  EXPECT_NEAR(calibration.camera.project({0, 0, 1}).value().x(), (1920 + 0.5) / 2 - 0.5, 1e-9);
  EXPECT_THAT(calibration.notes, ElementsAre(HasSubstr("for 1920x1080 at 29.97 frames per second")));
}

TEST_F(LensSearchTest, AScaledLensKeepsItsReadoutTime) {
  add("a.json", {});
  const LensSearchResult result = search(854, 480);
  ASSERT_EQ(result.matches.size(), 1U);
  EXPECT_THAT(result.warnings, ElementsAre(HasSubstr("no profile of this camera is for images of 854x480")));
  const imaging::Calibration calibration = calibration_of(result.matches[0], recording_);
  EXPECT_EQ(calibration.camera.width(), 854);
  EXPECT_NEAR(calibration.line_delay_s, 0.0108 / 480, 1e-15);
}

TEST_F(LensSearchTest, LensesThatFitEquallyWellAreNamed) {
  add("wide.json", {.is_official = true});
  add("linear.json", {.lens = "Linear", .focal_px = 1200, .is_official = true});
  const LensSearchResult both = search();
  EXPECT_TRUE(both.is_ambiguous);
  EXPECT_THAT(both.warnings,
              ElementsAre(HasSubstr("2 profiles fit as well, with focal lengths from 880 to 1200 pixels: "
                                    "the recording does not say which lens or field of view it has "
                                    "(Linear, Wide)")));
  const LensSearchResult chosen = search(1920, 1080, 29.97, "linear");
  EXPECT_THAT(names(chosen), ElementsAre("linear.json"));
  EXPECT_EQ(chosen.of_other_lens, 1U);
  EXPECT_FALSE(chosen.is_ambiguous);
}

TEST_F(LensSearchTest, OtherCamerasAreNotTaken) {
  add("mini.json", {.model = "HERO5 Black Mini"});
  const LensSearchResult result = search();
  EXPECT_THAT(result.matches, IsEmpty());
  EXPECT_THAT(result.similar, ElementsAre("GoPro HERO5 Black Mini"));
  recording_.camera = "hero5black mini";
  EXPECT_EQ(search().matches.size(), 1U) << "blanks and case do not count, and the maker may be missing";
}

TEST_F(LensSearchTest, WhatIsNotThereIsNamed) {
  recording_.camera = "";
  EXPECT_THAT(tests::refusal_of([&] { search(); }), HasSubstr("give it: --model"));
  recording_.camera = "x";
  EXPECT_THAT(tests::refusal_of([&] { search(); }), HasSubstr("holds no .json file"));
  EXPECT_THAT(tests::refusal_of([&] {
                find_lenses({{"x", "", {1, 1, 1}}, folder_ / "none"});
              }),
              HasSubstr("no such folder"));
}

/// A drone's clip of a GoPro HERO5 Black, whose firmware tells the model, and real profiles.
TEST_F(LensSearchTest, TheLensModeThatTheRecordingStatesDecides) {
  add("wide.json", {.is_official = true});
  add("linear.json", {.lens = "Linear", .focal_px = 1200});
  add("unnamed.json", {.lens = "", .focal_px = 1000});
  recording_.lens = "Linear";
  const LensSearchResult linear = search();
  EXPECT_THAT(names(linear), ElementsAre("linear.json"));
  EXPECT_FALSE(linear.is_ambiguous);
  EXPECT_EQ(linear.of_other_lens, 2U);
  EXPECT_EQ(linear.matches[0].reasons.front(), "the recording's lens mode, Linear");
  EXPECT_THAT(names(search(1920, 1080, 29.97, "Wide")), ElementsAre("wide.json")) << "what the user says comes first";
  recording_.lens = "SuperView";
  EXPECT_THAT(names(search()), ElementsAre("unnamed.json")) << "those that name another mode are not for it";
  std::filesystem::remove(folder_ / "profiles/unnamed.json");
  const LensSearchResult other = search();
  EXPECT_EQ(other.matches.size(), 2U);
  EXPECT_THAT(other.warnings, Contains(HasSubstr("made in the lens mode SuperView, and no profile")));
}

TEST_F(LensSearchTest, AGoProsVideoStatesItsLensMode) {
  const std::filesystem::path file = folder_ / "a.mp4";
  video::VideoWriter writer(file, 96, 64, {});
  for (int i = 0; i < 3; ++i) writer.add(imaging::RgbImage(96, 64));
  writer.finish();
  EXPECT_EQ(identify_recording(file).lens, "");
  const std::string settings("DEVC\0\1\0\x0cVFOVc\1\0\1L\0\0\0", 20);
  tests::add_metadata_track(file, "gpmd", {"DEVC"}, 1000, tests::mp4_box("GPMF", settings));
  EXPECT_EQ(identify_recording(file).lens, "Linear");
}

TEST(LensSearchRealData, OfAGoPro) {
  TILEFLIGHT_REQUIRE_TEST_DATA(video, "real/karma/karma.mp4");
  TILEFLIGHT_REQUIRE_TEST_DATA(profiles, "real/lens_profiles");
  const RecordingIdentity recording = identify_recording(video);
  EXPECT_EQ(recording.camera, "GoPro HERO5 Black");
  EXPECT_EQ(recording.stated_by, "firmware HD5.02.02.00.00");
  EXPECT_EQ(recording.mode.width, 854);
  EXPECT_NEAR(recording.mode.frames_per_second, 29.97, 0.01);
  const LensSearchResult result = find_lenses({recording, profiles});
  EXPECT_EQ(result.profiles, 17U);
  EXPECT_EQ(result.matches.size(), 2U) << "the third of this camera is of 4:3";
  EXPECT_EQ(result.of_other_size, 1U);
  EXPECT_TRUE(result.is_ambiguous) << "focal lengths of 392 and 286 pixels";
}

TEST(LensSearchRealData, OfPhotos) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "real/mirafiori");
  const RecordingIdentity recording = identify_recording(folder);
  EXPECT_EQ(recording.camera, "DJI FC6360");
  EXPECT_EQ(recording.mode.width, 1600);
}

}  // namespace
}  // namespace tileflight::ingest::lens_search_test
