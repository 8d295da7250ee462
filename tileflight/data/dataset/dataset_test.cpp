#include "tileflight/data/dataset/dataset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <tbb/parallel_for.h>

#include <csignal>
#include <fstream>

#include "tests/moving_picture.h"
#include "tests/temporary_folder.h"
#include "tests/test_data.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/core/imaging/photometric.h"

namespace tileflight::dataset::dataset_test {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using tests::moving_picture;
using tests::refusal_of;
using tileflight::tests::TemporaryFolder;

constexpr int kWidth = 64;
constexpr int kHeight = 48;

imaging::Calibration calibration() {
  imaging::Calibration calibration;
  calibration.camera = imaging::make_fisheye(kWidth, kHeight, 155.0, {-0.04, 5e-4, 0, 1e-8});
  calibration.line_delay_s = 1e-5;
  return calibration;
}

std::vector<GpsFix> fixes() {
  return {{0.0, {-0.24, -78.52, {2885.25}}, 0.25, 0.4}, {0.1, {-0.2400001234567, -78.5200001, {2885.5}}, 0.25, 0.4}};
}

geometry::Trajectory poses() {
  geometry::Trajectory trajectory;
  for (int i = 0; i < 5; ++i)
    trajectory.poses.push_back({0.1 * i, geometry::SE3(geometry::so3_exp({0.1 * i, 0, 0}), {1.0 * i, 2, 3})});
  return trajectory;
}

/// Writes five frames with everything that a dataset can hold.
void write_whole(const fs::path& folder, DatasetWriter::Options options = {}, bool parallel = false) {
  DatasetWriter writer(folder, calibration(), options);
  const auto add = [&](int i) { writer.add_frame(i, 0.1 * i, 5.0 + i, moving_picture(kWidth, kHeight, i)); };
  if (parallel)
    tbb::parallel_for(0, 5, [&](int i) { add(4 - i); });
  else
    for (int i = 0; i < 5; ++i) add(i);
  writer.set_groundtruth(poses());
  writer.set_gps(fixes());
  writer.describe("sensor.seed", "7");
  writer.describe("sensor.note", "quotes \" and: colons");
  writer.describe("source", "test");
  writer.finish();
}

/// Every file of a folder with its content.
std::map<std::string, std::string> contents(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) files[fs::relative(entry.path(), folder)] = base::read_text(entry.path());
  return files;
}

std::vector<std::string> names(const fs::path& folder) {
  std::vector<std::string> all;
  for (const auto& entry : fs::directory_iterator(folder)) all.push_back(entry.path().filename());
  return all;
}

TEST(Dataset, LayoutIsTheContracts) {
  TemporaryFolder folder;
  write_whole(folder / "set");
  const auto files = contents(folder / "set");
  std::vector<std::string> found;
  for (const auto& [name, content] : files) found.push_back(name);
  EXPECT_THAT(found, ElementsAre(".tileflight", "camera.txt", "camera.yaml", "dataset.yaml", "gps.csv",
                                 "groundtruth.txt", "images/000000.jpg", "images/000001.jpg", "images/000002.jpg",
                                 "images/000003.jpg", "images/000004.jpg", "times.txt"));
  EXPECT_EQ(files.at("times.txt"),
            "000000 0 5\n000001 0.1 6\n000002 0.2 7\n000003 0.30000000000000004 8\n000004 0.4 9\n");
  EXPECT_THAT(
      files.at("gps.csv"),
      testing::StartsWith("t,lat,lon,height,horizontal_sigma,vertical_sigma\n0,-0.24,-78.52,2885.25,0.25,0.4\n"));
  EXPECT_THAT(files.at("camera.txt"), testing::StartsWith("KannalaBrandt "));
}

