#include "tileflight/tiles/tile_writer/mesh_tileset.h"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/tile_writer/coarse_levels.h"
#include "tileflight/tiles/tile_writer/leaf_content.h"

namespace tileflight::tile_writer {
namespace {

using geometry::Triangle;
using geometry::Vec3;
using imaging::TexturedMesh;

double area_m2(const TexturedMesh& m, const Triangle& t) {
  const auto& v = m.mesh.vertices;
  return (v[t[1]] - v[t[0]]).cross(v[t[2]] - v[t[0]]).norm() / 2;
}

/// nullopt without a texture.
std::optional<double> texels_of(const TexturedMesh& m, const Triangle& t) {
  if (!m.texture || m.uv.empty()) return std::nullopt;
  return texels_between({m.uv[t[0]], m.uv[t[1]], m.uv[t[2]]}, m.texture->width, m.texture->height);
}

/// The triangles of a source as the tree of cells needs them.
struct MeasuredTriangles {
  LeafMeasures all;
  std::vector<Vec3> middles;   ///< centre of each triangle
  std::vector<float> weights;  ///< share of a leaf that each triangle fills
};

MeasuredTriangles measure(const std::vector<TexturedMesh>& meshes, const MeshTilesetOptions& options) {
  MeasuredTriangles out{LeafMeasures(options.tile_triangles, options.max_atlas_px), {}, {}};
  for (const TexturedMesh& m : meshes)
    for (const Triangle& t : m.mesh.triangles) {
      out.middles.emplace_back((m.mesh.vertices[t[0]] + m.mesh.vertices[t[1]] + m.mesh.vertices[t[2]]) / 3);
      out.weights.push_back(out.all.add(area_m2(m, t), texels_of(m, t)));
    }
  return out;
}

double write_leaves(const std::vector<TexturedMesh>& meshes, const CellTree& cells, TileLevels& tiles) {
  const simplification::TriangleNumbering numbers(meshes);
  const auto& leaves = cells.leaves();
  std::vector<double> scales(leaves.size(), 1.0);
  tbb::parallel_for(std::size_t{0}, leaves.size(), [&](std::size_t i) {
    if (!leaves[i].empty()) {
      const LeafContent leaf = build_leaf_content(meshes, numbers, leaves[i], tiles.options().max_atlas_px);
      scales[i] = leaf.texture_scale;
      tiles.write_tile(tiles.depth(), i, leaf.meshes);
    }
    tiles.advance("writing the finest tiles");
  });
  return *std::min_element(scales.begin(), scales.end());
}

}  // namespace

MeshTilesetSummary write_mesh_tileset(const std::filesystem::path& folder, const std::vector<TexturedMesh>& meshes,
                                      const MeshTilesetOptions& options, const Progress& progress) {
  const bool is_empty =
      std::all_of(meshes.begin(), meshes.end(), [](const TexturedMesh& m) { return m.mesh.triangles.empty(); });
  if (is_empty) throw InputError(folder.string(), "there is no triangle to write");
  MeasuredTriangles triangles = measure(meshes, options);
  const int depth = triangles.all.depth(options.levels);
  const double texel_m = triangles.all.texel_m();
  const CellTree cells(triangles.middles, triangles.weights, depth);
  triangles.middles = {};  // frees memory: the tree is built
  triangles.weights = {};
  TileLevels tiles(folder, options, depth, progress);
  tiles.set_texture_scale(write_leaves(meshes, cells, tiles));
  tiles.level(depth).texel_m = texel_m;
  if (depth > 0) {
    const LevelBlock whole{.from_level = depth, .texel_m = texel_m};
    const std::shared_ptr<const std::vector<TexturedMesh>> below(&meshes, [](const auto*) {});  // the caller's
    write_coarse_levels(whole, simplification::weld_vertices(meshes), {}, below, cells, tiles);
  }
  return tiles.finish();
}

}  // namespace tileflight::tile_writer
