#include "tileflight/tiles/tile_writer/coarse_levels.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/files.h"
#include "tileflight/core/imaging/glb_writer.h"
#include "tileflight/tiles/simplification/painted_surface.h"
#include "tileflight/tiles/simplification/simplify.h"
#include "tileflight/tiles/tile_writer/tileset_json.h"

namespace tileflight::tile_writer {
namespace {

using geometry::Triangle;
using geometry::TriangleMesh;
using geometry::Vec3;
using imaging::TexturedMesh;

geometry::Box3 bounds_of_meshes(const std::vector<TexturedMesh>& content) {
  geometry::Box3 box;
  for (const TexturedMesh& m : content)
    for (const geometry::Vec3& v : m.mesh.vertices) box.extend(v);
  return box;
}

std::string uri_of(int level, std::size_t cell, bool implicit) {
  const auto [x, y] = implicit_coordinates(cell);
  const std::string where = implicit ? std::to_string(x) + "-" + std::to_string(y) : std::to_string(cell);
  return "tiles/" + std::to_string(level) + "-" + where + ".glb";
}

/// The part of the tree below a cell; nullopt if the source has no triangle there.
std::optional<TileEntry> entry_of(const std::vector<std::vector<WrittenTile>>& tiles,
                                  const std::vector<TilesetLevel>& levels, std::size_t level, std::size_t cell) {
  const WrittenTile& tile = tiles[level][cell];
  TileEntry out{tile.uri, tile.content, levels[level].geometric_error_m, {}};
  for (std::size_t child = 4 * cell; level + 1 < tiles.size() && child < 4 * cell + 4; ++child)
    if (auto entry = entry_of(tiles, levels, level + 1, child)) out.children.push_back(std::move(*entry));
  if (out.uri.empty() && out.children.empty()) return std::nullopt;
  return out;
}

}  // namespace

TileLevels::TileLevels(std::filesystem::path folder, const MeshTilesetOptions& options, int depth,
                       const Progress& progress)
    : folder_(std::move(folder)), options_(options), progress_(progress), tiles_(static_cast<std::size_t>(depth) + 1) {
  for (std::size_t level = 0; level < tiles_.size(); ++level) {
    tiles_[level].resize(std::size_t{1} << (2 * level));
    total_ += static_cast<std::int64_t>(tiles_[level].size());
  }
  summary_.levels.resize(tiles_.size());
  std::filesystem::create_directories(folder_ / "tiles");
}

void TileLevels::advance(std::string_view what) {
  const std::lock_guard lock(mutex_);
  report_progress(progress_, ++done_, total_, what);
}

void TileLevels::write_tile(int level, std::size_t cell, const std::vector<TexturedMesh>& content) {
  const std::string glb = imaging::write_glb(content, {options_.jpeg_quality, options_.copyright, options_.meshopt});
  WrittenTile& tile = tiles_[static_cast<std::size_t>(level)][cell];
  tile = {uri_of(level, cell, options_.implicit), bounds_of_meshes(content), static_cast<std::int64_t>(glb.size())};
  base::write_file(folder_ / tile.uri, glb);
  const imaging::RgbImage* counted = nullptr;  // a tile's textured meshes share one atlas
  for (const TexturedMesh& m : content) {
    tile.triangles += static_cast<std::int64_t>(m.mesh.triangles.size());
    if (m.texture && m.texture.get() != counted) tile.texels += static_cast<std::int64_t>(m.texture->pixels.size());
    if (m.texture) counted = m.texture.get();
  }
}

MeshTilesetSummary TileLevels::finish() {
  for (std::size_t level = 0; level < tiles_.size(); ++level)
    for (const WrittenTile& tile : tiles_[level]) {
      summary_.levels[level].tiles += tile.uri.empty() ? 0 : 1;
      summary_.levels[level].triangles += tile.triangles;
      summary_.levels[level].texels += tile.texels;
      summary_.bytes += tile.bytes;
    }
  std::string text;
  if (options_.implicit) {
    ImplicitTree tree;
    for (std::size_t level = 0; level < tiles_.size(); ++level) {
      tree.geometric_error_m.push_back(summary_.levels[level].geometric_error_m);
      tree.content.emplace_back();
      for (const WrittenTile& tile : tiles_[level]) tree.content.back().push_back(tile.content);
    }
    summary_.bytes += write_subtrees(folder_, tree);
    text = implicit_tileset_json(tree, options_.T_ecef_local);
  } else {
    TileEntry root = *entry_of(tiles_, summary_.levels, 0, 0);
    compute_bounds(root);
    text = tileset_json(root, options_.T_ecef_local);
  }
  base::write_file(folder_ / "tileset.json", text);
  summary_.bytes += static_cast<std::int64_t>(text.size());
  return summary_;
}

namespace {

using Meshes = std::vector<TexturedMesh>;

/// One object per block.
class BlockCoarsener {
 public:
  BlockCoarsener(const LevelBlock& block, const TriangleMesh& finest, const simplification::FixedVertices& fixed,
                 std::shared_ptr<const Meshes> below, const CellTree& cells, TileLevels& tiles)
      : block_(block), finest_(finest), fixed_(fixed), below_(std::move(below)), cells_(cells), tiles_(tiles) {}

  std::vector<CellContent> run() {
    // Half a texel is less than the error allowed for the level above.
    TriangleMesh surface = simplification::join_borders(finest_, block_.texel_m / 2, fixed_);
    std::vector<CellContent> painted;
    for (int level = block_.from_level - 1; level >= block_.to_level; --level) {
      tiles_.report("simplifying");
      surface =
          simplification::simplify_to_count(surface, std::max<std::size_t>(1, surface.triangles.size() / 4), fixed_);
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
    const simplification::SurfaceColors colors(std::move(sources));
    const simplification::PaintOptions paint{block_.texel_m * std::pow(2.0, tiles_.depth() - level),
                                             tiles_.options().max_atlas_px};
    const std::vector<TriangleMesh> parts = parts_of(level, surface);
    std::vector<simplification::TexturedSurface> out(parts.size());
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t i) {
      if (!parts[i].triangles.empty()) {
        out[i] = simplification::transfer_colors(parts[i], colors, paint);
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
      parts[cell] = simplification::extract_triangles(surface, members[cell]);
    });
    return parts;
  }

  /// Not smaller at a coarser level than at a finer one (3D Tiles 1.1, section 7.3).
  void set_error(int level, const TriangleMesh& surface) {
    distance_m_ = simplification::hausdorff_distance_m(surface, finest_, std::max(distance_m_, texel_m_));
    TilesetLevel& own = tiles_.level(level);
    own.texel_m = std::max(own.texel_m, texel_m_);
    own.geometric_error_m = std::max(own.geometric_error_m, block_.error_m + distance_m_);
  }

  const LevelBlock& block_;
  const TriangleMesh& finest_;
  const simplification::FixedVertices& fixed_;
  std::shared_ptr<const Meshes> below_;
  const CellTree& cells_;
  TileLevels& tiles_;
  double texel_m_ = 0.0;     ///< texel size of the level painted last
  double distance_m_ = 0.0;  ///< distance of the level before from the finest
};

}  // namespace

std::vector<CellContent> write_coarse_levels(const LevelBlock& block, const TriangleMesh& finest,
                                             const simplification::FixedVertices& fixed,
                                             std::shared_ptr<const Meshes> below, const CellTree& cells,
                                             TileLevels& tiles) {
  return BlockCoarsener(block, finest, fixed, std::move(below), cells, tiles).run();
}

}  // namespace tileflight::tile_writer