TEST(Dataset, ReadsWhatItWrote) {
  TemporaryFolder folder;
  write_whole(folder / "set");
  const Dataset dataset = read_dataset(folder / "set");
  EXPECT_TRUE(dataset.warnings.empty());
  ASSERT_EQ(dataset.frames.size(), 5U);
  EXPECT_EQ(dataset.frames[3].id, "000003");
  EXPECT_EQ(dataset.frames[3].time_s, 0.1 * 3);
  EXPECT_EQ(dataset.frames[3].exposure_ms, 8.0);
  EXPECT_GT(tests::psnr(imaging::read_rgb(dataset.frames[3].image), moving_picture(kWidth, kHeight, 3)), 38.0);
  EXPECT_EQ(dataset.calibration.line_delay_s, 1e-5);
  EXPECT_NEAR(dataset.calibration.camera.horizontal_fov_deg(), 155.0, 1e-9);
  ASSERT_TRUE(dataset.groundtruth.has_value());
  EXPECT_EQ(dataset.groundtruth->size(), 5U);
  ASSERT_EQ(dataset.gps.size(), 2U);
  EXPECT_EQ(dataset.gps[1].position.latitude_deg, fixes()[1].position.latitude_deg);
  EXPECT_EQ(dataset.gps[1].position.height.m, 2885.5);
  EXPECT_EQ(dataset.gps[1].vertical_sigma_m, 0.4);
  EXPECT_EQ(dataset.metadata.at("sensor.seed"), "7");
  EXPECT_EQ(dataset.metadata.at("sensor.note"), "quotes \" and: colons");
  EXPECT_EQ(dataset.metadata.at("source"), "test");
  EXPECT_TRUE(dataset.pcalib.empty());
}

TEST(Dataset, SameBytesInAnyOrderAndFromSeveralThreads) {
  TemporaryFolder folder;
  write_whole(folder / "a");
  write_whole(folder / "b", {}, true);
  EXPECT_EQ(contents(folder / "a"), contents(folder / "b"));
}

TEST(Dataset, PngAndPhotometricFiles) {
  TemporaryFolder folder;
  {
    DatasetWriter writer(folder / "set", calibration(), {.png = true});
    writer.add_frame(0, 1.5, 0.0, moving_picture(kWidth, kHeight, 0));
    imaging::write_vignette(writer.temporary_folder() / "vignette.png", imaging::FloatImage(kWidth, kHeight, 1.0F));
    base::write_file(writer.temporary_folder() / "pcalib.txt", "0 1 2\n");
    writer.finish();
  }
  const Dataset dataset = read_dataset(folder / "set");
  EXPECT_EQ(dataset.frames[0].image.filename(), "000000.png");
  EXPECT_EQ(imaging::read_rgb(dataset.frames[0].image).pixels, moving_picture(kWidth, kHeight, 0).pixels);
  EXPECT_EQ(dataset.pcalib, folder / "set/pcalib.txt");
  EXPECT_EQ(dataset.vignette, folder / "set/vignette.png");
  EXPECT_FALSE(dataset.groundtruth.has_value());
}

TEST(DatasetWriter, NothingIsThereBeforeFinishNorWithoutIt) {
  TemporaryFolder folder;
  {
    DatasetWriter writer(folder / "set", calibration(), {});
    writer.add_frame(0, 0.0, 0.0, moving_picture(kWidth, kHeight, 0));
    EXPECT_FALSE(fs::exists(folder / "set"));
  }
  EXPECT_TRUE(names(folder.path()).empty());
}

