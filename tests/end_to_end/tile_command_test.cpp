// A user's own mesh as 3D Tiles: the whole way back to voxels, and what goes wrong on the way.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/background_program.h"
#include "tests/run_program.h"
#include "tests/test_data.h"
#include "tests/tiny_place.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::tile_command_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyPlace;

json run_to_json(std::vector<std::string> call) {
  call.emplace_back("--json");
  const ProgramResult result = run_tileflight(call);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  return json::parse(result.out, nullptr, false);
}

/// extract SOURCE, tile its mesh, extract the tiles: the voxels are the same bytes.
void expect_same_voxels(const fs::path& folder, const std::string& source, const std::vector<std::string>& region) {
  std::vector<std::string> first{"extract", source, "--out", (folder / "truth").string()};
  first.insert(first.end(), region.begin(), region.end());
  const json truth = run_to_json(first);
  const json tiled = run_to_json(
      {"tile", (folder / "truth/mesh.glb").string(), "--out", (folder / "tiles").string(), "--tile-triangles", "3000"});
  EXPECT_GE(tiled["levels"].size(), 2U);
  std::vector<std::string> second{"extract", (folder / "tiles").string(), "--out", (folder / "again").string()};
  second.insert(second.end(), region.begin(), region.end());
  const json again = run_to_json(second);
  EXPECT_TRUE(again["complete"].get<bool>());
  EXPECT_LE(again["triangles_loaded"], truth["triangles"]) << "those without area are left out";
  EXPECT_GT(again["triangles_loaded"].get<double>(), 0.999 * truth["triangles"].get<double>());
  EXPECT_EQ(again["voxels_occupied"], truth["voxels_occupied"]);
  EXPECT_TRUE(tests::file_text(folder / "truth/voxels.binvox") == tests::file_text(folder / "again/voxels.binvox"));
}

TEST(TileCommand, VoxelsOfATiledMeshAreThoseOfTheMesh) {
  const tests::TemporaryFolder folder;
  TinyPlace::write(folder / "place");
  expect_same_voxels(folder.path(), (folder / "place").string(), {"--center-local", "0,0,100", "--size", "90,90,20"});
}

TEST(TileCommand, VoxelsOfATiledSurveyAreThoseOfTheSurvey) {
  TILEFLIGHT_REQUIRE_TEST_DATA(tileset, "tilesets/machangara_photogrammetry/tileset.json");
  const tests::TemporaryFolder folder;
  expect_same_voxels(folder.path(), tileset.string(), {"--center-local", "347.8,-131.4,2891.6", "--size", "60,60,100"});
}

/// Hills of 2 cells^2 triangles in four OBJ files with an image each, in folders of their own; their shared border is
/// the same in each. Returns the folder.
fs::path write_hills(const fs::path& folder, int cells) {
  for (int part = 0; part < 4; ++part) {
    const fs::path own = folder / ("part" + std::to_string(part));
    fs::create_directories(own);
    std::ofstream(own / "m.mtl") << "newmtl m\nmap_Kd m.png\n";
    imaging::write_rgb(own / "m.png", imaging::RgbImage(256, 256, {static_cast<std::uint8_t>(60 * part), 120, 90}));
    std::ofstream obj(own / "m.obj");
    obj << "mtllib m.mtl\nusemtl m\n";
    const int half = cells / 2, x0 = part % 2 * half, y0 = part / 2 * half;
    for (int y = y0; y <= y0 + half; ++y)
      for (int x = x0; x <= x0 + half; ++x)
        obj << "v " << x << ' ' << y << ' ' << std::round(128 * (4 * std::sin(0.1 * x) + std::cos(0.3 * y))) / 128
            << "\nvt " << static_cast<double>(x - x0) / half << ' ' << static_cast<double>(y - y0) / half << '\n';
    for (int y = 0; y < half; ++y)
      for (int x = 0; x < half; ++x) {
        const int at = 1 + y * (half + 1) + x;
        const auto face = [&](int a, int b, int c) {
          obj << "f " << a << '/' << a << ' ' << b << '/' << b << ' ' << c << '/' << c << '\n';
        };
        face(at, at + 1, at + half + 2);
        face(at, at + half + 2, at + half + 1);
      }
  }
  return folder;
}

