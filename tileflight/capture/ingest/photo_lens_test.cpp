#include "tileflight/capture/ingest/photo_lens.h"

#include <gmock/gmock.h>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tests/test_data.h"
#include "tileflight/capture/ingest/ingest_stage.h"
#include "tileflight/data/dataset/dataset.h"

namespace tileflight::ingest::photo_lens_test {
namespace {

using flight_logs::PhotoLensTags;
using flight_logs::PhotoLog;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// The tags of a P4 Multispectral's photo.
PhotoLensTags survey_tags() {
  PhotoLensTags tags;
  tags.width = tags.taken_width = 1600;
  tags.height = tags.taken_height = 1300;
  tags.focal_length_35mm = 40;
  tags.design_focal_px = 1913.333374;
  tags.design_centre_x_px = 800;
  tags.design_centre_y_px = 650;
  tags.dewarp = {1973.09, 1955.65, -19.04, -11.42, -0.42, 0.37, 0.0041, 0.0042, -0.26};
  tags.dewarp_date = "2022-03-02";
  return tags;
}

PhotoLens lens_of(const std::vector<PhotoLensTags>& tags) {
  PhotoLog log;
  for (std::size_t i = 0; i < tags.size(); ++i) log.lenses.emplace_back(std::to_string(i) + ".jpg", tags[i]);
  return lens_of_photos(log, "photos");
}

/// OpenCV's projection of a point at depth 1 (calib3d, "Detailed Description"), written out here.
geometry::Vec2 opencv_pixel(double x, double y, double fx, double fy, double cx, double cy,
                            const std::vector<double>& d) {
  const double r2 = x * x + y * y;
  double radial = 1 + d[0] * r2 + d[1] * r2 * r2 + d[4] * r2 * r2 * r2;
  if (d.size() > 5) radial /= 1 + d[5] * r2 + d[6] * r2 * r2 + d[7] * r2 * r2 * r2;
  const double u = x * radial + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x);
  const double v = y * radial + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y;
  return {fx * u + cx, fy * v + cy};
}

TEST(PhotoLens, IsDjisCalibrationOfTheCamera) {
  const PhotoLens lens = lens_of({survey_tags(), survey_tags()});
  EXPECT_EQ(lens.source, "DewarpData");
  EXPECT_EQ(lens.photo, "photos/0.jpg");
  EXPECT_EQ(lens.calibration.camera.width(), 1600);
  EXPECT_EQ(lens.calibration.camera.height(), 1300);
  EXPECT_THAT(lens.warnings,
              ElementsAre(HasSubstr("DewarpData of 0.jpg, of 2022-03-02): fx 1973.1, fy 1955.7, cx 781.0, "
                                    "cy 638.6 pixels of images of 1600x1300")));
  for (const auto& [x, y] : {std::pair{0.0, 0.0}, {0.3, -0.2}, {-0.35, 0.25}, {0.1, 0.3}}) {
    const geometry::Vec2 expected =
        opencv_pixel(x, y, 1973.09, 1955.65, 800 - 19.04, 650 - 11.42, {-0.42, 0.37, 0.0041, 0.0042, -0.26});
    EXPECT_NEAR((lens.calibration.camera.project({x, y, 1}).value() - expected).norm(), 0.0, 1e-9) << x << " " << y;
  }
}

TEST(PhotoLens, OfTwelveNumbersIsRational) {
  PhotoLensTags tags = survey_tags();
  tags.dewarp = {1973.0, 1955.0, 5.0, -6.0, 0.1, 0.02, 0.001, -0.002, 0.003, 0.12, 0.01, 0.004};
  const PhotoLens lens = lens_of({tags});
  EXPECT_EQ(lens.source, "DewarpDataK6");
  const geometry::Vec2 expected =
      opencv_pixel(0.3, -0.2, 1973, 1955, 805, 644, {0.1, 0.02, 0.001, -0.002, 0.003, 0.12, 0.01, 0.004});
  EXPECT_NEAR((lens.calibration.camera.project({0.3, -0.2, 1}).value() - expected).norm(), 0.0, 1e-9);
}

TEST(PhotoLens, OfImagesThatTheCameraUndistortedHasNoDistortion) {
  PhotoLensTags tags = survey_tags();
  tags.is_dewarped = true;
  const PhotoLens lens = lens_of({tags});
  EXPECT_NEAR((lens.calibration.camera.project({0.3, -0.2, 1}).value() -
               geometry::Vec2(1973.09 * 0.3 + 780.96, -1955.65 * 0.2 + 638.58))
                  .norm(),
              0.0, 1e-9);
  EXPECT_THAT(lens.warnings, ElementsAre(HasSubstr("DewarpData of"), HasSubstr("(DewarpFlag 1)")));
}

TEST(PhotoLens, IsTheDesignThenAGuess) {
  PhotoLensTags tags = survey_tags();
  tags.dewarp.clear();
  const PhotoLens design = lens_of({tags});
  EXPECT_EQ(design.source, "CalibratedFocalLength");
  EXPECT_THAT(design.warnings, ElementsAre(HasSubstr("DJI's design (CalibratedFocalLength of 0.jpg)")));
  EXPECT_NEAR(design.calibration.camera.project({0.1, 0, 1}).value().x(), 800 + 191.3333374, 1e-9);
  tags.design_focal_px.reset();
  const PhotoLens guess = lens_of({tags});
  EXPECT_EQ(guess.source, "FocalLengthIn35mmFilm");
  EXPECT_THAT(guess.warnings,
              ElementsAre(HasSubstr("a guess by EXIF's focal length (FocalLengthIn35mmFilm of 0.jpg, 40 mm)")));
  // The design, 1913.33 pixels, tells that the diagonal counts: by the width the guess would be 1778 pixels.
  EXPECT_NEAR(guess.calibration.camera.project({1, 0, 1}).value().x() - 799.5,
              40 * std::hypot(1600, 1300) / std::hypot(36, 24), 1e-2);
  EXPECT_NEAR(guess.calibration.camera.project({1, 0, 1}).value().x() - 799.5, 1913.33, 0.005 * 1913.33);
}

TEST(PhotoLens, IsAGuessByTheSensorsPixelsWhereNothingElseIsStated) {
  PhotoLensTags tags;
  tags.width = 3600;  // the photo was made smaller afterwards
  tags.height = 2700;
  tags.taken_width = 4000;
  tags.taken_height = 3000;
  tags.focal_plane_px = 2775.3;
  const PhotoLens lens = lens_of({tags});
  EXPECT_TRUE(lens.is_guess);
  EXPECT_THAT(lens.warnings, ElementsAre(HasSubstr("EXIF's focal length (FocalPlaneXResolution of 0.jpg): fx 2775.3")));
  EXPECT_EQ(lens.calibration.camera.width(), 4000);
}

TEST(PhotoLens, NumbersThatCannotBeTrueArePassedOver) {
  PhotoLensTags tags = survey_tags();
  tags.dewarp = {0, 0, 0, 0, 0, 0, 0, 0, 0};
  const PhotoLens lens = lens_of({tags});
  EXPECT_EQ(lens.source, "CalibratedFocalLength");
  EXPECT_THAT(lens.warnings.front(), HasSubstr("DewarpData of 0.jpg is not used: 0 and 0 pixels are no focal lengths"));
  tags = survey_tags();
  tags.focal_length_35mm = 24;
  EXPECT_THAT(lens_of({tags}).warnings.back(), HasSubstr("DewarpData states 1973 pixels, but EXIF's "
                                                         "FocalLengthIn35mmFilm gives 1144"));
}

/// Photos that a program made smaller keep DJI's tags, which are for the size at which they were taken.
TEST(PhotoLens, IsForTheSizeAtWhichThePhotosWereTaken) {
  PhotoLensTags tags = survey_tags();
  tags.width = 800;
  tags.height = 650;
  EXPECT_EQ(lens_of({tags}).calibration.camera.width(), 1600) << "EXIF states it";
  tags.taken_width = tags.width = 1600;
  tags.taken_height = tags.height = 1300;
  tags.design_centre_x_px = 2736;
  EXPECT_EQ(lens_of({tags}).source, "FocalLengthIn35mmFilm") << "neither size has this optical centre";
}

TEST(PhotoLens, OfSeveralCamerasIsRefused) {
  PhotoLensTags other = survey_tags();
  other.dewarp[0] += 20;
  EXPECT_THAT(tests::refusal_of([&] {
                lens_of({survey_tags(), other});
              }),
              HasSubstr("different lenses by DewarpData: 0.jpg fx 1973.1"));
  other.dewarp.clear();
  EXPECT_THAT(lens_of({survey_tags(), other}).warnings.back(), HasSubstr("1 of 2 photos have no DewarpData"));
  EXPECT_THAT(tests::refusal_of([&] { lens_of({}); }), HasSubstr("--camera"));
  EXPECT_THAT(tests::refusal_of([&] { lens_of({PhotoLensTags{}}); }), HasSubstr("do not state their lens"));
}

TEST(PhotoLens, IsComparedWithAGivenCalibration) {
  PhotoLog log;
  log.lenses.emplace_back("a.jpg", survey_tags());
  imaging::Calibration given;
  given.camera = imaging::make_fisheye(1600, 1300, 60);
  EXPECT_THAT(find_lens_warnings(log, given), ElementsAre(HasSubstr("the photos' own (DewarpData of a.jpg) is not")));
  log.lenses[0].second.is_dewarped = true;
  EXPECT_THAT(find_lens_warnings(log, given), ElementsAre(HasSubstr("is not"), HasSubstr("(DewarpFlag 1)")));
  given.camera = imaging::make_pinhole(1600, 1300, 60);
  EXPECT_THAT(find_lens_warnings(log, given), ElementsAre(HasSubstr("is not")));
  EXPECT_THAT(find_lens_warnings({}, given), IsEmpty());
}

TEST(PhotoLens, SaysNothingAgainstACalibrationThatIsThePhotosOwn) {
  PhotoLog log;
  log.lenses.emplace_back("a.jpg", survey_tags());
  const tests::TemporaryFolder folder;
  imaging::Calibration own = lens_of_photos(log, {}).calibration;
  imaging::write_kalibr(folder / "camera.yaml", own);
  EXPECT_THAT(find_lens_warnings(log, imaging::read_kalibr(folder / "camera.yaml")), IsEmpty());
  own.camera = own.camera.scaled_to(own.camera.width() / 2, own.camera.height() / 2);
  EXPECT_THAT(find_lens_warnings(log, own), IsEmpty()) << "of smaller images";
  PhotoLensTags other = survey_tags();
  other.dewarp[0] += 2.0;  // pixels of focal length
  log.lenses.front().second = other;
  EXPECT_THAT(find_lens_warnings(log, own), ElementsAre(HasSubstr("is not")));
}

/// A survey with RTK and no calibration file: lens, times and positions come from the photos' tags.
TEST(PhotoLensRealData, ASurveyIsIngestedByItsPhotosAlone) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "real/mirafiori");
  const tests::TemporaryFolder out;
  IngestedFlightConfig flight;
  flight.video = folder;
  const IngestResult result = ingest_dataset(flight, {}, out / "set", false);
  EXPECT_THAT(result.warnings,
              ElementsAre(HasSubstr("(DewarpData of DJI_0010.JPG, of 2022-03-02): fx 1973.1, fy 1955.7"),
                          HasSubstr("as above the ellipsoid, because of DJI's tags")));
  const dataset::Dataset set = dataset::read_dataset(out / "set");
  EXPECT_EQ(set.frames.size(), 32U);
  EXPECT_EQ(set.metadata.at("calibration.tag"), "DewarpData");
  EXPECT_EQ(set.calibration.camera.width(), 1600);
  ASSERT_EQ(set.gps.size(), 32U);
  for (const dataset::GpsFix& fix : set.gps) {
    EXPECT_NEAR(fix.horizontal_sigma_m, 0.012, 0.004);
    EXPECT_NEAR(fix.vertical_sigma_m, 0.021, 0.006);
    EXPECT_NEAR(fix.position.height.m, 349.5, 0.5) << "as it stands in the photos, and not 48 m higher";
  }
}

}  // namespace
}  // namespace tileflight::ingest::photo_lens_test