TEST(DatasetWriter, ExistingFolderIsRefusedAtOnceUnlessReplaced) {
  TemporaryFolder folder;
  write_whole(folder / "set");
  base::write_file(folder / "set/mine.txt", "precious");
  EXPECT_THAT(refusal_of([&] { DatasetWriter(folder / "set", calibration(), {}); }), HasSubstr("exists already"));
  EXPECT_THAT(refusal_of([&] { DatasetWriter(folder / "set", calibration(), {.replace = true}); }),
              HasSubstr("holds mine.txt, which tileflight did not write"));
  EXPECT_TRUE(fs::exists(folder / "set/mine.txt"));
  fs::remove(folder / "set/mine.txt");
  {
    DatasetWriter interrupted(folder / "set", calibration(), {.replace = true});
    interrupted.add_frame(0, 0.0, 0.0, moving_picture(kWidth, kHeight, 0));
  }
  EXPECT_TRUE(fs::exists(folder / "set/groundtruth.txt"));
  {
    DatasetWriter other(folder / "set", calibration(), {.replace = true});
    other.add_frame(0, 0.0, 0.0, moving_picture(kWidth, kHeight, 0));
    other.finish();
  }
  EXPECT_FALSE(fs::exists(folder / "set/groundtruth.txt"));
  EXPECT_THAT(names(folder.path()), ElementsAre("set"));
}

TEST(DatasetWriter, WhatCameMeanwhileIsMovedAside) {
  TemporaryFolder folder;
  DatasetWriter writer(folder / "set", calibration(), {.build_folder = folder / ".set.frames/dataset"});
  writer.add_frame(0, 0.0, 0.0, moving_picture(kWidth, kHeight, 0));
  base::write_file(folder / "set", "a file has come there");
  EXPECT_NE(refusal_of([&] { writer.finish(); }), "no error");
  EXPECT_EQ(base::read_text(folder / "set.before"), "a file has come there");
  EXPECT_EQ(read_dataset(folder / "set").frames.size(), 1U);
}

TEST(DatasetWriter, TimesMustIncreaseAndFramesMustBe) {
  TemporaryFolder folder;
  {
    DatasetWriter writer(folder / "set", calibration(), {});
    EXPECT_THAT(refusal_of([&] { writer.finish(); }), HasSubstr("no frames"));
    writer.add_frame(0, 1.0, 0.0, moving_picture(kWidth, kHeight, 0));
    writer.add_frame(1, 1.0, 0.0, moving_picture(kWidth, kHeight, 1));
    EXPECT_THAT(refusal_of([&] { writer.finish(); }), HasSubstr("000001"));
  }
  EXPECT_TRUE(names(folder.path()).empty());
}

/// Limits the size of every file that the process writes, to simulate a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) : old_handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &old_);
    const rlimit limit{bytes, old_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &old_);
    std::signal(SIGXFSZ, old_handler_);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  void (*old_handler_)(int);
  rlimit old_{};
};

TEST(DatasetWriter, NoSpaceLeavesNothing) {
  TemporaryFolder folder;
  {
    const FileSizeLimit limit(1000);
    EXPECT_THAT(refusal_of([&] { write_whole(folder / "set"); }), HasSubstr("cannot be written"));
  }
  EXPECT_TRUE(names(folder.path()).empty());
}

TEST(DatasetWriter, FolderThatCannotBeMade) {
  TemporaryFolder folder;
  base::write_file(folder / "file", "x");
  EXPECT_THAT(refusal_of([&] { DatasetWriter(folder / "file/set", calibration(), {}); }),
              HasSubstr("cannot be created"));
  EXPECT_THAT(refusal_of([&] { DatasetWriter(folder / "file", calibration(), {.replace = true}); }),
              HasSubstr("not a folder"));
}

// ---- folders written by other programs ----

/// A folder in DSO's layout: PNG images named by hand, camera.txt.
struct DsoFolder {
  explicit DsoFolder(const fs::path& path) : folder(path) {
    fs::create_directories(folder / "images");
    for (const char* name : {"a", "b", "c"})
      imaging::write_rgb(folder / "images" / (std::string(name) + ".png"), moving_picture(kWidth, kHeight, name[0]));
    base::write_file(folder / "camera.txt", "Pinhole 50 50 32 24 0\n64 48\ncrop\n64 48\n");
    times("a 1.0 2.5\nb 1.5\nc 2.25 3\n");
  }
  void times(const std::string& text) const { base::write_file(folder / "times.txt", text); }
  std::string error() const {
    return refusal_of([&] { read_dataset(folder); });
  }
  fs::path folder;
};