TEST(TileCommand, AFolderOfMeshesIsOneTilesetInMemoryAndOutOfCore) {
  const tests::TemporaryFolder folder;
  const std::string meshes = write_hills(folder / "meshes", 40).string();
  const auto tile = [&](const std::string& out, std::vector<std::string> more) {
    more.insert(more.begin(), {"tile", meshes, "--out", (folder / out).string(), "--tile-triangles", "100"});
    return run_to_json(more);
  };
  const json whole = tile("whole", {}), large = tile("large", {"--out-of-core"});
  const json packed = tile("packed", {"--out-of-core", "--implicit", "--compression", "meshopt"});
  EXPECT_FALSE(whole["out_of_core"].get<bool>());
  for (const json& result : {large, packed}) {
    EXPECT_TRUE(result["out_of_core"].get<bool>());
    EXPECT_TRUE(result["warnings"].empty()) << result["warnings"].dump();
    EXPECT_EQ(result["levels"].back()["triangles"], 3200);
    EXPECT_EQ(result["levels"].size(), whole["levels"].size());
  }
  for (const char* out : {"whole", "large", "packed"}) {
    const json inspected = run_to_json({"inspect", (folder / out).string()});
    EXPECT_EQ(inspected["tiles"], run_to_json({"inspect", (folder / "whole").string()})["tiles"]);
    const json extract =
        run_to_json({"extract", (folder / out).string(), "--out", (folder / (std::string(out) + "-truth")).string(),
                     "--center-local", "20,20,0", "--size", "100,100,40"});
    EXPECT_EQ(extract["triangles"], 3200) << out;
    EXPECT_TRUE(extract["complete"].get<bool>());
  }
  const fs::path truth = folder / "whole-truth/voxels.binvox";
  EXPECT_TRUE(tests::file_text(truth) == tests::file_text(folder / "large-truth/voxels.binvox"));
  EXPECT_TRUE(tests::file_text(truth) == tests::file_text(folder / "packed-truth/voxels.binvox"));
}

/// Files beside the meshes, of finished and unfinished work.
std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

TEST(TileCommand, AKilledRunLeavesNothingHalfAndIsDoneAgain) {
  const tests::TemporaryFolder folder, others;
  const std::vector<std::string> call{"tile",
                                      write_hills(folder / "meshes", 200).string(),
                                      "--out",
                                      (folder / "out").string(),
                                      "--out-of-core",
                                      "--tile-triangles",
                                      "500"};
  bool was_at_work = false;
  {
    tests::BackgroundProgram program(call, others / "killed");
    while (program.runs() && !was_at_work) {
      for (const std::string& name : names_in(folder.path()))
        was_at_work |= fs::exists(folder / name / "tiles") && name != "out";
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    program.kill();
  }
  EXPECT_TRUE(was_at_work);
  EXPECT_FALSE(fs::exists(folder / "out"));
  const ProgramResult again = run_tileflight(call);
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(names_in(folder.path()), (std::vector<std::string>{"meshes", "out"}));
  EXPECT_FALSE(fs::exists(folder / "out/work"));
}

/// A limit on the size of files is met as a full disk is: by a write that fails.
TEST(TileCommand, AFullDiskIsOneLineAndLeavesNothing) {
  const tests::TemporaryFolder folder;
  const std::string meshes = write_hills(folder / "meshes", 100).string();
  for (const char* kilobytes : {"1", "100", "1000"}) {
    const std::string command = "trap '' XFSZ; ulimit -f " + std::string(kilobytes) + "; exec " + TILEFLIGHT_BINARY +
                                " tile " + meshes + " --out " + (folder / "out").string() + " --out-of-core";
    const ProgramResult result = tests::run_command({"bash", "-c", command});
    EXPECT_EQ(result.exit_code, 1) << kilobytes;
    EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
    EXPECT_THAT(result.err, HasSubstr("cannot be written: File too large"));
    EXPECT_EQ(names_in(folder.path()), std::vector<std::string>{"meshes"});
  }
}

class TileFiles : public ::testing::Test {
 protected:
  void write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }

  template <class Matcher>
  void expect_fails(const std::string& mesh, const Matcher& matcher, std::vector<std::string> more = {}) const {
    std::vector<std::string> call{"tile", (folder_ / mesh).string(), "--out", (folder_ / "out").string()};
    call.insert(call.end(), more.begin(), more.end());
    const ProgramResult result = run_tileflight(call);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
    EXPECT_THAT(result.err, matcher);
    EXPECT_EQ(result.out, "");
    for (const auto& entry : fs::directory_iterator(folder_.path()))
      EXPECT_THAT(entry.path().filename().string(), ::testing::Not(HasSubstr("out"))) << "something is left";
  }

  tests::TemporaryFolder folder_;
};

constexpr const char* kTriangle = "v 0 0 0\nv 20 0 0\nv 0 20 2\n";

