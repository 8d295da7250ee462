#include "tileflight/data/dataset/attitude_csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::dataset::attitude_csv_test {
namespace {

using testing::HasSubstr;

constexpr const char* kHeader = "t,qx,qy,qz,qw,tilt_sigma_deg,yaw_sigma_deg\n";

TEST(AttitudeCsv, ComesBackAsItWas) {
  const tests::TemporaryFolder folder;
  const std::vector<CameraAttitude> attitudes = {{0.0, geometry::so3_exp({0.1, -2.0, 0.4}), 0.5, 3.0},
                                                 {0.1, geometry::so3_exp({0.2, -2.0, 0.4}), 2.0, 6.0}};
  write_attitude_csv(folder.path() / "attitude.csv", attitudes);
  const auto read = read_attitude_csv(folder.path() / "attitude.csv");
  ASSERT_EQ(read.size(), 2U);
  EXPECT_LT(read[1].R_enu_camera.angularDistance(attitudes[1].R_enu_camera), 1e-8);
  EXPECT_EQ(read[1].time_s, 0.1);
  EXPECT_EQ(read[0].yaw_sigma_deg, 3.0);
}

TEST(AttitudeCsv, BrokenFilesAreNamedWithTheirRow) {
  const tests::TemporaryFolder folder;
  const auto file = folder.path() / "attitude.csv";
  const auto refused = [&](const std::string& text) {
    base::write_file(file, text);
    return tests::refusal_of([&] { read_attitude_csv(file); });
  };
  EXPECT_THAT(refused("a,b\n1,2\n"), HasSubstr("columns"));
  EXPECT_THAT(refused(std::string(kHeader) + "0,0,0,0,1,1,1\n0,0,0,0,1,1,1\n"), HasSubstr("row 2"));
  EXPECT_THAT(refused(std::string(kHeader) + "0,0,0,0,0.5,1,1\n"), HasSubstr("length"));
  EXPECT_THAT(refused(std::string(kHeader) + "0,0,0,0,1,0,1\n"), HasSubstr("above zero"));
  EXPECT_THAT(refused(std::string(kHeader) + "0,inf,0,0,1,1,1\n"), HasSubstr("finite"));
}

}  // namespace
}  // namespace tileflight::dataset::attitude_csv_test
