#include "tileflight/core/imaging/lens_profile.h"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tests/test_data.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::imaging::lens_profile_test {
namespace {

using nlohmann::json;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

json plain_profile() {
  return json::parse(R"({"name": "Maker_Model_Wide", "note": "NO-EIS", "camera_brand": "Maker", "camera_model": "Model",
    "lens_model": "Wide", "camera_setting": "", "calib_dimension": {"w": 1920, "h": 1080},
    "orig_dimension": {"w": 1920, "h": 1080}, "output_dimension": {"w": 1920, "h": 1080}, "frame_readout_time": 15.5,
    "input_horizontal_stretch": 1.0, "input_vertical_stretch": 1.0, "fps": 59.94, "official": true,
    "asymmetrical": false, "fisheye_params": {"RMS_error": 0.3, "camera_matrix": [[880.0, 0.0, 966.0],
    [0.0, 884.0, 527.5], [0.0, 0.0, 1.0]], "distortion_coeffs": [0.05, 0.012, -0.002, -0.004],
    "radial_distortion_limit": null}, "identifier": "maker-model-wide-1920x1080@59940", "compatible_settings": [],
    "distortion_model": null, "digital_lens": null, "interpolations": null, "crop": null, "global_shutter": false})");
}

LensProfile parsed(const json& profile) { return parse_lens_profile(profile.dump(), "p.json"); }

/// The fisheye module's projection (OpenCV's documentation, "Fisheye camera model"), written out here.
geometry::Vec2 fisheye_pixel(const json& profile, const geometry::Vec3& ray) {
  const json& m = profile["fisheye_params"]["camera_matrix"];
  const std::vector<double> k = profile["fisheye_params"]["distortion_coeffs"];
  const double a = ray.x() / ray.z(), b = ray.y() / ray.z(), r = std::sqrt(a * a + b * b);
  const double t = std::atan(r);
  const double bent = t + k[0] * std::pow(t, 3) + k[1] * std::pow(t, 5) + k[2] * std::pow(t, 7) + k[3] * std::pow(t, 9);
  const double share = r > 0 ? bent / r : 1.0;
  return {m[0][0].get<double>() * share * a + m[0][2].get<double>(),
          m[1][1].get<double>() * share * b + m[1][2].get<double>()};
}

TEST(LensProfile, IsTheFisheyeOfOpenCv) {
  const json text = plain_profile();
  const LensProfile profile = parsed(text);
  EXPECT_EQ(describe(profile), "Maker Model, Wide, NO-EIS");
  EXPECT_EQ(describe(profile.modes.front()), "1920x1080 at 59.94 frames per second");
  EXPECT_EQ(profile.camera.width(), 1920);
  EXPECT_EQ(profile.camera.height(), 1080);
  EXPECT_THAT(profile.notes, IsEmpty());
  for (const geometry::Vec3& ray : {geometry::Vec3(0, 0, 1), {0.7, -0.3, 1}, {-0.9, 0.5, 1}, {0.01, 0.4, 1}})
    EXPECT_NEAR((profile.camera.project(ray).value() - fisheye_pixel(text, ray)).norm(), 0.0, 1e-9);
  // By hand for (1, 0, 1): t = pi / 4 = 0.785398; t + 0.05 t^3 + 0.012 t^5 - 0.002 t^7 - 0.004 t^9 as below
  const double t = 0.7853981633974483;
  const double bent = t + 0.05 * 0.4844730731 + 0.012 * 0.2988473484 - 0.002 * 0.1843440691 - 0.004 * 0.1137126897;
  EXPECT_NEAR(profile.camera.project({1, 0, 1}).value().x(), 966.0 + 880.0 * bent, 1e-6);
  EXPECT_NEAR(calibration_of(profile).line_delay_s, 0.0155 / 1080, 1e-15);
}

