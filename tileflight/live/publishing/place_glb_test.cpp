#include "tileflight/live/publishing/place_glb.h"

#include <gmock/gmock.h>

#include "tests/temporary_folder.h"
#include "tests/tiny_place.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/mesh_files/mesh_source.h"

namespace tileflight::publishing::place_glb_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::ThrowsMessage;
using tests::TinyPlace;

/// A dataset over the middle of the tiny place.
dataset::Dataset flight() {
  dataset::Dataset dataset;
  dataset.folder = "flight";
  geometry::Trajectory truth;
  truth.poses = {{0.0, {Eigen::Quaterniond::Identity(), {0, 0, 130}}},
                 {1.0, {Eigen::Quaterniond::Identity(), {10, 5, 130}}}};
  dataset.groundtruth = truth;
  return dataset;
}

/// The model as a reader of meshes that knows nothing of this one's way sees it: z up.
std::vector<imaging::TexturedMesh> read_back(const tests::TemporaryFolder& folder, const PlaceGlb& glb) {
  base::write_file(folder / "read.glb", glb.bytes);
  return mesh_files::read_mesh_source(folder / "read.glb", {}).meshes;
}

TEST(PlaceGlb, ATilesetAroundTheFlightIsShownWhereItIs) {
  const tests::TemporaryFolder folder;
  TinyPlace::write(folder / "place");
  const PlaceGlb glb = read_place_glb((folder / "place").string(), {}, flight());
  EXPECT_THAT(glb.attribution, testing::ElementsAre("Tiny Place, CC0"));
  std::size_t vertices = 0;
  for (const imaging::TexturedMesh& mesh : read_back(folder, glb)) {
    for (const geometry::Vec3& p : mesh.mesh.vertices) {
      ++vertices;
      EXPECT_NEAR(p.z(), TinyPlace::height(p.x(), p.y()), 1e-3);
    }
  }
  EXPECT_GT(vertices, 1000U);
}

TEST(PlaceGlb, ATruthFolderIsShownToo) {
  const tests::TemporaryFolder folder;
  fs::create_directories(folder / "truth");
  base::write_file(folder / "truth" / "mesh.glb", TinyPlace::glb(-40, -40, 80, 12));
  base::write_file(folder / "truth" / "extract.json", "{}");
  const PlaceGlb glb = read_place_glb((folder / "truth").string(), {}, flight());
  const std::vector<imaging::TexturedMesh> meshes = read_back(folder, glb);
  ASSERT_EQ(meshes.size(), 1U);
  EXPECT_EQ(meshes[0].mesh.triangles.size(), 288U);
}

TEST(PlaceGlb, ManyTrianglesBecomeFew) {
  const tests::TemporaryFolder folder;
  base::write_file(folder / "large.glb", TinyPlace::glb(-40, -40, 80, 300));
  const auto glb = make_place_glb(mesh_files::read_mesh_source(folder / "large.glb", {}).meshes, {});
  ASSERT_TRUE(glb);
  EXPECT_LT(read_back(folder, *glb)[0].mesh.triangles.size(), 61000U);
  EXPECT_LT(glb->bytes.size(), 6000000U);
}

TEST(PlaceGlb, WhatCannotBeShownIsAnInputError) {
  const tests::TemporaryFolder folder;
  const auto refused = [](const std::string& place, const dataset::Dataset& dataset, const char* why) {
    EXPECT_THAT([&] { read_place_glb(place, {}, dataset); }, ThrowsMessage<InputError>(HasSubstr(why)));
  };
  refused((folder / "nothing").string(), flight(), "nothing");
  dataset::Dataset pathless = flight();
  pathless.groundtruth.reset();
  refused((folder / "nothing").string(), pathless, "has no true path");
  dataset::Dataset frameless = flight();
  frameless.metadata = {{"frame.kind", "east-north-up"}, {"frame.origin_lat", "north"}};
  refused((folder / "nothing").string(), frameless, "frame.origin_lat is missing or not a number");
  EXPECT_FALSE(make_place_glb({}, {}));
}

}  // namespace
}  // namespace tileflight::publishing::place_glb_test
