#include "tileflight/data/dataset/lidar_files.h"

#include <gmock/gmock.h>

#include <cstring>
#include <fstream>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"

namespace tileflight::dataset::lidar_files_test {
namespace {

using testing::HasSubstr;

const std::vector<ScanPoint> kPoints{{{1.5F, -2.25F, 1e-3F}, 0.75F, 0.0F, 3},
                                     {{-100.0F, 3.0F, 8.0F}, 0.1F, 0.099F, 63}};

// Checked with the project's general point cloud reader, which is independent of this writer.
TEST(LidarFiles, APlyScanComesBackWhole) {
  const tests::TemporaryFolder folder;
  write_scan_ply(folder / "a.ply", kPoints);
  const std::vector<ScanPoint> read = read_scan(folder / "a.ply");
  ASSERT_EQ(read.size(), kPoints.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read[i].position, kPoints[i].position);
    EXPECT_EQ(read[i].intensity, kPoints[i].intensity);
    EXPECT_EQ(read[i].time_s, kPoints[i].time_s);
    EXPECT_EQ(read[i].ring, kPoints[i].ring);
  }
  write_scan_ply(folder / "none.ply", {});
  EXPECT_TRUE(read_scan(folder / "none.ply").empty());
}

TEST(LidarFiles, ABinScanIsKittisFourFloatsAPoint) {
  const tests::TemporaryFolder folder;
  write_scan_bin(folder / "a.bin", kPoints);
  const std::string bytes = base::read_text(folder / "a.bin");
  ASSERT_EQ(bytes.size(), 32U);
  float values[8];
  std::memcpy(values, bytes.data(), 32);
  EXPECT_EQ(values[1], -2.25F);
  EXPECT_EQ(values[7], 0.1F);
  EXPECT_EQ(read_scan(folder / "a.bin").at(1).position, kPoints[1].position);
}

TEST(LidarFiles, DamageIsNamed) {
  const tests::TemporaryFolder folder;
  std::ofstream(folder / "a.bin") << "12345";
  EXPECT_THAT(tests::refusal_of([&] { read_scan(folder / "a.bin"); }), HasSubstr("not a multiple of four floats"));
  EXPECT_THAT(tests::refusal_of([&] { read_scan(folder / "a.las"); }), HasSubstr("unknown lidar scan format"));
}

}  // namespace
}  // namespace tileflight::dataset::lidar_files_test