TEST(LensProfile, IsACalibrationWhereverOneIsRead) {
  const tests::TemporaryFolder folder;
  base::write_file(folder / "p.json", plain_profile().dump());
  EXPECT_THAT(camera_ids(folder / "p.json"), IsEmpty());
  const Calibration calibration = read_calibration(folder / "p.json");
  EXPECT_TRUE(calibration.assumes_T_cam_imu);
  EXPECT_THAT(calibration.notes, ElementsAre(HasSubstr("p.json: is a lens profile of Maker Model, Wide, NO-EIS for "
                                                       "1920x1080 at 59.94 frames per second")));
  write_kalibr(folder / "camera.yaml", calibration);
  const Calibration again = read_calibration(folder / "camera.yaml");
  EXPECT_NEAR(
      (again.camera.project({0.7, -0.3, 1}).value() - calibration.camera.project({0.7, -0.3, 1}).value()).norm(), 0.0,
      1e-9);
  EXPECT_DOUBLE_EQ(again.line_delay_s, calibration.line_delay_s);
}

TEST(LensProfile, OfStretchedImagesIsOfTheRecordedOnes) {
  json text = plain_profile();
  text["calib_dimension"] = {{"w", 3277}, {"h", 1520}};
  text["input_horizontal_stretch"] = 1.212;
  LensProfile profile = parsed(text);
  EXPECT_EQ(profile.camera.width(), 2704) << "a video of 2704x1520 is stretched to 3277x1520";
  const geometry::Vec3 ray(0.7, -0.3, 1);
  geometry::Vec2 stretched = fisheye_pixel(text, ray);
  // The pixel's centre lies at x + 1/2 from the edge.
  EXPECT_NEAR(profile.camera.project(ray).value().x(), (stretched.x() + 0.5) / 1.212 - 0.5, 1e-9);
  EXPECT_NEAR(profile.camera.project(ray).value().y(), stretched.y(), 1e-9);

  text["calib_dimension"] = {{"w", 3840}, {"h", 1393}};
  text["input_horizontal_stretch"] = nullptr;
  text["input_vertical_stretch"] = 0.645;
  profile = parsed(text);
  EXPECT_EQ(profile.camera.height(), 2160);
  stretched = fisheye_pixel(text, ray);
  EXPECT_NEAR(profile.camera.project(ray).value().y(), (stretched.y() + 0.5) / 0.645 - 0.5, 1e-9);
  text["input_vertical_stretch"] = 0.0;
  EXPECT_THAT(tests::refusal_of([&] { parsed(text); }), HasSubstr("\"input_vertical_stretch\" must be from 0.1 to 10"));
}

TEST(LensProfile, HasTheReadoutTimeOfItsShutter) {
  const auto line_delay_us = [](const char* key, const json& value) {
    json text = plain_profile();
    text[key] = value;
    return 1e6 * calibration_of(parsed(text)).line_delay_s;
  };
  EXPECT_NEAR(line_delay_us("frame_readout_time", 10.8), 10.0, 1e-9);
  EXPECT_NEAR(line_delay_us("frame_readout_time", -10.8), -10.0, 1e-9) << "from the bottom to the top";
  EXPECT_NEAR(line_delay_us("frame_readout_direction", "BottomToTop"), -1e6 * 0.0155 / 1080, 1e-9);
  EXPECT_EQ(line_delay_us("frame_readout_direction", "LeftToRight"), 0.0);
  EXPECT_EQ(line_delay_us("global_shutter", true), 0.0);
  EXPECT_EQ(line_delay_us("frame_readout_time", nullptr), 0.0);
  EXPECT_EQ(line_delay_us("frame_readout_time", 17.0), 0.0) << "longer than a frame";
  json text = plain_profile();
  text["frame_readout_time"] = 0.0;
  EXPECT_THAT(calibration_of(parsed(text)).notes, Contains(HasSubstr("states no readout time")));
  text["global_shutter"] = true;
  EXPECT_THAT(calibration_of(parsed(text)).notes, Not(Contains(HasSubstr("readout"))));
}

