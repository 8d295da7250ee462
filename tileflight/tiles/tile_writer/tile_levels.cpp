#include "tileflight/tiles/tile_writer/tile_levels.h"

#include "tileflight/core/base/files.h"
#include "tileflight/tiles/tile_writer/glb_writer.h"
#include "tileflight/tiles/tile_writer/subtree_files.h"
#include "tileflight/tiles/tile_writer/tileset_json.h"

namespace tileflight::tile_writer {
namespace {

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
  const std::string glb = write_glb(content, {options_.jpeg_quality, options_.copyright, options_.meshopt});
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

}  // namespace tileflight::tile_writer
