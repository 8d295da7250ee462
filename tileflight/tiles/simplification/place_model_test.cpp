#include "tileflight/tiles/simplification/place_model.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/imaging/glb_writer.h"
#include "tileflight/tiles/mesh_files/mesh_source.h"

namespace tileflight::simplification::place_model_test {
namespace {

/// Squares side by side, a texture for each.
std::vector<imaging::TexturedMesh> tiles() {
  std::vector<imaging::TexturedMesh> meshes;
  for (int k = 0; k < 12; ++k) {
    const auto image = std::make_shared<imaging::RgbImage>(32, 32);
    for (int y = 0; y < 32; ++y)
      for (int x = 0; x < 32; ++x)
        (*image)(x, y) = {static_cast<std::uint8_t>(20 * k), static_cast<std::uint8_t>(8 * x),
                          static_cast<std::uint8_t>(8 * y)};
    const double x = 5.0 * (k % 4), y = 5.0 * (k / 4), z = std::sin(0.7 * k);
    imaging::TexturedMesh& mesh = meshes.emplace_back();
    mesh.mesh.vertices = {{x, y, z}, {x + 5, y, z}, {x + 5, y + 5, z}, {x, y + 5, z}};
    mesh.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    mesh.uv = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
    mesh.texture = image;
  }
  return meshes;
}

// Textures that stay in the file until they are painted give the same model.
TEST(PlaceModel, IsTheSameFromTheFileAsFromMeshesInMemory) {
  const tests::TemporaryFolder folder;
  base::write_file(folder / "mesh.glb", imaging::write_glb(tiles(), {}));
  const PlaceModelOptions options{.max_triangles = 60000, .texture_px = 256};
  const PlaceModel read = read_place_model({folder / "mesh.glb"}, options);
  const PlaceModel whole = make_place_model(mesh_files::read_mesh_source(folder / "mesh.glb", {}).meshes, options);
  EXPECT_EQ(read.source_triangles, 24U);
  EXPECT_EQ(read.mesh.mesh.vertices, whole.mesh.mesh.vertices);
  EXPECT_EQ(read.mesh.uv, whole.mesh.uv);
  ASSERT_FALSE(read.mesh.texture->empty());
  EXPECT_EQ(read.mesh.texture->pixels, whole.mesh.texture->pixels);
}

}  // namespace
}  // namespace tileflight::simplification::place_model_test