TEST(LensProfile, HasFurtherModes) {
  json text = plain_profile();
  text["compatible_settings"] =
      json::parse(R"([{"width": 1280, "height": 720, "fps": 120.0, "frame_readout_time": 6.0, "identifier": "a"},
                      {"identifier": "b"}, {"width": 1920, "height": 1440, "fps": 30.0},
                      {"fps": 24.0, "frame_readout_time": 20.0}])");
  const LensProfile profile = parsed(text);
  ASSERT_EQ(profile.modes.size(), 4U) << "1920x1440 has another aspect ratio";
  EXPECT_EQ(describe(profile.modes[1]), "1280x720 at 120 frames per second");
  EXPECT_EQ(profile.modes[1].identifier, "a");
  EXPECT_EQ(describe(profile.modes[2]), "1920x1080 at 59.94 frames per second");
  EXPECT_EQ(profile.modes[2].readout_s, std::nullopt);
  const Calibration smaller = calibration_of(profile, profile.modes[1]);
  EXPECT_NEAR(smaller.line_delay_s, 0.006 / 720, 1e-15);
  EXPECT_NEAR(smaller.camera.project({0, 0, 1}).value().x(), (966.0 + 0.5) * 1280 / 1920 - 0.5, 1e-9);

  const Calibration listed = calibration_for_size(profile, 1280, 720);
  EXPECT_NEAR(listed.line_delay_s, 0.006 / 720, 1e-15);
  EXPECT_THAT(listed.notes, ElementsAre(HasSubstr("for 1280x720 at 120 frames per second")));
  const Calibration own = calibration_for_size(profile, 1920, 1080);
  EXPECT_NEAR(own.line_delay_s, 0.0155 / 1080, 1e-15);
  EXPECT_THAT(own.notes, Contains(HasSubstr("lists other readout times for other frame rates")));
  const Calibration scaled = calibration_for_size(profile, 960, 540);
  EXPECT_NEAR(scaled.line_delay_s, 0.0155 / 540, 1e-15);
  EXPECT_THAT(scaled.notes,
              Contains(HasSubstr("1920x1080, the frames have 960x540; its lens is scaled to them, but the "
                                 "profile does not list that size")));
  EXPECT_THAT(tests::refusal_of([&] { calibration_for_size(profile, 1920, 1440); }),
              HasSubstr("the aspect ratio differs"));
}

TEST(LensProfile, SaysWhatMayBeWrong) {
  const auto notes_of = [](const char* key, const json& value) {
    json text = plain_profile();
    (std::string(key) == "RMS_error" ? text["fisheye_params"] : text)[key] = value;
    return parsed(text).notes;
  };
  EXPECT_THAT(notes_of("note", "EIS"), ElementsAre(HasSubstr("the camera stabilises (EIS)")));
  EXPECT_THAT(notes_of("note", "EIS-Y"), ElementsAre(HasSubstr("the camera stabilises (EIS)")));
  EXPECT_THAT(notes_of("RMS_error", 6.31), ElementsAre(HasSubstr("reprojection error of 6.3 pixels")));
  EXPECT_THAT(notes_of("interpolations", {{"14", json::object()}}), ElementsAre(HasSubstr("zoom lens")));
  EXPECT_THAT(notes_of("crop", 1.5), ElementsAre(HasSubstr("\"crop\" is not used")));
  json text = plain_profile();
  text["fisheye_params"]["camera_matrix"][1][2] = 300.0;
  EXPECT_THAT(parsed(text).notes, ElementsAre(HasSubstr("principal point lies 24")));
  text = plain_profile();
  text["fisheye_params"]["distortion_coeffs"] = {-0.4, 0.0, 0.0, 0.0};
  EXPECT_THAT(parsed(text).notes, ElementsAre(HasSubstr("not valid up to the corners")));
}

TEST(LensProfile, WhatNoLensModelHasIsRefused) {
  const auto fault = [](const char* key, const json& value) {
    json text = plain_profile();
    text[key] = value;
    return tests::refusal_of([&] { parsed(text); });
  };
  EXPECT_THAT(fault("digital_lens", "gopro_superview"),
              HasSubstr("stretches after the lens (digital_lens gopro_super"));
  EXPECT_THAT(fault("is_superview", true), HasSubstr("digital_lens"));
  EXPECT_THAT(fault("distortion_model", "sony"), HasSubstr("distortion_model \"sony\" is not supported"));
  EXPECT_THAT(fault("calib_dimension", {{"w", 0}, {"h", 0}}), HasSubstr("p.json: calib_dimension"));
  EXPECT_THAT(fault("calib_dimension", nullptr), HasSubstr("has no key \"calib_dimension\""));
  EXPECT_THAT(fault("fisheye_params", 3), HasSubstr("fisheye_params: must be an object"));
  EXPECT_THAT(fault("frame_readout_time", "x"), HasSubstr("\"frame_readout_time\" must be a number"));
  EXPECT_THAT(fault("compatible_settings", {3}), HasSubstr("compatible_settings: must be an object"));
  json text = plain_profile();
  text["fisheye_params"]["camera_matrix"] = {{-880.0, 0.0, 966.0}, {0.0, -880.0, 527.0}, {0.0, 0.0, 1.0}};
  EXPECT_THAT(tests::refusal_of([&] { parsed(text); }), HasSubstr("p.json"));
  text["fisheye_params"]["camera_matrix"] = {{880.0, 1.0, 966.0}, {0.0, 880.0, 527.0}, {0.0, 0.0, 1.0}};
  EXPECT_THAT(tests::refusal_of([&] { parsed(text); }), HasSubstr("no lens model here has skew"));
  text = plain_profile();
  text["fisheye_params"]["distortion_coeffs"] = {0.1, 0.2};
  EXPECT_THAT(tests::refusal_of([&] { parsed(text); }), HasSubstr("p.json"));
  EXPECT_THAT(tests::refusal_of([] { parse_lens_profile("{\"fisheye_params\":", "p.json"); }),
              HasSubstr("not valid JSON"));
  EXPECT_THAT(tests::refusal_of([] { parse_lens_profile("{}", "p.json"); }), HasSubstr("no lens profile"));
}

