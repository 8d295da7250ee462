#include "tileflight/evaluation/registration/registration_warnings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <optional>

namespace tileflight::registration::registration_warnings_test {
namespace {

using geometry::Vec3;
using ::testing::HasSubstr;

/// The severity of the warning about the transform's uncertainty, where images show the path to be off by
/// `path_error_m`.
std::optional<Severity> warning_of_sigma(double sigma_m, double path_error_m) {
  RegistrationResult r;
  r.sigma_m = sigma_m;
  r.method = "pictures";
  r.pictures = PictureAgreement{.tried = 20,
                                .located = 20,
                                .inliers = 20,
                                .correlation = 0.98,
                                .path_error_m = path_error_m,
                                .path_length_m = 1000.0};
  add_registration_warnings({}, {}, r);
  for (const Warning& warning : r.warnings)
    if (warning.message.find("uncertain") != std::string::npos) return warning.severity;
  return std::nullopt;
}

/// Two sigmas against 0.1 m, or against what the path is off anyway.
TEST(RegistrationWarnings, AnUncertaintyThatMayHideAnErrorIsAWarning) {
  EXPECT_EQ(warning_of_sigma(0.04, 0.02), std::nullopt);
  EXPECT_EQ(warning_of_sigma(0.06, 0.02), Severity::kWarning);
  EXPECT_EQ(warning_of_sigma(0.06, 0.05), std::nullopt);
  EXPECT_EQ(warning_of_sigma(0.12, 0.10), Severity::kNote);
  EXPECT_EQ(warning_of_sigma(0.12, 0.05), Severity::kWarning);
  EXPECT_EQ(warning_of_sigma(0.25, 0.10), Severity::kError);
  EXPECT_EQ(warning_of_sigma(0.25, 1.00), Severity::kError);
  EXPECT_EQ(warning_of_sigma(std::numeric_limits<double>::quiet_NaN(), 0.02), Severity::kNote);
}

/// The severity of the warning that a map at a place that was searched does not match it; `correlation` and `agreeing`
/// of 20 images.
std::optional<Severity> warning_of_rays(double score, double correlation, std::size_t agreeing,
                                        bool along_path = false) {
  RegistrationResult r;
  r.start = kSearchedStart;
  r.method = "pictures";
  r.pictures = PictureAgreement{
      .tried = 20, .located = 20, .inliers = agreeing, .correlation = correlation, .along_path = along_path};
  r.rays = RayAgreement{.score = score};
  add_registration_warnings({}, {}, r);
  for (const Warning& warning : r.warnings)
    if (warning.message.find("seen from its own cameras") != std::string::npos) return warning.severity;
  return std::nullopt;
}

/// Two thirds of a roof's rays agree with a similar roof, and all images are found there, with a poor correlation.
TEST(RegistrationWarnings, ASearchedPlaceThatResemblesLittleNeedsBetterRays) {
  EXPECT_EQ(warning_of_rays(0.55, 0.61, 19), Severity::kWarning);
  EXPECT_EQ(warning_of_rays(0.69, 0.59, 20), Severity::kWarning);
  EXPECT_EQ(warning_of_rays(0.80, 0.61, 20), std::nullopt);
  EXPECT_EQ(warning_of_rays(0.57, 0.89, 20), Severity::kWarning);
  EXPECT_EQ(warning_of_rays(0.55, 0.96, 20), std::nullopt);
  EXPECT_EQ(warning_of_rays(0.30, 0.61, 20), Severity::kError);
}

TEST(RegistrationWarnings, ImagesLocatedAllAlongThePathNeedLessOfTheRays) {
  EXPECT_EQ(warning_of_rays(0.67, 0.49, 20, true), std::nullopt);
  EXPECT_EQ(warning_of_rays(0.67, 0.49, 19, true), Severity::kWarning);
  EXPECT_EQ(warning_of_rays(0.55, 0.49, 20, true), Severity::kWarning);
}

TEST(RegistrationWarnings, ImagesThatLookTheSameOutweighTheRaysOverClutter) {
  EXPECT_EQ(warning_of_rays(0.30, 0.96, 20), Severity::kWarning);
  EXPECT_EQ(warning_of_rays(0.20, 0.96, 20), Severity::kError);
  EXPECT_EQ(warning_of_rays(0.20, 0.98, 20), Severity::kNote);
  EXPECT_EQ(warning_of_rays(0.20, 0.98, 18), Severity::kError) << "some images do not agree";
}

/// Where textures have changed, images are off the path by their own errors, which do not excuse a large uncertainty.
TEST(RegistrationWarnings, ChangedTexturesAreNamedAndTheirUncertaintyCounts) {
  const auto warnings = [](double correlation) {
    RegistrationResult r;
    r.method = "pictures";
    r.sigma_m = 0.065;
    r.surface.points = 1000;
    r.surface.inlier_share = 0.9;
    r.pictures = PictureAgreement{.tried = 20,
                                  .located = 20,
                                  .inliers = 20,
                                  .correlation = correlation,
                                  .path_error_m = 0.09,
                                  .path_length_m = 94.0};
    add_registration_warnings({}, {}, r);
    std::string found;
    for (const Warning& warning : r.warnings) found += warning.message + "; ";
    return found;
  };
  EXPECT_EQ(warnings(0.97), "");
  EXPECT_THAT(warnings(0.65), HasSubstr("look different from the place (correlation 0.65)"));
  EXPECT_THAT(warnings(0.65), HasSubstr("the transform's uncertainty is 0.07 m"));
}

/// The warnings about a receiver's positions that are off by `off`, beside a path on a quarter circle that is right. By
/// the telemetry's own similarity, with clocks 0.9 s apart, the path lies 3.6 m farther along.
std::string warnings_of_positions(const Vec3& off) {
  constexpr double kRadius_m = 18.0, kSpeed_m_s = 4.0, kOffset_s = 0.9;
  RegistrationEvidence evidence;
  for (int i = 0; i <= 70; ++i) {
    const double time_s = 0.1 * i, angle = kSpeed_m_s * time_s / kRadius_m;
    const Vec3 place = kRadius_m * Vec3(std::cos(angle), std::sin(angle), 0.0);
    evidence.path.poses.push_back({time_s, {Eigen::Quaterniond::Identity(), place}});
    evidence.positions.push_back({time_s, place + off, 0.5, 0.9});
  }
  RegistrationResult r;
  r.start = "positions";
  r.method = "pictures";
  r.pictures = PictureAgreement{.tried = 20, .located = 20, .inliers = 20, .correlation = 0.98};
  const Eigen::Quaterniond along(Eigen::AngleAxisd(-kSpeed_m_s * kOffset_s / kRadius_m, Vec3::UnitZ()));
  r.telemetry = alignment::TrajectoryAlignment{
      .T_local_map = {1.0, along, off}, .time_offset_s = kOffset_s, .time_offset_sigma_s = 0.3, .pairs = 71};
  add_registration_warnings({}, evidence, r);
  std::string found;
  for (const Warning& warning : r.warnings)
    if (warning.message.find("telemetry's") != std::string::npos) found += warning.message;
  return found;
}

TEST(RegistrationWarnings, AnArcSlidAlongItselfIsNotWhereTheReceiverWas) {
  EXPECT_EQ(warnings_of_positions(Vec3(0.4, -0.3, 0.5)), "");
  EXPECT_THAT(warnings_of_positions(Vec3(6.0, -1.0, 0.0)), HasSubstr("6.0 m east and -1.0 m north"));
  EXPECT_THAT(warnings_of_positions(Vec3(0.0, 0.0, -30.0)), HasSubstr("30.0 m lower"));
}

}  // namespace
}  // namespace tileflight::registration::registration_warnings_test
