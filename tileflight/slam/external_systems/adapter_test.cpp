#include "tileflight/slam/external_systems/adapter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "tests/refusal.h"
#include "tests/source_folder.h"
#include "tests/temporary_folder.h"
#include "tileflight/slam/external_systems/test_adapters.h"

namespace tileflight::external_systems::adapter_test {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using tests::refusal_of;

constexpr const char* kWhole = R"(name: my-slam
title: My SLAM
homepage: https://example.org
licence: MIT
tried: 1.0 (Debian 12)
takes:
  inputs: [images, imu]
  lenses: [pinhole, pinhole-radtan]
  layout: euroc
needs:
  programs: [sh]
  variables: [MY_SLAM_TEST]
version: echo 1.2.3
command: ./go
leaves:
  trajectory: {file: path.txt, pose: world-to-camera, of: imu, times: nanoseconds}
  map: cloud.pcd
  scale: metric
)";

class AdapterFile : public ::testing::Test {
 protected:
  Adapter read(const std::string& manifest) {
    std::ofstream(folder_ / "adapter.yaml") << manifest;
    return read_adapter(folder_.path());
  }
  std::string refusal(const std::string& manifest) {
    return refusal_of([&] { read(manifest); });
  }
  tests::TemporaryFolder folder_;
};

TEST_F(AdapterFile, SaysWhatASystemTakesAndLeaves) {
  const Adapter adapter = read(kWhole);
  EXPECT_EQ(adapter.name, "my-slam");
  EXPECT_EQ(adapter.title, "My SLAM");
  EXPECT_EQ(adapter.tried, "1.0 (Debian 12)");
  EXPECT_THAT(adapter.inputs, ElementsAre(Input::kImages, Input::kImu));
  EXPECT_THAT(adapter.lenses, ElementsAre("pinhole", "pinhole-radtan"));
  EXPECT_EQ(adapter.layout, "euroc");
  EXPECT_THAT(adapter.programs, ElementsAre("sh"));
  EXPECT_THAT(adapter.variables, ElementsAre("MY_SLAM_TEST"));
  EXPECT_EQ(adapter.command, "./go");
  EXPECT_EQ(adapter.path.file, "path.txt");
  EXPECT_FALSE(adapter.path.camera_to_world);
  EXPECT_EQ(adapter.path.of, "imu");
  EXPECT_EQ(adapter.path.times, "nanoseconds");
  EXPECT_EQ(adapter.map, "cloud.pcd");
  EXPECT_TRUE(adapter.metric_scale);
}

TEST_F(AdapterFile, LeavesATumPathAndNoMapUnlessItSaysSo) {
  const Adapter adapter = read("name: a\ntakes: {inputs: [images], lenses: [any]}\n");
  EXPECT_EQ(adapter.title, "a");
  EXPECT_EQ(adapter.layout, "tileflight");
  EXPECT_EQ(adapter.command, "./run");
  EXPECT_EQ(adapter.path.file, "trajectory.txt");
  EXPECT_TRUE(adapter.path.camera_to_world);
  EXPECT_EQ(adapter.map, "");
}

TEST_F(AdapterFile, FaultsNameFileLineAndKey) {
  EXPECT_THAT(refusal("name: a b\ntakes: {inputs: [images], lenses: [any]}\n"), HasSubstr("adapter.yaml:1"));
  EXPECT_THAT(refusal("name: a\n"), HasSubstr("takes"));
  EXPECT_THAT(refusal("name: a\ntakes: {inputs: [picture], lenses: [any]}\n"), HasSubstr("has 'picture'"));
  EXPECT_THAT(refusal("name: a\ntakes: {inputs: [], lenses: [any]}\n"), HasSubstr("is empty"));
  EXPECT_THAT(refusal("name: a\ntakes: {inputs: [images], lenses: [pinhole-radtn]}\n"),
              HasSubstr("did you mean 'pinhole-radtan'?"));
  EXPECT_THAT(refusal("name: a\ntakes: {inputs: [images], lenses: [any], layout: rosbag}\n"), HasSubstr("layout"));
  EXPECT_THAT(refusal("name: a\ntakes: {inputs: [images], lenses: [any]}\ncomand: x\n"),
              HasSubstr("did you mean 'command'?"));
}

TEST_F(AdapterFile, WhatIsMissingIsSaid) {
  Adapter adapter = read(kWhole);
  unsetenv("MY_SLAM_TEST");
  EXPECT_EQ(why_not_installed(adapter), "the environment variable MY_SLAM_TEST is not set");
  EXPECT_EQ(installed_version(adapter), "");
  setenv("MY_SLAM_TEST", "/no/such/folder", 1);
  EXPECT_EQ(why_not_installed(adapter), "MY_SLAM_TEST names /no/such/folder, which does not exist");
  setenv("MY_SLAM_TEST", folder_.path().c_str(), 1);
  EXPECT_EQ(why_not_installed(adapter), "");
  EXPECT_EQ(installed_version(adapter), "1.2.3");
  adapter.programs = {"no-such-program"};
  EXPECT_EQ(why_not_installed(adapter), "the program 'no-such-program' is not in PATH");
  EXPECT_THAT(refusal_of([&] { require_installed(adapter); }),
              ::testing::AllOf(HasSubstr("My SLAM: is not installed: the program 'no-such-program' is not in PATH"),
                               HasSubstr("tileflight systems")));
  adapter.programs.clear();
  require_installed(adapter);
  unsetenv("MY_SLAM_TEST");
}

TEST_F(AdapterFile, OnesOwnComesBeforeTheProgramsOwnOfThatName) {
  test_support::write_adapter(folder_ / "own/colmap", "title: Own\n", "");
  std::ofstream(folder_ / "own/colmap/adapter.yaml")
      << "name: colmap\ntitle: Own\ntakes: {inputs: [images], lenses: [any]}\n";
  setenv("TILEFLIGHT_ADAPTERS", (folder_ / "own").c_str(), 1);
  EXPECT_EQ(find_adapter("colmap").title, "Own");
  EXPECT_THAT(refusal_of([] { find_adapter("colmpa"); }), HasSubstr("did you mean 'colmap'?"));
  EXPECT_EQ(find_adapter("own/colmap", folder_.path()).folder, folder_ / "own/colmap") << "relative to a folder";
  unsetenv("TILEFLIGHT_ADAPTERS");
}

/// Those that come with the program.
TEST(ShippedAdapters, AreReadableAndTheirScriptsAreShort) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(tests::source_folder() / "adapters")) {
    const Adapter adapter = read_adapter(entry.path());
    EXPECT_EQ(adapter.name, entry.path().filename().string());
    names.push_back(adapter.name);
    std::ifstream script(entry.path() / "run");
    int lines = 0;
    for (std::string line; std::getline(script, line);) ++lines;
    EXPECT_GT(lines, 1) << adapter.name;
    EXPECT_LE(lines, 30) << adapter.name;
    EXPECT_EQ(access((entry.path() / "run").c_str(), X_OK), 0) << adapter.name;
  }
  EXPECT_THAT(names, ::testing::IsSupersetOf({"tileflight", "colmap", "dso", "orb-slam3", "openvins", "kiss-icp"}));
}

}  // namespace
}  // namespace tileflight::external_systems::adapter_test
