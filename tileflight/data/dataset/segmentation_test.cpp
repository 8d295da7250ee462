#include "tileflight/data/dataset/segmentation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/frame_layers.h"

namespace tileflight::dataset::segmentation_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using tests::refusal_of;
using tests::TemporaryFolder;

using Labels = imaging::Image<std::uint32_t>;

Labels labels(const std::vector<std::uint32_t>& values) {
  Labels image(static_cast<int>(values.size()) / 2, 2);
  image.pixels = values;
  return image;
}

const SegmentedObject kMill{.tile = "b", .mesh = 0, .feature = 10, .name = "Mill, \"old\""};
const SegmentedObject kHall{.tile = "b", .mesh = 0, .feature = 9, .name = "Hall"};
const SegmentedObject kMeadow{.tile = "a"};
const SegmentedObject kNeverSeen{.tile = "0"};

TEST(Segmentation, IdsAreThoseOfTheSortedObjectsThatAreSeen) {
  const TemporaryFolder folder;
  SegmentationWriter writer(folder.path(), {.segmentation = true, .infrared = true});
  // Two parts of a flight that number their objects differently.
  writer.add(1, labels({1, 1, 0, 2, 2, 1}), std::vector{kMill, kHall});
  writer.add(0, labels({3, 3, 3, 3, 2, 0}), std::vector{kNeverSeen, kMill, kMeadow});
  writer.finish();
  using Ids = std::vector<std::uint16_t>;
  EXPECT_EQ(imaging::read_gray16(folder / "segmentation/000001.png").pixels, (Ids{3, 3, 0, 2, 2, 3}));
  EXPECT_EQ(imaging::read_gray16(folder / "segmentation/000000.png").pixels, (Ids{1, 1, 1, 1, 3, 0}));
  EXPECT_EQ(imaging::read_gray(folder / "infrared/000001.png").pixels, (std::vector<std::uint8_t>{3, 3, 0, 2, 2, 3}));
  EXPECT_EQ(base::read_text(folder / "segmentation.csv"),
            "id,tile,mesh,feature,name\n1,a,0,,\n2,b,0,9,Hall\n3,b,0,10,\"Mill, \"\"old\"\"\"\n");
  EXPECT_FALSE(fs::exists(folder / "segmentation.runs"));
}

TEST(Segmentation, FramesOfSeveralWritersAreNumberedTogether) {
  const TemporaryFolder apart, together;
  const auto a = labels({1, 1, 0, 2, 2, 1}), b = labels({3, 3, 3, 3, 2, 0});
  const std::vector<SegmentedObject> of_a{kMill, kHall}, of_b{kNeverSeen, kMill, kMeadow};
  const SegmentationOptions both{.segmentation = true, .infrared = true};
  SegmentationWriter(apart.path(), both).add(1, a, of_a);  // a process that ended, and one that goes on
  base::write_file(apart / "segmentation.runs/.000002.4000000-0.tmp", "of a process that was killed");
  const SegmentationWriter second(apart.path(), both);
  second.add(0, b, of_b);
  second.finish();
  const SegmentationWriter one(together.path(), both);
  one.add(0, b, of_b);
  one.add(1, a, of_a);
  one.finish();
  for (const char* file :
       {"segmentation/000000.png", "segmentation/000001.png", "infrared/000001.png", "segmentation.csv"})
    EXPECT_EQ(base::read_text(apart / file), base::read_text(together / file)) << file;
  EXPECT_FALSE(fs::exists(apart / "segmentation/.000002.4000000-0.tmp.png"));
}

TEST(Segmentation, FramesThatAreKeptElsewhereStayThere) {
  const TemporaryFolder folder, kept;
  const SegmentationOptions options{.runs_folder = kept / "runs"};
  SegmentationWriter(folder.path(), options).add(0, labels({1, 1, 0, 2, 2, 1}), std::vector{kMill, kHall});
  for (int attempt = 0; attempt < 2; ++attempt) {  // the first one may have been stopped just before its end
    SegmentationWriter(folder.path(), options).finish();
    EXPECT_EQ(imaging::read_gray16(folder / "segmentation/000000.png").pixels,
              (std::vector<std::uint16_t>{2, 2, 0, 1, 1, 2}));
    EXPECT_TRUE(fs::exists(kept / "runs/000000"));
  }
}

