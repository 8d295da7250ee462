#include "tileflight/tiling/mesh_tileset.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <mutex>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/simplification/simplify.h"
#include "tileflight/simplification/surface_simplification.h"
#include "tileflight/tiling/cell_tree.h"
#include "tileflight/tiling/glb_writer.h"
#include "tileflight/tiling/leaf_content.h"
#include "tileflight/tiling/painted_surface.h"
#include "tileflight/tiling/tileset_json.h"

namespace tileflight::tiling {
namespace {

using geometry::Box3;
using geometry::Triangle;
using geometry::TriangleMesh;
using geometry::Vec3;
using imaging::TexturedMesh;

constexpr int kMaxDepth = 9;

/// Fill factor of atlases, with windows and the gaps between them.
constexpr double kAtlasFill = 0.6;

/// Texels that a triangle with vertex colours or a plain colour counts for.
constexpr double kTexelsOfColors = 2.0;

double area_m2(const TexturedMesh& m, const Triangle& t) {
  const auto& v = m.mesh.vertices;
  return (v[t[1]] - v[t[0]]).cross(v[t[2]] - v[t[0]]).norm() / 2;
}

double texels_of(const TexturedMesh& m, const Triangle& t) {
  if (!m.texture || m.uv.empty()) return kTexelsOfColors;
  const Eigen::Vector2d a = (m.uv[t[1]] - m.uv[t[0]]).cast<double>(), b = (m.uv[t[2]] - m.uv[t[0]]).cast<double>();
  const double area = std::abs(a.x() * b.y() - a.y() * b.x()) / 2 * m.texture->width * m.texture->height;
  return area < 1e9 ? area : 1e9;
}

/// Measurements of the source that determine the tree.
struct MeshMeasures {
  std::vector<Vec3> middles;   ///< centre of each triangle
  std::vector<float> weights;  ///< in leaves: 1 fills one
  double weight = 0, area_m2 = 0, texels = 0;

  /// Edge of a typical texel of the source.
  double texel_m() const { return std::sqrt(area_m2 / std::max(texels, 1.0)); }
};

MeshMeasures measure(const std::vector<TexturedMesh>& meshes, const MeshTilesetOptions& options) {
  const double atlas_px2 = kAtlasFill * options.max_atlas_px * options.max_atlas_px;
  MeshMeasures out;
  for (const TexturedMesh& m : meshes)
    for (const Triangle& t : m.mesh.triangles) {
      const double texels = texels_of(m, t), atlas_share = m.texture ? std::min(texels, atlas_px2) / atlas_px2 : 0.0;
      out.middles.emplace_back((m.mesh.vertices[t[0]] + m.mesh.vertices[t[1]] + m.mesh.vertices[t[2]]) / 3);
      out.weights.push_back(static_cast<float>(1.0 / options.tile_triangles + atlas_share));
      out.weight += static_cast<double>(out.weights.back());
      out.area_m2 += area_m2(m, t);
      out.texels += texels;
    }
  return out;
}

int depth_for(const MeshMeasures& measure, const MeshTilesetOptions& options) {
  if (options.levels) return std::clamp(*options.levels - 1, 0, kMaxDepth);
  int depth = 0;
  while (depth < kMaxDepth && measure.weight > std::pow(4.0, depth)) ++depth;
  return depth;
}

/// A written tile.
struct WrittenTile {
  std::string uri;  ///< empty: the tile has no content
  Box3 box;
  std::int64_t bytes = 0, triangles = 0, texels = 0;
};

Box3 bounds_of_meshes(const std::vector<TexturedMesh>& content) {
  Box3 box;
  for (const TexturedMesh& m : content)
    for (const Vec3& v : m.mesh.vertices) box.extend(v);
  return box;
}

std::string uri_of(int level, std::size_t cell) {
  return "tiles/" + std::to_string(level) + "-" + std::to_string(cell) + ".glb";
}

/// One object per tileset.
class MeshTiler {
 public:
  MeshTiler(const std::filesystem::path& folder, const std::vector<TexturedMesh>& meshes,
            const MeshTilesetOptions& options, const Progress& progress)
      : folder_(folder),
        meshes_(meshes),
        options_(options),
        progress_(progress),
        numbers_(meshes),
        measure_(measure(meshes, options)),
        depth_(depth_for(measure_, options)),
        cells_(measure_.middles, measure_.weights, depth_),
        tiles_(static_cast<std::size_t>(depth_) + 1) {
    for (std::size_t level = 0; level < tiles_.size(); ++level) {
      tiles_[level].resize(std::size_t{1} << (2 * level));
      total_ += static_cast<std::int64_t>(tiles_[level].size());
    }
    summary_.levels.resize(tiles_.size());
  }

