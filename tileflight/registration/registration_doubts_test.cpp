#include "tileflight/registration/registration_doubts.h"

#include <gtest/gtest.h>

#include <limits>

namespace tileflight::registration::registration_doubts_test {
namespace {

/// How sure the doubt about the transform's uncertainty is, where images show the path to be off by `path_error_m`.
std::string doubt_of_sigma(double sigma_m, double path_error_m) {
  RegistrationResult r;
  r.sigma_m = sigma_m;
  r.method = "pictures";
  r.pictures = PictureAgreement{
      .tried = 20, .located = 20, .inliers = 20, .path_error_m = path_error_m, .path_length_m = 1000.0};
  add_registration_doubts({}, {}, r);
  for (const Doubt& doubt : r.doubts)
    if (doubt.what.find("uncertain") != std::string::npos) return doubt.how_sure;
  return "none";
}

/// Two sigmas against 0.1 m, or against what the path is off anyway.
TEST(RegistrationDoubts, AnUncertaintyThatMayHideAnErrorIsLikely) {
  EXPECT_EQ(doubt_of_sigma(0.04, 0.02), "none");
  EXPECT_EQ(doubt_of_sigma(0.06, 0.02), "likely");
  EXPECT_EQ(doubt_of_sigma(0.06, 0.05), "none");
  EXPECT_EQ(doubt_of_sigma(0.12, 0.10), "possible");
  EXPECT_EQ(doubt_of_sigma(0.12, 0.05), "likely");
  EXPECT_EQ(doubt_of_sigma(0.25, 0.10), "certain");
  EXPECT_EQ(doubt_of_sigma(0.25, 1.00), "certain");
  EXPECT_EQ(doubt_of_sigma(std::numeric_limits<double>::quiet_NaN(), 0.02), "possible");
}

}  // namespace
}  // namespace tileflight::registration::registration_doubts_test
