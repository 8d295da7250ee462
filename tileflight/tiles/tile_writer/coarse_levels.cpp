#include "tileflight/tiles/tile_writer/coarse_levels.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "tileflight/tiles/tile_writer/simplify.h"
#include "tileflight/tiles/tile_writer/painted_surface.h"

namespace tileflight::tile_writer {
namespace {

using geometry::Triangle;
using geometry::TriangleMesh;
using geometry::Vec3;
using imaging::TexturedMesh;

using Meshes = std::vector<TexturedMesh>;

/// One object per block.
class BlockCoarsener {
 public:
  BlockCoarsener(const LevelBlock& block, const TriangleMesh& finest, const tile_writer::FixedVertices& fixed,
                 std::shared_ptr<const Meshes> below, const CellTree& cells, TileLevels& tiles)
      : block_(block), finest_(finest), fixed_(fixed), below_(std::move(below)), cells_(cells), tiles_(tiles) {}

  std::vector<CellContent> run() {
    // Half a texel is less than the error allowed for the level above.
    TriangleMesh surface = tile_writer::join_borders(finest_, block_.texel_m / 2, fixed_);
    std::vector<CellContent> painted;
    for (int level = block_.from_level - 1; level >= block_.to_level; --level) {
      tiles_.report("simplifying");
      surface =
          tile_writer::simplify_to_count(surface, std::max<std::size_t>(1, surface.triangles.size() / 4), fixed_);
      painted = paint_level(level, surface);
      set_error(level, surface);
      if (level == block_.to_level) break;
      auto meshes = std::make_shared<Meshes>();
      for (CellContent& content : painted) meshes->push_back(std::move(content.mesh));
      below_ = std::move(meshes);
    }
    return painted;
  }

 private:
  std::uint32_t first_cell(int level) const { return block_.cell << (2 * (level - block_.level)); }

  std::vector<CellContent> paint_level(int level, const TriangleMesh& surface) {
    std::vector<const TexturedMesh*> sources;
    for (const TexturedMesh& m : *below_) sources.push_back(&m);
    const SurfaceColors colors(std::move(sources));
    const PaintOptions paint{block_.texel_m * std::pow(2.0, tiles_.depth() - level), tiles_.options().max_atlas_px};
    const std::vector<TriangleMesh> parts = parts_of(level, surface);
    std::vector<TexturedSurface> out(parts.size());
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t i) {
      if (!parts[i].triangles.empty()) {
        out[i] = transfer_colors(parts[i], colors, paint);
        tiles_.write_tile(level, first_cell(level) + i, {out[i].mesh});
      }
      tiles_.advance("writing coarser tiles");
    });
    std::vector<CellContent> contents;
    texel_m_ = 0.0;
    for (std::size_t i = 0; i < out.size(); ++i) {
      texel_m_ = std::max(texel_m_, out[i].texel_m);
      if (out[i].mesh.mesh.triangles.empty()) continue;
      contents.push_back({first_cell(level) + static_cast<std::uint32_t>(i), std::move(out[i].mesh)});
    }
    return contents;
  }

  /// The triangles of each cell of a level, assigned by their centres.
  std::vector<TriangleMesh> parts_of(int level, const TriangleMesh& surface) const {
    std::vector<std::vector<Triangle>> members(std::size_t{1} << (2 * (level - block_.level)));
    for (const Triangle& t : surface.triangles) {
      const Vec3 middle = (surface.vertices[t[0]] + surface.vertices[t[1]] + surface.vertices[t[2]]) / 3;
      members[cells_.cell_of(middle, level, block_.cell, block_.level) - first_cell(level)].push_back(t);
    }
    std::vector<TriangleMesh> parts(members.size());
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t cell) {
      parts[cell] = tile_writer::extract_triangles(surface, members[cell]);
    });
    return parts;
  }

  /// Not smaller at a coarser level than at a finer one (3D Tiles 1.1, section 7.3).
  void set_error(int level, const TriangleMesh& surface) {
    distance_m_ = tile_writer::hausdorff_distance_m(surface, finest_, std::max(distance_m_, texel_m_));
    TilesetLevel& own = tiles_.level(level);
    own.texel_m = std::max(own.texel_m, texel_m_);
    own.geometric_error_m = std::max(own.geometric_error_m, block_.error_m + distance_m_);
  }

  const LevelBlock& block_;
  const TriangleMesh& finest_;
  const tile_writer::FixedVertices& fixed_;
  std::shared_ptr<const Meshes> below_;
  const CellTree& cells_;
  TileLevels& tiles_;
  double texel_m_ = 0.0;     ///< of the level painted last
  double distance_m_ = 0.0;  ///< of the level before from the finest
};

}  // namespace

std::vector<CellContent> write_coarse_levels(const LevelBlock& block, const TriangleMesh& finest,
                                             const tile_writer::FixedVertices& fixed,
                                             std::shared_ptr<const Meshes> below, const CellTree& cells,
                                             TileLevels& tiles) {
  return BlockCoarsener(block, finest, fixed, std::move(below), cells, tiles).run();
}

}  // namespace tileflight::tile_writer
