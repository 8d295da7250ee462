// The library as somebody else uses it: installed and found by find_package(), or fetched as a subproject.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/run_program.h"
#include "tests/source_folder.h"
#include "tests/tiny_flight.h"
#include "tileflight/world/ground_truth/mesh_glb.h"

namespace tileflight::library_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using tests::file_text;
using tests::run_command;
using tests::run_tileflight;

const fs::path kSource = tests::source_folder();

/// Runs a command and expects it to succeed; returns what it printed.
std::string run(const std::vector<std::string>& command) {
  const tests::ProgramResult result = run_command(command);
  EXPECT_EQ(result.exit_code, 0) << command.front() << ' ' << command.at(1) << ":\n" << result.out << result.err;
  return result.out;
}

/// Configures and builds the project of `source` in `build`: all of it, or only `target`.
void build_project(const fs::path& source, const fs::path& build, const std::vector<std::string>& options,
                   const std::string& target = "all") {
  std::vector<std::string> configure{TILEFLIGHT_CMAKE, "-G", "Ninja", "-S", source.string(), "-B", build.string()};
  configure.insert(configure.end(), options.begin(), options.end());
  run(configure);
  run({TILEFLIGHT_CMAKE, "--build", build.string(), "--parallel", "2", "--target", target});
}

/// The surface of a cube whose edges are 2 m.
imaging::TexturedMesh make_cube() {
  imaging::TexturedMesh cube;
  for (int i = 0; i < 8; ++i) cube.mesh.vertices.emplace_back(2 * (i & 1), i & 2, (i & 4) / 2);
  cube.mesh.triangles = {{0, 1, 3}, {0, 3, 2}, {4, 7, 5}, {4, 6, 7}, {0, 5, 1}, {0, 4, 5},
                         {2, 3, 7}, {2, 7, 6}, {0, 2, 6}, {0, 6, 4}, {1, 5, 7}, {1, 7, 3}};
  return cube;
}

TEST(Library, TheInstalledPackageDoesWhatTheProgramDoes) {
  const tests::TemporaryFolder folder;
  const fs::path installed = folder / "installed", build = folder / "consumer";
  run({TILEFLIGHT_CMAKE, "--install", TILEFLIGHT_BUILD_DIR, "--prefix", installed.string()});
  EXPECT_THAT(run({(installed / "bin/tileflight").string(), "--version"}), HasSubstr("tileflight"));
  build_project(kSource / "examples/consumer", build, {"-DCMAKE_PREFIX_PATH=" + installed.string()});

  // The surface touches all of 4 x 4 x 4 cells but the inner 2 x 2 x 2.
  ground_truth::write_mesh_glb(folder / "cube.glb", {make_cube()}, false);
  EXPECT_THAT(run({(build / "voxelize_mesh").string(), (folder / "cube.glb").string(), "0.5",
                   (folder / "cube.binvox").string()}),
              HasSubstr("56 cells of 4 x 4 x 4"));
  EXPECT_TRUE(fs::exists(folder / "cube.binvox"));

  // Image by image, the library ends with the program's trajectory, byte for byte.
  tests::TinyFlight::copy_to(folder / "dataset");
  const std::string printed =
      run({(build / "track_frames").string(), (folder / "dataset").string(), (folder / "trajectory.txt").string()});
  EXPECT_THAT(printed, HasSubstr("of 36 images tracked"));
  ASSERT_EQ(
      run_tileflight({"odometry", (folder / "dataset").string(), "--out", (folder / "odometry").string()}).exit_code,
      0);
  EXPECT_EQ(file_text(folder / "trajectory.txt"), file_text(folder / "odometry/trajectory.txt"));
}

TEST(Library, AnUnknownComponentIsNamed) {
  const tests::TemporaryFolder folder;
  const fs::path installed = folder / "installed";
  run({TILEFLIGHT_CMAKE, "--install", TILEFLIGHT_BUILD_DIR, "--prefix", installed.string()});
  std::ofstream(folder / "CMakeLists.txt") << "cmake_minimum_required(VERSION 3.25)\nproject(p LANGUAGES CXX)\n"
                                              "find_package(tileflight REQUIRED COMPONENTS geometry odometri)\n";
  const auto result = run_command({TILEFLIGHT_CMAKE, "-S", folder.path().string(), "-B", (folder / "build").string(),
                                   "-DCMAKE_PREFIX_PATH=" + installed.string()});
  EXPECT_NE(result.exit_code, 0);
  EXPECT_THAT(result.err, HasSubstr("odometri"));
}

TEST(Library, IsASubprojectByFetchContent) {
  // In the same folder each time, so that only what has changed since the last test is built again.
  const fs::path folder = fs::path(TILEFLIGHT_BUILD_DIR) / "subproject_consumer";
  fs::create_directories(folder);
  std::ofstream(folder / "CMakeLists.txt") << R"(cmake_minimum_required(VERSION 3.25)
project(subproject_consumer LANGUAGES CXX)
include(FetchContent)
FetchContent_Declare(tileflight SOURCE_DIR )"
                                           << kSource << R"()
FetchContent_MakeAvailable(tileflight)
add_executable(centre centre.cpp)
target_link_libraries(centre PRIVATE tileflight::geometry)
)";
  std::ofstream(folder / "centre.cpp") << R"(#include <iostream>
#include "tileflight/core/geometry/voxel_grid.h"
int main() {
  const tileflight::geometry::VoxelGrid grid{{1, 2, 3}, 0.5, {4, 4, 4}, {{1, 2, 3}}};
  std::cout << cell_centers(grid).positions.at(0).transpose() << '\n';
}
)";
  build_project(folder, folder / "build",
                {"-DTILEFLIGHT_ONLY=base;geometry", "-DCMAKE_BUILD_TYPE=Debug",
                 "-DCMAKE_CXX_FLAGS_DEBUG=", "-DCMAKE_UNITY_BUILD=ON", "-DCMAKE_UNITY_BUILD_BATCH_SIZE=40"},
                "centre");
  EXPECT_THAT(run({(folder / "build/centre").string(), ""}), HasSubstr("1.75 3.25 4.75"));
}

}  // namespace
}  // namespace tileflight::library_test