TEST(DsoLayout, TimesByName) {
  TemporaryFolder folder;
  const DsoFolder dso(folder / "set");
  const Dataset dataset = read_dataset(dso.folder);
  ASSERT_EQ(dataset.frames.size(), 3U);
  EXPECT_EQ(dataset.frames[1].id, "b");
  EXPECT_EQ(dataset.frames[1].time_s, 1.5);
  EXPECT_EQ(dataset.frames[1].exposure_ms, 0.0);
  EXPECT_EQ(dataset.frames[2].exposure_ms, 3.0);
  EXPECT_TRUE(dataset.warnings.empty());
}

TEST(DsoLayout, WithoutTimesFramesAreNumbered) {
  TemporaryFolder folder;
  const DsoFolder dso(folder / "set");
  fs::remove(dso.folder / "times.txt");
  const Dataset dataset = read_dataset(dso.folder);
  EXPECT_DOUBLE_EQ(dataset.frames[2].time_s, 2.0 / 30.0);
  EXPECT_THAT(dataset.warnings, ElementsAre(HasSubstr("no times.txt")));
}

/// A folder of images that are named by numbers without leading zeros; image N shows the moving picture N.
void write_numbered(const fs::path& images, int count) {
  fs::create_directories(images);
  for (int i = 1; i <= count; ++i)
    imaging::write_rgb(images / ("frame_" + std::to_string(i) + ".png"), moving_picture(kWidth, kHeight, i));
}

TEST(DsoLayout, NamesAreOrderedByTheirNumbers) {
  TemporaryFolder folder;
  write_numbered(folder / "set/images", 12);
  base::write_file(folder / "set/camera.txt", "Pinhole 50 50 32 24 0\n64 48\ncrop\n64 48\n");
  const Dataset dataset = read_dataset(folder / "set");
  ASSERT_EQ(dataset.frames.size(), 12U);
  for (std::size_t i = 0; i < 12; ++i)
    EXPECT_EQ(dataset.frames[i].image.filename(), "frame_" + std::to_string(i + 1) + ".png");
  EXPECT_THAT(dataset.warnings,
              ElementsAre(HasSubstr("in the order of the numbers in their names (frame_9.png before frame_10.png)"),
                          HasSubstr("no times.txt")));
}

TEST(DsoLayout, TimesInAnotherOrderThanTheNamesAreNamed) {
  TemporaryFolder folder;
  write_numbered(folder / "set/images", 3);
  base::write_file(folder / "set/camera.txt", "Pinhole 50 50 32 24 0\n64 48\ncrop\n64 48\n");
  base::write_file(folder / "set/times.txt", "frame_1 1\nframe_3 2\nframe_2 3\n");
  const Dataset dataset = read_dataset(folder / "set");
  EXPECT_EQ(dataset.frames[1].image.filename(), "frame_3.png");
  EXPECT_THAT(dataset.warnings, ElementsAre(HasSubstr("(frame_3.png is earlier than frame_2.png); the times decide")));
}

TEST(EurocLayout, WithoutACsvTheTimesAreTheNames) {
  TemporaryFolder folder;
  const fs::path camera = folder / "set/mav0/cam0";
  fs::create_directories(camera / "data");
  for (const char* time_ns : {"999900000", "1000000000", "1050000000"})
    imaging::write_rgb(camera / "data" / (std::string(time_ns) + ".png"), moving_picture(kWidth, kHeight, 0));
  base::write_file(
      camera / "sensor.yaml",
      "intrinsics: [50, 50, 32, 24]\ndistortion_model: radial-tangential\ndistortion_coefficients: [0, 0, 0, "
      "0]\nresolution: [64, 48]\n");
  const Dataset dataset = read_dataset(folder / "set");
  ASSERT_EQ(dataset.frames.size(), 3U);
  EXPECT_DOUBLE_EQ(dataset.frames[0].time_s, 0.9999);
  EXPECT_DOUBLE_EQ(dataset.frames[1].time_s, 1.0);
  EXPECT_THAT(dataset.warnings, ElementsAre(HasSubstr("no data.csv; the times are the names of the images")));
}

