// Folders of the TUM RGB-D benchmark, made up here after its page on file formats.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/moving_picture.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/frame_layers.h"
#include "tileflight/data/exports/export_dataset.h"

namespace tileflight::exports::tum_rgbd_layout_test {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using tests::refusal_of;

class TumRgbd : public testing::Test {
 protected:
  /// Three images of the size given, with depth for the first and the last.
  fs::path sequence(const std::string& name, int width = 640, int height = 480) {
    const fs::path folder = folder_ / name;
    fs::create_directories(folder / "rgb");
    fs::create_directories(folder / "depth");
    for (int i = 0; i < 3; ++i)
      imaging::write_rgb(folder / ("rgb/130503110" + std::to_string(i) + ".175304.png"),
                         tests::moving_picture(width, height, i));
    imaging::Gray16Image units(width, height, 12500);
    units(3, 2) = 0;
    for (const char* time : {"1305031100.160407", "1305031102.180409"}) write_depth(folder, time, units);
    base::write_file(
        folder / "rgb.txt",
        "# color images\n# file: 'rgbd.bag'\n# timestamp filename\n1305031100.175304 rgb/1305031100.175304.png\n"
        "1305031101.175304 rgb/1305031101.175304.png\n1305031102.175304 rgb/1305031102.175304.png\n");
    base::write_file(folder / "depth.txt",
                     "# depth maps\n1305031100.160407 depth/1305031100.160407.png\n1305031101.2 depth/no_such.png\n"
                     "1305031102.180409 depth/1305031102.180409.png\n");
    base::write_file(folder / "groundtruth.txt",
                     "# ground truth trajectory\n1305031098.6659 1.3563 0.6305 1.6380 0.6132 0.5962 -0.3311 -0.3986\n"
                     "1305031098.6758 1.3543 0.6306 1.6360 0.6129 0.5966 -0.3316 -0.3980\n");
    return folder;
  }
  static void write_depth(const fs::path& folder, const std::string& time, const imaging::Gray16Image& units) {
    const auto png = imaging::encode_png(units);
    base::write_file(folder / "depth" / (time + ".png"), {reinterpret_cast<const char*>(png.data()), png.size()});
  }
  static std::string refused(const fs::path& folder) {
    return refusal_of([&] { dataset::read_dataset(folder); });
  }
  tests::TemporaryFolder folder_;
};

TEST_F(TumRgbd, AFolderIsADatasetAsItLies) {
  const dataset::Dataset dataset = dataset::read_dataset(sequence("rgbd_dataset_freiburg1_xyz"));
  EXPECT_THAT(dataset.warnings, IsEmpty());
  ASSERT_EQ(dataset.frames.size(), 3U);
  EXPECT_EQ(dataset.frames[2].time_s, 1305031102.175304);
  EXPECT_EQ(dataset.frames[2].id, "1305031102.175304");
  const auto& lens = std::get<imaging::PinholeRational>(dataset.calibration.camera.model());
  EXPECT_EQ(lens.fx, 517.3);
  EXPECT_THAT(lens.d, ElementsAre(0.2624, -0.9531, -0.0054, 0.0026, 1.1633, 0, 0, 0, 0, 0, 0, 0));
  ASSERT_TRUE(dataset.groundtruth);
  EXPECT_EQ(dataset.groundtruth->poses[1].T_local_camera.translation.z(), 1.6360);
  const auto depth_m = dataset::read_depth(dataset, dataset.frames[0]);  // taken 15 ms before the picture
  ASSERT_TRUE(depth_m);
  EXPECT_EQ((*depth_m)(0, 0), 2.5F);
  EXPECT_EQ((*depth_m)(3, 2), std::numeric_limits<float>::infinity());
  EXPECT_FALSE(dataset::read_depth(dataset, dataset.frames[1]));
  EXPECT_EQ(dataset.frames[2].depth.filename(), "1305031102.180409.png");
}

TEST_F(TumRgbd, TheCameraIsKnownByTheFoldersNameOrAskedFor) {
  const auto fx = [](const dataset::Dataset& dataset) {
    return std::visit([](const auto& m) { return m.fx; }, dataset.calibration.camera.model());
  };
  EXPECT_EQ(fx(dataset::read_dataset(sequence("rgbd_dataset_freiburg2_desk") / "")), 520.9);
  EXPECT_EQ(fx(dataset::read_dataset(sequence("freiburg3_office") / ".")), 535.4);
  const fs::path other = sequence("kitchen");
  EXPECT_THAT(refused(other), HasSubstr("name a calibration (--camera)"));
  base::write_file(folder_ / "camera.txt", "Pinhole 400 401 320 240 0\n640 480\nnone\n640 480\n");
  EXPECT_EQ(fx(dataset::read_dataset(other, {folder_ / "camera.txt", ""})), 400.0);
  base::write_file(other / "calibration.yaml",  // VSLAM-LAB's sequences of 2024
                   "%YAML:1.0\n\nCamera.model: OPENCV\nCamera.fx: 300\nCamera.fy: 300\nCamera.cx: 320\nCamera.cy: 240\n"
                   "Camera.k1: 0.0\nCamera.k2: 0.0\nCamera.p1: 0.0\nCamera.p2: 0.0\nCamera.k3: 0.0\nCamera.w: 640\n"
                   "Camera.h: 480\nCamera.fps: 30\n\n# Depth map factor\ndepth_factor: 6553.5\n");
  EXPECT_EQ(fx(dataset::read_dataset(other)), 300.0);
  EXPECT_EQ(dataset::read_dataset(other).depth_units_per_m, 6553.5);
  EXPECT_THAT(refused(sequence("freiburg1_small", 64, 48)), HasSubstr("the calibration is for images of 640x480"));
}

TEST_F(TumRgbd, BecomesVslamLabsLayout) {
  const dataset::Dataset source = dataset::read_dataset(sequence("rgbd_dataset_freiburg2_xyz"));
  export_dataset(source, "vslamlab", folder_ / "out", false);
  const dataset::Dataset read = dataset::read_dataset(folder_ / "out");
  ASSERT_EQ(read.frames.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(read.frames[i].time_s, source.frames[i].time_s);
  EXPECT_TRUE(read.frames[1].depth.empty());
  EXPECT_EQ((*dataset::read_depth(read, read.frames[2]))(0, 0), 2.5F);
  EXPECT_EQ(read.depth_units_per_m, 5000.0);
  EXPECT_EQ(std::get<imaging::PinholeRational>(read.calibration.camera.model()).d[4], 0.9172);
  EXPECT_EQ(read.groundtruth->size(), 2U);
}

TEST_F(TumRgbd, BrokenFilesAreOneClearLine) {
  const fs::path folder = sequence("freiburg3_a");
  const auto refused_list = [&](const std::string& text) {
    base::write_file(folder / "rgb.txt", text);
    return refused(folder);
  };
  EXPECT_THAT(refused_list(""), HasSubstr("rgb.txt: none of its frames has an image"));
  EXPECT_THAT(refused_list("1305031100.175304\n"), HasSubstr("rgb.txt: line 1: expected \"seconds file\""));
  EXPECT_THAT(refused_list("1 a.png 3\n"), HasSubstr("line 1: expected \"seconds file\""));
  EXPECT_THAT(refused_list("inf rgb/1305031100.175304.png\n"), HasSubstr("line 1: expected \"seconds file\""));
  EXPECT_THAT(refused_list("# a\n1 ../freiburg3_b/0.png\n"),
              HasSubstr("line 2: \"../freiburg3_b/0.png\" is not a file"));
  EXPECT_THAT(refused_list("1 /tmp/0.png\n"), HasSubstr("is not a file within the dataset's folder"));
  EXPECT_THAT(refused_list("2 rgb/1305031100.175304.png\n1 rgb/1305031101.175304.png\n"),
              HasSubstr("is not after the one before it"));
  base::write_file(folder / "rgb.txt", "1 rgb/1305031100.175304.png\n");
  base::write_file(folder / "depth.txt", "1 ../../d.png\n");
  EXPECT_THAT(refused(folder), HasSubstr("depth.txt: line 1: \"../../d.png\" is not a file within"));
  fs::remove(folder / "rgb.txt");
  EXPECT_THAT(refused(folder), HasSubstr("rgb.csv (VSLAM-LAB) or rgb.txt (TUM RGB-D) in it"));
}

}  // namespace
}  // namespace tileflight::exports::tum_rgbd_layout_test