TEST(Segmentation, AFileThatIsCutShortIsSaid) {
  const TemporaryFolder folder;
  const SegmentationWriter writer(folder.path(), {});
  writer.add(0, labels({1, 1, 0, 2, 2, 1}), std::vector{kMill, kHall});
  const std::string whole = base::read_text(folder / "segmentation.runs/000000");
  for (const std::size_t size : {std::size_t{3}, std::size_t{20}, whole.size() - 1}) {
    base::write_file(folder / "segmentation.runs/000000", whole.substr(0, size));
    EXPECT_THAT(refusal_of([&] { writer.finish(); }), HasSubstr("is truncated")) << size;
  }
}

TEST(Segmentation, SixteenBitsAreUsedWhollyAndNotMore) {
  const auto write = [](std::uint32_t count, const fs::path& folder) {
    SegmentationWriter writer(folder, {.infrared = true});
    std::vector<SegmentedObject> objects(count);
    Labels image(static_cast<int>(count), 1);
    for (std::uint32_t i = 0; i < count; ++i) {
      objects[i] = {.tile = "t", .feature = i};
      image.pixels[i] = i + 1;
    }
    writer.add(0, image, objects);
    writer.finish();
  };
  const TemporaryFolder all, too_many;
  write(65535, all.path());
  const auto ids = imaging::read_gray16(all / "segmentation/000000.png").pixels;
  for (std::size_t i = 0; i < ids.size(); ++i) ASSERT_EQ(ids[i], i + 1);
  const auto grey = imaging::read_gray(all / "infrared/000000.png").pixels;
  EXPECT_EQ(grey[254], 255);
  EXPECT_EQ(grey[255], 1);
  EXPECT_THAT(refusal_of([&] { write(65536, too_many.path()); }), HasSubstr("65536 objects"));
}

TEST(FrameLayers, AreWrittenWhereTheyAreAskedForAndComeBack) {
  const TemporaryFolder folder;
  const imaging::FloatImage depth_m(5, 4, 11.5F), range_m(5, 4, 12.25F);
  const imaging::Image<std::array<float, 3>> normals(5, 4, {0.0F, -0.6F, -0.8F});
  const imaging::Image<std::array<float, 2>> flow_px(5, 4, {1.5F, -2.0F});
  const imaging::GrayImage visibility(5, 4, 255);
  write_frame_layers(folder.path(), 3, {&depth_m, &range_m, &normals, &flow_px, &visibility});
  write_frame_layers(folder.path(), 4, {.range_m = &range_m});
  EXPECT_EQ(imaging::read_exr(folder / "depth/000003.exr").pixels, depth_m.pixels);
  EXPECT_EQ(imaging::read_exr(folder / "range/000003.exr").pixels, range_m.pixels);
  EXPECT_EQ(imaging::read_exr_channel(folder / "normals/000003.exr", "G")(2, 2), -0.6F);
  EXPECT_EQ(imaging::read_exr_channel(folder / "normals/000003.exr", "B")(2, 2), -0.8F);
  EXPECT_EQ(imaging::read_exr_channel(folder / "flow/000003.exr", "R")(4, 3), 1.5F);
  EXPECT_EQ(imaging::read_exr_channel(folder / "flow/000003.exr", "G")(4, 3), -2.0F);
  EXPECT_EQ(imaging::read_gray(folder / "visibility/000003.png").pixels, visibility.pixels);
  EXPECT_TRUE(fs::exists(folder / "range/000004.exr"));
  EXPECT_FALSE(fs::exists(folder / "flow/000004.exr"));
}

}  // namespace
}  // namespace tileflight::dataset::segmentation_test