TEST(DsoLayout, AnImuWithoutAStatedMountIsNamed) {
  TemporaryFolder folder;
  const DsoFolder dso(folder / "set");
  base::write_file(dso.folder / "imu.csv", "0,0,0,0,0,0,9.8\n");
  EXPECT_THAT(read_dataset(dso.folder).warnings,
              ElementsAre(HasSubstr("no calibration states where the camera is on the inertial unit")));
}

TEST(DsoLayout, BareSecondsAndImagesLeftOut) {
  TemporaryFolder folder;
  const DsoFolder dso(folder / "set");
  dso.times("0.0\n0.5\n1.0\n");
  EXPECT_EQ(read_dataset(dso.folder).frames[2].time_s, 1.0);
  dso.times("# comment\na 1\n\nc 2\n");
  const Dataset dataset = read_dataset(dso.folder);
  EXPECT_EQ(dataset.frames[1].image.filename(), "c.png");
  EXPECT_THAT(dataset.warnings, ElementsAre(HasSubstr("1 images have no time")));
}

TEST(DsoLayout, TimesInOtherUnitsAreToldByTheirSize) {
  TemporaryFolder folder;
  const DsoFolder dso(folder / "set");
  dso.times("a 1403636579763555584\nb 1403636579813555456\nc 1403636579863555584\n");
  const Dataset dataset = read_dataset(dso.folder);
  EXPECT_NEAR(dataset.frames[0].time_s, 1403636579.763555584, 1e-6);
  EXPECT_NEAR(dataset.frames[1].time_s - dataset.frames[0].time_s, 0.05, 1e-6);
  EXPECT_THAT(dataset.warnings, ElementsAre(HasSubstr("the times are taken as nanoseconds")));
}

TEST(DsoLayout, BadTimesAreOneClearLine) {
  TemporaryFolder folder;
  const DsoFolder dso(folder / "set");
  dso.times("a 1\nb x\n");
  EXPECT_THAT(dso.error(), AllOf(HasSubstr("times.txt: line 2"), HasSubstr("\"x\"")));
  dso.times("a 1\nb nan\n");
  EXPECT_THAT(dso.error(), HasSubstr("line 2"));
  dso.times("a 1\nb 1\n");
  EXPECT_THAT(dso.error(), HasSubstr("\"b\" is not after"));
  dso.times("a 1\nd 2\n");
  EXPECT_THAT(dso.error(), AllOf(HasSubstr("line 2"), HasSubstr("\"d\" has no image")));
  dso.times("1\n2\n");
  EXPECT_THAT(dso.error(), HasSubstr("2 times for 3 images"));
  dso.times("1\nb 2\n3\n");
  EXPECT_THAT(dso.error(), HasSubstr("others do not"));
  dso.times("a 1 -2\n");
  EXPECT_THAT(dso.error(), HasSubstr("negative"));
  dso.times("a 1 2 3\n");
  EXPECT_THAT(dso.error(), HasSubstr("expected"));
  dso.times("");
  EXPECT_THAT(dso.error(), HasSubstr("no times"));
}