TEST(LensProfile, CutOrChangedAnywhereItIsReadOrRefused) {
  json profile = plain_profile();
  profile["compatible_settings"] = {{{"width", 1280}, {"height", 720}, {"fps", 120.0}, {"frame_readout_time", 6.0}}};
  const std::string whole = profile.dump();
  const auto read = [](const std::string& text) {
    try {
      calibration_of(parse_lens_profile(text, "p.json"));
    } catch (const InputError&) {
    }
  };
  for (std::size_t i = 0; i < whole.size(); ++i) {
    read(whole.substr(0, i));
    for (const char c : {'9', '-', '0', 'e', '[', '}', '"', '\xFF'}) {
      std::string changed = whole;
      changed[i] = c;
      read(changed);
    }
  }
}

/// OpenCV's standard model, k1 k2 p1 p2 k3, at (0.5, 0, 1): r2 = 0.25.
TEST(LensProfile, OfTheStandardModel) {
  json text = plain_profile();
  text["distortion_model"] = "opencv_standard";
  text["fisheye_params"]["distortion_coeffs"] = {-0.2, 0.1, 0.001, 0.002, 0.03};
  const double radial = 1 - 0.2 * 0.25 + 0.1 * 0.0625 + 0.03 * 0.015625;
  EXPECT_NEAR(parsed(text).camera.project({0.5, 0, 1}).value().x(),
              966 + 880 * (0.5 * radial + 0.002 * (0.25 + 2 * 0.25)), 1e-9);
}

/// The profiles as drone pilots have them; each pixel by the formula above, unstretched.
TEST(LensProfileRealData, OfAllSamplesProjectAsOpenCv) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "real/lens_profiles");
  int profiles = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".json") continue;
    const json text = json::parse(base::read_text(entry.path()));
    const Calibration calibration = read_calibration(entry.path());
    const auto stretch = [&](const char* key) { return text.contains(key) ? text[key].get<double>() : 1.0; };
    const double x = stretch("input_horizontal_stretch"), y = stretch("input_vertical_stretch");
    for (const geometry::Vec3& ray : {geometry::Vec3(0, 0, 1), {0.2, -0.1, 1}, {-0.3, 0.2, 1}, {0.1, 0.25, 1}}) {
      const geometry::Vec2 expected = fisheye_pixel(text, ray);
      const geometry::Vec2 pixel = calibration.camera.project(ray).value();
      EXPECT_NEAR((pixel.x() + 0.5) * x - 0.5, expected.x(), 1e-6) << entry.path();
      EXPECT_NEAR((pixel.y() + 0.5) * y - 0.5, expected.y(), 1e-6) << entry.path();
    }
    ++profiles;
  }
  EXPECT_EQ(profiles, 17);
  const LensProfile hero5 =
      parse_lens_profile(base::read_text(folder / "GoPro_HERO5_Black_Wide_EIS-Y_4by3.json"), "hero5");
  EXPECT_THAT(hero5.notes, ElementsAre(HasSubstr("EIS")));
  EXPECT_NEAR(hero5.modes.front().readout_s.value(), 0.0333666, 1e-12);
  EXPECT_GT(hero5.modes.size(), 10U);
}

}  // namespace
}  // namespace tileflight::imaging::lens_profile_test