  MeshTilesetSummary write() {
    measure_.middles = {};  // frees memory: the tree is built
    measure_.weights = {};
    std::filesystem::create_directories(folder_ / "tiles");
    write_leaves();
    write_coarse_levels();
    write_json();
    return summary_;
  }

 private:
  void advance(std::string_view what) {
    const std::lock_guard lock(mutex_);
    report_progress(progress_, ++done_, total_, what);
  }

  void write_tile(int level, std::size_t cell, const std::vector<TexturedMesh>& content) {
    const std::string glb = write_glb(content, {options_.jpeg_quality, options_.copyright});
    WrittenTile& tile = tiles_[static_cast<std::size_t>(level)][cell];
    tile = {uri_of(level, cell), bounds_of_meshes(content), static_cast<std::int64_t>(glb.size())};
    base::write_file(folder_ / tile.uri, glb);
    const imaging::RgbImage* counted = nullptr;  // a tile's textured meshes share one atlas
    for (const TexturedMesh& m : content) {
      tile.triangles += static_cast<std::int64_t>(m.mesh.triangles.size());
      if (m.texture && m.texture.get() != counted) tile.texels += static_cast<std::int64_t>(m.texture->pixels.size());
      if (m.texture) counted = m.texture.get();
    }
  }

  void write_leaves() {
    const auto& leaves = cells_.leaves();
    std::vector<double> scales(leaves.size(), 1.0);
    tbb::parallel_for(std::size_t{0}, leaves.size(), [&](std::size_t i) {
      if (!leaves[i].empty()) {
        const LeafContent leaf = build_leaf_content(meshes_, numbers_, leaves[i], options_.max_atlas_px);
        scales[i] = leaf.texture_scale;
        write_tile(depth_, i, leaf.meshes);
      }
      advance("writing the finest tiles");
    });
    summary_.texture_scale = *std::min_element(scales.begin(), scales.end());
    summary_.levels.back().texel_m = measure_.texel_m();
  }

  /// From the second finest level up to the root: each is simplified and painted from the level below it.
  void write_coarse_levels() {
    if (depth_ == 0) return;
    const TriangleMesh finest = simplification::weld_vertices(meshes_);
    // Half a texel is less than the error allowed for the level above.
    TriangleMesh surface = simplification::join_borders(finest, measure_.texel_m() / 2);
    std::vector<TexturedMesh> below;
    for (int level = depth_ - 1; level >= 0; --level) {
      report_progress(progress_, done_, total_, "simplifying");
      surface = simplification::simplify_to_count(surface, std::max<std::size_t>(1, surface.triangles.size() / 4));
      std::vector<TexturedMesh> painted_tiles = paint_level(level, surface, below.empty() ? meshes_ : below);
      set_error(level, surface, finest);
      below = std::move(painted_tiles);
    }
  }

  std::vector<TexturedMesh> paint_level(int level, const TriangleMesh& surface,
                                        const std::vector<TexturedMesh>& below) {
    std::vector<const TexturedMesh*> sources;
    for (const TexturedMesh& m : below) sources.push_back(&m);
    const SurfaceColors colors(std::move(sources));
    const PaintOptions paint{measure_.texel_m() * std::pow(2.0, depth_ - level), options_.max_atlas_px};
    const std::vector<TriangleMesh> parts = parts_of(level, surface);
    std::vector<TexturedSurface> out(parts.size());
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t i) {
      if (!parts[i].triangles.empty()) {
        out[i] = transfer_colors(parts[i], colors, paint);
        write_tile(level, i, {out[i].mesh});
      }
      advance("writing coarser tiles");
    });
    std::vector<TexturedMesh> tiles;
    for (TexturedSurface& tile : out) {
      double& texel_m = summary_.levels[static_cast<std::size_t>(level)].texel_m;
      texel_m = std::max(texel_m, tile.texel_m);
      if (!tile.mesh.mesh.triangles.empty()) tiles.push_back(std::move(tile.mesh));
    }
    return tiles;
  }