TEST(DsoLayout, BadFoldersAreOneClearLine) {
  TemporaryFolder folder;
  const DsoFolder dso(folder / "set");
  base::write_file(dso.folder / "camera.txt", "Pinhole 50 50 32 24 0\n640 480\n");
  EXPECT_THAT(dso.error(), AllOf(HasSubstr("640x480"), HasSubstr("64x48")));
  fs::remove(dso.folder / "camera.txt");
  EXPECT_THAT(dso.error(), HasSubstr("no camera calibration"));
  base::write_file(dso.folder / "camera.txt", "Pinhole 50 50 32 24 0\n64 48\n");
  base::write_file(dso.folder / "images/a.png", "broken");
  EXPECT_THAT(dso.error(), HasSubstr("a.png"));
  fs::remove_all(dso.folder / "images");
  EXPECT_THAT(dso.error(), HasSubstr("expected images/"));
  fs::create_directory(dso.folder / "images");
  EXPECT_THAT(dso.error(), HasSubstr("no images"));
  EXPECT_THAT(refusal_of([&] { read_dataset(folder / "none"); }), HasSubstr("no such dataset folder"));
}

TEST(DsoLayout, BadSideFilesAreOneClearLine) {
  TemporaryFolder folder;
  const DsoFolder dso(folder / "set");
  base::write_file(dso.folder / "gps.csv", "t,lat,lon,height,horizontal_sigma,vertical_sigma\n0,91,0,0,1,1\n");
  EXPECT_THAT(dso.error(), AllOf(HasSubstr("gps.csv: line 2"), HasSubstr("latitude")));
  base::write_file(dso.folder / "gps.csv", "0,1,0,0,1\n");
  EXPECT_THAT(dso.error(), HasSubstr("found 5"));
  base::write_file(dso.folder / "gps.csv", "0,1,0,nan,1,1\n");
  EXPECT_THAT(dso.error(), HasSubstr("finite"));
  base::write_file(dso.folder / "gps.csv", "0,1,0,0,1,1\n0,1,0,0,1,1\n");
  EXPECT_THAT(dso.error(), HasSubstr("not after"));
  base::write_file(dso.folder / "gps.csv", "0,1,0,0,-1,1\n");
  EXPECT_THAT(dso.error(), HasSubstr("negative"));
  fs::remove(dso.folder / "gps.csv");
  base::write_file(dso.folder / "dataset.yaml", "a: [1, 2\n");
  EXPECT_THAT(dso.error(), HasSubstr("YAML"));
  base::write_file(dso.folder / "dataset.yaml", "a: {b: 1, c: [x, y]}\n");
  const auto about = read_dataset(dso.folder).metadata;
  EXPECT_EQ(about.at("a.b"), "1");
  EXPECT_EQ(about.at("a.c.1"), "y");
}

TEST(KittiLayout, CalibTimesAndPoses) {
  TemporaryFolder folder;
  fs::create_directories(folder / "image_0");
  for (int i = 0; i < 2; ++i)
    imaging::write_rgb(folder / "image_0" / ("00000" + std::to_string(i) + ".png"), moving_picture(kWidth, kHeight, i));
  base::write_file(folder / "calib.txt", "P0: 50 0 31 0 0 51 23 0 0 0 1 0\nP1: 50 0 31 -9 0 51 23 0 0 0 1 0\n");
  base::write_file(folder / "times.txt", "0.0\n1.04e-01\n");
  base::write_file(folder / "poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n0 0 1 5 0 1 0 6 -1 0 0 7\n");
  const Dataset dataset = read_dataset(folder.path());
  EXPECT_EQ(dataset.frames[1].time_s, 0.104);
  EXPECT_EQ(*dataset.calibration.camera.project({1, 1, 1}), geometry::Vec2(81, 74));
  EXPECT_EQ(dataset.groundtruth->poses[1].T_local_camera.translation, geometry::Vec3(5, 6, 7));
  EXPECT_LT((dataset.groundtruth->poses[1].T_local_camera * geometry::Vec3(0, 0, 1) - geometry::Vec3(6, 6, 7)).norm(),
            1e-12);
  base::write_file(folder / "poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n");
  EXPECT_THAT(refusal_of([&] { read_dataset(folder.path()); }), HasSubstr("1 poses for 2 images"));
  base::write_file(folder / "calib.txt", "P0: 50 0\n");
  EXPECT_THAT(refusal_of([&] { read_dataset(folder.path()); }), HasSubstr("expected 12 numbers"));
}