TEST_F(TileFiles, BadMeshesAreOneLine) {
  expect_fails("nowhere.obj", HasSubstr("nowhere.obj"));
  write("empty.obj", "");
  expect_fails("empty.obj", HasSubstr("no triangle"));
  write("index.obj", std::string(kTriangle) + "f 1 2 7\n");
  expect_fails("index.obj", AllOf(HasSubstr("index.obj, line 4"), HasSubstr("vertex 7")));
  write("nan.obj", "v nan 0 0\n");
  expect_fails("nan.obj", HasSubstr("not finite"));
  write("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
  expect_fails("flat.obj", HasSubstr("area"));
  write("library.obj", std::string("mtllib my.mtl\nusemtl a\n") + kTriangle + "f 1 2 3\n");
  expect_fails("library.obj", HasSubstr("my.mtl"));
  write("my.mtl", "newmtl a\nmap_Kd gone.jpg\n");
  write("texture.obj", std::string("mtllib my.mtl\nusemtl a\nvt 0 0\n") + kTriangle + "f 1/1 2/1 3/1\n");
  expect_fails("texture.obj", AllOf(HasSubstr("gone.jpg"), HasSubstr("--no-textures")));
  write("points.ply",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 "
        "0 0\n");
  expect_fails("points.ply", HasSubstr("points without faces"));
  write("mesh.stl", "solid");
  expect_fails("mesh.stl", HasSubstr(".obj"));
  write("good.obj", std::string(kTriangle) + "f 1 2 3\n");
  expect_fails("good.obj", HasSubstr("EPSG:1"), {"--crs", "EPSG:1"});
  expect_fails("good.obj", HasSubstr("latitude"), {"--georeference", "95,0,0"});
  expect_fails("good.obj", AllOf(HasSubstr("ktx2"), HasSubstr("jpeg")), {"--texture-format", "ktx2"});
  expect_fails("index.obj", AllOf(HasSubstr("index.obj, line 4"), HasSubstr("vertex 7")), {"--out-of-core"});
  expect_fails("flat.obj", HasSubstr("area"), {"--out-of-core"});
  expect_fails("texture.obj", AllOf(HasSubstr("gone.jpg"), HasSubstr("--no-textures")), {"--out-of-core"});
  expect_fails("good.obj",
               AllOf(HasSubstr("--memory 0.01: is too little"), HasSubstr("out of core; allow at least that")),
               {"--memory", "0.01"});
  fs::create_directory(folder_ / "empty");
  expect_fails("empty", HasSubstr("contains no mesh file"));
}

TEST_F(TileFiles, AMeshIsPutOnEarth) {
  write("good.obj", std::string(kTriangle) + "f 1 2 3\n");
  const std::string mesh = (folder_ / "good.obj").string(), out = (folder_ / "tiles").string();
  const json stated = run_to_json({"tile", mesh, "--out", out, "--georeference", "50.5,14.25,300"});
  EXPECT_EQ(stated["frame"]["origin_lat"], 50.5);
  const json inspected = run_to_json({"inspect", out});
  EXPECT_EQ(inspected["georeferenced"], true) << inspected.dump(1);
  const json extract = run_to_json(
      {"extract", out, "--out", (folder_ / "truth").string(), "--center", "50.5,14.25,300", "--size", "100,100,50"});
  EXPECT_EQ(extract["triangles"], 1);

  EXPECT_TRUE(run_to_json({"tile", mesh, "--out", out, "--force"})["frame"].is_null());
  write("odm_georeferencing_model_geo.txt", "WGS84 UTM 33N\n500000 5594000\n");
  const json found = run_to_json({"tile", mesh, "--out", out, "--force"});
  const json large = run_to_json({"tile", mesh, "--out", out, "--force", "--out-of-core"});
  EXPECT_TRUE(large["out_of_core"].get<bool>());
  EXPECT_EQ(large["frame"], found["frame"]);
  EXPECT_NEAR(found["frame"]["origin_lon"].get<double>(), 15.0, 1e-3);
  EXPECT_NEAR(found["frame"]["origin_lat"].get<double>(), 50.5, 0.02);
  EXPECT_THAT(found["frame"]["stated_by"].get<std::string>(), HasSubstr("odm_georeferencing_model_geo.txt"));
  EXPECT_TRUE(run_to_json({"tile", mesh, "--out", out, "--force", "--no-georeference"})["frame"].is_null());
}

TEST_F(TileFiles, AnExistingFolderIsKept) {
  write("good.obj", std::string(kTriangle) + "f 1 2 3\n");
  write("out", "mine");
  const ProgramResult result =
      run_tileflight({"tile", (folder_ / "good.obj").string(), "--out", (folder_ / "out").string()});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("--force"));
  EXPECT_EQ(tests::file_text(folder_ / "out"), "mine");
}

}  // namespace
}  // namespace tileflight::tile_command_test