  /// The triangles of each cell of a level, assigned by their centres.
  std::vector<TriangleMesh> parts_of(int level, const TriangleMesh& surface) const {
    std::vector<std::vector<Triangle>> members(tiles_[static_cast<std::size_t>(level)].size());
    for (const Triangle& t : surface.triangles) {
      const Vec3 middle = (surface.vertices[t[0]] + surface.vertices[t[1]] + surface.vertices[t[2]]) / 3;
      members[cells_.cell_of(middle, level)].push_back(t);
    }
    std::vector<TriangleMesh> parts(members.size());
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t cell) {
      parts[cell] = simplification::extract_triangles(surface, members[cell]);
    });
    return parts;
  }

  /// Not smaller at a coarser level than at a finer one (3D Tiles 1.1, section 7.3).
  void set_error(int level, const TriangleMesh& surface, const TriangleMesh& finest) {
    TilesetLevel& own = summary_.levels[static_cast<std::size_t>(level)];
    const TilesetLevel& finer = summary_.levels[static_cast<std::size_t>(level) + 1];
    own.geometric_error_m =
        simplification::hausdorff_distance_m(surface, finest, std::max(finer.geometric_error_m, own.texel_m));
  }

  /// The part of the tree below a cell; nullopt if the source has no triangle there.
  std::optional<TileEntry> entry_of(std::size_t level, std::size_t cell) const {
    const WrittenTile& tile = tiles_[level][cell];
    TileEntry out{tile.uri, tile.box, summary_.levels[level].geometric_error_m, {}};
    for (std::size_t child = 4 * cell; level + 1 < tiles_.size() && child < 4 * cell + 4; ++child)
      if (auto entry = entry_of(level + 1, child)) out.children.push_back(std::move(*entry));
    if (out.uri.empty() && out.children.empty()) return std::nullopt;
    return out;
  }

  void write_json() {
    for (std::size_t level = 0; level < tiles_.size(); ++level)
      for (const WrittenTile& tile : tiles_[level]) {
        summary_.levels[level].tiles += tile.uri.empty() ? 0 : 1;
        summary_.levels[level].triangles += tile.triangles;
        summary_.levels[level].texels += tile.texels;
        summary_.bytes += tile.bytes;
      }
    TileEntry root = *entry_of(0, 0);
    compute_bounds(root);
    const std::string text = tileset_json(root, options_.T_ecef_local);
    base::write_file(folder_ / "tileset.json", text);
    summary_.bytes += static_cast<std::int64_t>(text.size());
  }

  const std::filesystem::path& folder_;
  const std::vector<TexturedMesh>& meshes_;
  const MeshTilesetOptions& options_;
  const Progress& progress_;
  TriangleNumbering numbers_;
  MeshMeasures measure_;
  int depth_;
  CellTree cells_;
  std::vector<std::vector<WrittenTile>> tiles_;  ///< [level][cell]
  MeshTilesetSummary summary_;
  std::mutex mutex_;
  std::int64_t done_ = 0, total_ = 0;
};

}  // namespace

MeshTilesetSummary write_mesh_tileset(const std::filesystem::path& folder, const std::vector<TexturedMesh>& meshes,
                                      const MeshTilesetOptions& options, const Progress& progress) {
  const bool is_empty =
      std::all_of(meshes.begin(), meshes.end(), [](const TexturedMesh& m) { return m.mesh.triangles.empty(); });
  if (is_empty) throw InputError(folder.string(), "there is no triangle to write");
  return MeshTiler(folder, meshes, options, progress).write();
}

}  // namespace tileflight::tiling