TEST(KittiLayout, ColourImagesAloneAreReadWithTheirOwnMatrix) {
  TemporaryFolder folder;
  for (const char* const camera : {"image_2", "image_3"}) {
    fs::create_directories(folder / camera);
    for (int i = 0; i < 2; ++i)
      imaging::write_rgb(folder / camera / ("00000" + std::to_string(i) + ".png"), moving_picture(kWidth, kHeight, i));
  }
  base::write_file(folder / "calib.txt",
                   "P0: 90 0 1 0 0 90 2 0 0 0 1 0\nP1: 90 0 1 -9 0 90 2 0 0 0 1 0\nP2: 50 0 31 3 0 51 23 0 0 0 1 0\n"
                   "P3: 50 0 31 -25 0 51 23 0 0 0 1 0\n");
  base::write_file(folder / "times.txt", "0.0\n1.04e-01\n");
  base::write_file(folder / "poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 5 0 1 0 6 0 0 1 7\n");
  const Dataset left = read_dataset(folder.path());
  EXPECT_EQ(left.frames.size(), 2U);
  EXPECT_EQ(*left.calibration.camera.project({1, 1, 1}), geometry::Vec2(81, 74));
  EXPECT_LT((left.groundtruth->poses[1].T_local_camera.translation - geometry::Vec3(5 - 0.06, 6, 7)).norm(), 1e-12);
  const Dataset right = read_dataset(folder.path(), {.name = "image_3"});
  EXPECT_LT((right.groundtruth->poses[0].T_local_camera.translation - geometry::Vec3(0.5, 0, 0)).norm(), 1e-12);
  base::write_file(folder / "calib.txt", "P0: 90 0 1 0 0 90 2 0 0 0 1 0\n");
  EXPECT_THAT(refusal_of([&] { read_dataset(folder.path()); }), HasSubstr("has no P2, for image_2"));
}

TEST(RealSequences, SevenScenes) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "sequences/seven_scenes_500");
  const Dataset dataset = read_dataset(folder);
  EXPECT_EQ(dataset.frames.size(), 500U);
  EXPECT_EQ(dataset.frames[1].time_s, 16.7);
  EXPECT_EQ(dataset.calibration.camera.width(), 640);
  EXPECT_EQ(dataset.groundtruth->size(), 500U);
  EXPECT_TRUE(dataset.warnings.empty());
}

TEST(RealSequences, Kitti) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "sequences/kitti_seq1_51frames");
  const Dataset dataset = read_dataset(folder);
  EXPECT_EQ(dataset.frames.size(), 51U);
  EXPECT_EQ(dataset.calibration.camera.width(), 1226);
  EXPECT_EQ(dataset.calibration.camera.height(), 370);
  EXPECT_NEAR(geometry::path_length_m(*dataset.groundtruth), 59.9, 0.1);
}

TEST(RealSequences, EurocWithMissingImages) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "sequences/euroc_V1_01_static");
  const Dataset dataset = read_dataset(folder);
  EXPECT_EQ(dataset.frames.size(), 25U);
  EXPECT_NEAR(dataset.frames[0].time_s, 1403715274.262143, 1e-6);
  EXPECT_THAT(dataset.warnings, ElementsAre(HasSubstr("70 of 95 frames")));
  EXPECT_EQ(dataset.calibration.camera.width(), 752);
  // T_BS maps camera to body; its inverse maps the camera's place in the body to the camera's origin.
  EXPECT_LT(
      (dataset.calibration.T_cam_imu * geometry::Vec3(-0.0216401454975, -0.064676986768, 0.00981073058949)).norm(),
      1e-12);
}

}  // namespace
}  // namespace tileflight::dataset::dataset_test
