#include "tileflight/tiles/tile_writer/large_mesh_tileset.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <optional>
#include <unordered_map>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/random_numbers.h"
#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/mesh_files/mesh_spill.h"
#include "tileflight/tiles/mesh_files/record_file.h"
#include "tileflight/tiles/tile_writer/coarse_levels.h"
#include "tileflight/tiles/tile_writer/content_spill.h"
#include "tileflight/tiles/tile_writer/leaf_content.h"

// Notation: a bucket is a cell of bucket_level_, whose triangles are sorted into leaves together; a block is a cell
// whose coarser levels are made together; a content is what a tile holds, kept on disk until the levels above are made.

namespace tileflight::tile_writer {
namespace {

using imaging::TexturedMesh;

/// Triangles sorted into buckets, on disk.
class BucketFile {
 public:
  BucketFile(const std::filesystem::path& file, std::size_t buckets)
      : file_(file),
        part_(std::clamp<std::size_t>(kBufferBytes / buckets / sizeof(mesh_files::SourceTriangle), 16, 4096)),
        buffers_(buckets),
        parts_(buckets) {}

  void add(std::size_t bucket, const mesh_files::SourceTriangle& triangle) {
    buffers_[bucket].push_back(triangle);
    if (buffers_[bucket].size() == part_) flush(bucket);
  }

  /// Reads the triangles of a bucket, in the order in which they were added.
  std::vector<mesh_files::SourceTriangle> read(std::size_t bucket) {
    std::vector<mesh_files::SourceTriangle> out(parts_[bucket].size() * part_);
    for (std::size_t i = 0; i < parts_[bucket].size(); ++i)
      file_.read(parts_[bucket][i], out.data() + i * part_, part_ * sizeof(mesh_files::SourceTriangle));
    out.insert(out.end(), buffers_[bucket].begin(), buffers_[bucket].end());
    return out;
  }

 private:
  static constexpr std::size_t kBufferBytes = std::size_t{64} << 20;

  void flush(std::size_t bucket) {
    file_.write(end_, buffers_[bucket].data(), part_ * sizeof(mesh_files::SourceTriangle));
    parts_[bucket].push_back(end_);
    end_ += part_ * sizeof(mesh_files::SourceTriangle);
    buffers_[bucket].clear();
  }

  mesh_files::ScratchFile file_;
  std::size_t part_;  ///< triangles written together
  std::uint64_t end_ = 0;
  std::vector<std::vector<mesh_files::SourceTriangle>> buffers_;
  std::vector<std::vector<std::uint64_t>> parts_;  ///< their offsets
};

/// Triangles of one material as a mesh: corners that are equal in all are one vertex.
class MeshOfTriangles {
 public:
  explicit MeshOfTriangles(const mesh_files::SurfaceAppearance& look) : look_(look) {
    mesh_.texture = look.texture;
    mesh_.wrap_u = look.wrap_u;
    mesh_.wrap_v = look.wrap_v;
    mesh_.base_color = look.base_color;
  }

  void add(const mesh_files::SourceTriangle& triangle) {
    geometry::Triangle t{};
    for (std::size_t k = 0; k < 3; ++k) t[k] = vertex(triangle, k);
    mesh_.mesh.triangles.push_back(t);
  }

  TexturedMesh take() { return std::move(mesh_); }

 private:
  using Key = std::array<std::uint64_t, 5>;  ///< the bits of position, texture coordinates and colour
  struct Hash {
    std::size_t operator()(const Key& key) const {
      std::uint64_t hash = 0;
      for (const std::uint64_t part : key) hash = base::splitmix64_hash(hash ^ part);
      return static_cast<std::size_t>(hash);
    }
  };

  std::uint32_t vertex(const mesh_files::SourceTriangle& triangle, std::size_t k) {
    Key key{};
    for (std::size_t axis = 0; axis < 3; ++axis) key[axis] = std::bit_cast<std::uint64_t>(triangle.position[k][axis]);
    key[3] = std::bit_cast<std::uint64_t>(triangle.uv[k]);
    key[4] = std::bit_cast<std::uint32_t>(triangle.color[k]);
    const auto [at, is_new] = index_of_.try_emplace(key, static_cast<std::uint32_t>(mesh_.mesh.vertices.size()));
    if (!is_new) return at->second;
    mesh_.mesh.vertices.push_back(triangle.corner(k));
    if (look_.texture) mesh_.uv.emplace_back(triangle.uv[k].data());
    if (look_.has_colors) mesh_.colors.push_back(triangle.color[k]);
    return at->second;
  }

  const mesh_files::SurfaceAppearance& look_;
  TexturedMesh mesh_;
  std::unordered_map<Key, std::uint32_t, Hash> index_of_;
};

/// Returns one mesh per material, with stand-ins for textures, in order of materials.
std::vector<TexturedMesh> meshes_of(std::vector<mesh_files::SourceTriangle> triangles,
                                    const std::vector<mesh_files::SurfaceAppearance>& materials) {
  std::stable_sort(
      triangles.begin(), triangles.end(),
      [](const mesh_files::SourceTriangle& a, const mesh_files::SourceTriangle& b) { return a.material < b.material; });
  std::vector<TexturedMesh> out;
  for (std::size_t i = 0; i < triangles.size();) {
    const std::uint32_t material = triangles[i].material;
    MeshOfTriangles mesh(materials[material]);
    for (; i < triangles.size() && triangles[i].material == material; ++i) mesh.add(triangles[i]);
    out.push_back(mesh.take());
  }
  return out;
}

namespace fs = std::filesystem;
using geometry::Box3;
using geometry::TriangleMesh;
using geometry::Vec3;

/// Memory that a triangle of a content and its simplification take.
constexpr std::uint64_t kBytesPerTriangle = 450;

/// Disk that a triangle takes in its bucket, its leaf's content and the tiles, and a texel in contents and tiles.
constexpr double kDiskPerTriangle = 250.0, kDiskPerTexel = 7.0;

Vec3 middle_of(const mesh_files::SourceTriangle& t) { return (t.corner(0) + t.corner(1) + t.corner(2)) / 3; }

double area_of(const mesh_files::SourceTriangle& t) {
  return (t.corner(1) - t.corner(0)).cross(t.corner(2) - t.corner(0)).norm() / 2;
}

std::optional<double> source_texels(const mesh_files::SourceTriangle& t, const mesh_files::SurfaceAppearance& look) {
  if (!look.texture) return std::nullopt;
  const auto uv = [&](std::size_t k) { return Eigen::Vector2f(t.uv[k].data()); };
  return texels_between({uv(0), uv(1), uv(2)}, look.texture->width, look.texture->height);
}

std::string gigabytes(std::uintmax_t bytes) {
  const std::uintmax_t tenths = bytes / 100'000'000;
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10);
}

/// One object per tileset.
class LargeMeshTiler {
 public:
  LargeMeshTiler(const fs::path& folder, mesh_files::MeshSpill& mesh, const MeshTilesetOptions& options,
                 const LargeMeshLimits& limits, const Progress& progress)
      : folder_(folder), mesh_(mesh), options_(options), limits_(limits), progress_(progress) {}

  MeshTilesetSummary write() {
    fs::create_directories(folder_ / "work");
    const MeasuredSample sample = measure();
    cells_.emplace(depth_);
    cells_->split(0, 0, bucket_level_, sample.middles, sample.weights);
    tiles_.emplace(folder_, options_, depth_, progress_);
    contents_.emplace(folder_ / "work/contents");
    write_leaves();
    for (int from = depth_; from > 0;) from = write_levels_above(from);
    contents_.reset();
    fs::remove_all(folder_ / "work");
    return tiles_->finish();
  }

 private:
  struct MeasuredSample {
    std::vector<Vec3> middles;
    std::vector<float> weights;
  };

  /// Memory that a cell's content takes; 0: there is none.
  struct ContentSize {
    std::uint64_t bytes = 0;
  };

  MeasuredSample measure() {
    report_progress(progress_, 0, 0, "measuring the mesh");
    LeafMeasures all(options_.tile_triangles, options_.max_atlas_px);
    const std::uint64_t every = 1 + (mesh_.faces.size() - 1) / limits_.sample_triangles;
    MeasuredSample sample;
    std::uint64_t number = 0;
    const std::int64_t flat = mesh_.for_each_triangle([&](const mesh_files::SourceTriangle& t) {
      const float weight = all.add(area_of(t), source_texels(t, mesh_.materials[t.material]));
      if (base::splitmix64_hash(number++) % every != 0) return;  // no pattern of the file's order can hide from it
      sample.middles.push_back(middle_of(t));
      sample.weights.push_back(weight);
    });
    if (flat > 0) mesh_.warn(std::to_string(flat) + " triangles without area are left out");
    if (all.triangles() == 0) throw InputError(folder_.string(), "there is no triangle with an area to write");
    require_free_space(folder_,
                       static_cast<std::uintmax_t>(kDiskPerTriangle * static_cast<double>(all.triangles()) +
                                                   kDiskPerTexel * all.texels()),
                       "tiling the mesh");
    depth_ = all.depth(options_.levels);
    texel_m_ = all.texel_m();
    const auto buckets = static_cast<double>(all.triangles()) / static_cast<double>(limits_.bucket_triangles);
    while (bucket_level_ < depth_ && std::pow(4.0, bucket_level_) < buckets) ++bucket_level_;
    return sample;
  }

  void write_leaves() {
    report_progress(progress_, 0, 0, "sorting the triangles");
    const std::size_t buckets = std::size_t{1} << (2 * bucket_level_);
    BucketFile sorted(folder_ / "work/triangles", buckets);
    mesh_.for_each_triangle(
        [&](const mesh_files::SourceTriangle& t) { sorted.add(cells_->cell_of(middle_of(t), bucket_level_), t); });
    sizes_.resize(std::size_t{1} << (2 * depth_));
    tiles_->level(depth_).texel_m = texel_m_;
    double scale = 1.0;
    for (std::size_t bucket = 0; bucket < buckets; ++bucket)
      scale = std::min(scale, write_leaves_of(bucket, sorted.read(bucket)));
    tiles_->set_texture_scale(scale);
  }

  /// Returns the smallest scale of a leaf's textures.
  double write_leaves_of(std::size_t bucket, std::vector<mesh_files::SourceTriangle> triangles) {
    const std::vector<TexturedMesh> meshes = meshes_of(std::move(triangles), mesh_.materials);
    const std::vector<std::vector<std::uint32_t>> leaves = split_bucket(bucket, meshes);
    const simplification::TriangleNumbering numbers(meshes);
    std::vector<double> scales(leaves.size(), 1.0);
    tbb::parallel_for(std::size_t{0}, leaves.size(), [&](std::size_t i) {
      if (!leaves[i].empty()) {
        const LeafContent leaf =
            build_leaf_content(meshes, numbers, leaves[i], options_.max_atlas_px, mesh_.texels.fetcher());
        scales[i] = leaf.texture_scale;
        const std::size_t cell = bucket * leaves.size() + i;
        tiles_->write_tile(depth_, cell, leaf.meshes);
        if (depth_ > 0) keep(depth_, cell, leaf.meshes);
      }
      tiles_->advance("writing the finest tiles");
    });
    return *std::min_element(scales.begin(), scales.end());
  }

  /// Splits a bucket's cell; numbers of the triangles of each leaf.
  std::vector<std::vector<std::uint32_t>> split_bucket(std::size_t bucket, const std::vector<TexturedMesh>& meshes) {
    LeafMeasures measures(options_.tile_triangles, options_.max_atlas_px);
    std::vector<Vec3> middles;
    std::vector<float> weights;
    for (const TexturedMesh& m : meshes)
      for (const geometry::Triangle& t : m.mesh.triangles) {
        const auto& v = m.mesh.vertices;
        middles.emplace_back((v[t[0]] + v[t[1]] + v[t[2]]) / 3);
        std::optional<double> texels;
        if (m.texture)
          texels = texels_between({m.uv[t[0]], m.uv[t[1]], m.uv[t[2]]}, m.texture->width, m.texture->height);
        weights.push_back(measures.add(0.0, texels));
      }
    return cells_->split(static_cast<std::uint32_t>(bucket), bucket_level_, depth_, middles, weights);
  }

  void keep(int level, std::size_t cell, const std::vector<TexturedMesh>& content) {
    contents_->write(level, cell, content);
    const imaging::RgbImage* texture = nullptr;
    for (const TexturedMesh& m : content) {
      sizes_[cell].bytes += kBytesPerTriangle * m.mesh.triangles.size();
      if (m.texture) texture = m.texture.get();
    }
    if (texture != nullptr) sizes_[cell].bytes += texture->pixels.size() * sizeof(imaging::Rgb8);
  }

  /// The coarsest level above `from` whose cells hold no more contents than may be in memory.
  int block_level(int from) const {
    for (int level = 0; level < from - 1; ++level) {
      std::vector<std::uint64_t> bytes(std::size_t{1} << (2 * level));
      for (std::size_t cell = 0; cell < sizes_.size(); ++cell)
        bytes[cell >> (2 * (from - level))] += sizes_[cell].bytes;
      if (*std::max_element(bytes.begin(), bytes.end()) <= limits_.block_bytes) return level;
    }
    return from - 1;
  }

  /// Makes levels from the contents of level `from`; returns the coarsest of them.
  int write_levels_above(int from) {
    const int level = block_level(from);
    // Two levels at a time: what blocks share is fixed, and the more so the more it stands out among what is left.
    const int to = level == 0 ? 0 : std::max(level, from - 2);
    const std::size_t blocks = std::size_t{1} << (2 * level);
    std::vector<Box3> borders(blocks);
    for (std::size_t block = 0; level > 0 && block < blocks; ++block) borders[block] = write_border(level, block, from);
    const double error_m = tiles_->level(from).geometric_error_m;
    std::vector<ContentSize> before = std::move(sizes_);
    sizes_.assign(std::size_t{1} << (2 * to), {});
    for (std::size_t block = 0; block < blocks; ++block) {
      const LevelBlock part{static_cast<std::uint32_t>(block), level, from, to, texel_m_, error_m};
      write_block(part, borders, before);
    }
    // Not smaller at a coarser level than at a finer one (3D Tiles 1.1, section 7.3).
    for (int i = from - 1; i >= to; --i)
      tiles_->level(i).geometric_error_m =
          std::max(tiles_->level(i).geometric_error_m, tiles_->level(i + 1).geometric_error_m);
    return to;
  }

  /// The meshes of all contents of a block.
  std::vector<TexturedMesh> contents_of(int level, std::size_t block, int from, bool textures) const {
    std::vector<TexturedMesh> out;
    const std::size_t cells = std::size_t{1} << (2 * (from - level));
    for (std::size_t cell = block * cells; cell < (block + 1) * cells; ++cell) {
      std::vector<TexturedMesh> content = contents_->read(from, cell, textures);
      std::move(content.begin(), content.end(), std::back_inserter(out));
    }
    return out;
  }

  fs::path border_file(std::size_t block) const { return folder_ / "work" / ("border-" + std::to_string(block)); }

  /// Writes the positions of a block's border vertices; returns their bounds.
  Box3 write_border(int level, std::size_t block, int from) const {
    const TriangleMesh surface = simplification::weld_vertices(contents_of(level, block, from, false));
    const std::vector<Vec3> positions = simplification::border_positions(surface);
    base::write_file(border_file(block),
                     {reinterpret_cast<const char*>(positions.data()), positions.size() * sizeof(Vec3)});
    Box3 box;
    for (const Vec3& p : positions) box.extend(p);
    return box;
  }

  std::vector<Vec3> read_border(std::size_t block) const {
    const std::vector<std::byte> bytes = base::read_bytes(border_file(block), std::uintmax_t{1} << 40);
    std::vector<Vec3> positions(bytes.size() / sizeof(Vec3));
    if (!bytes.empty()) std::memcpy(static_cast<void*>(positions.data()), bytes.data(), bytes.size());
    return positions;
  }

  /// Border vertices of a block where another block has one, too.
  simplification::FixedVertices shared_vertices(std::size_t block, const std::vector<Box3>& borders) const {
    if (borders.size() == 1 || borders[block].isEmpty()) return {};
    const double within_m = texel_m_ / 2;
    const Box3 reach(borders[block].min().array() - within_m, borders[block].max().array() + within_m);
    return simplification::near_positions(read_border(block), within_m, [&](const auto& visit) {
      for (std::size_t other = 0; other < borders.size(); ++other) {
        if (other == block || !borders[other].intersects(reach)) continue;
        for (const Vec3& p : read_border(other)) visit(p);
      }
    });
  }

  void write_block(const LevelBlock& block, const std::vector<Box3>& borders, const std::vector<ContentSize>& sizes) {
    auto below =
        std::make_shared<const std::vector<TexturedMesh>>(contents_of(block.level, block.cell, block.from_level, true));
    if (below->empty()) return skip(block);
    const TriangleMesh finest = simplification::weld_vertices(*below);
    const simplification::FixedVertices fixed = shared_vertices(block.cell, borders);
    std::vector<CellContent> made = write_coarse_levels(block, finest, fixed, std::move(below), *cells_, *tiles_);
    for (const CellContent& content : made)
      if (block.to_level > 0) keep(block.to_level, content.cell, {content.mesh});
    const std::size_t cells = std::size_t{1} << (2 * (block.from_level - block.level));
    for (std::size_t cell = block.cell * cells; cell < (block.cell + 1) * cells; ++cell)
      if (sizes[cell].bytes > 0) contents_->remove(block.from_level, cell);
  }

  /// Counts the tiles of a block without content.
  void skip(const LevelBlock& block) {
    for (int level = block.to_level; level < block.from_level; ++level)
      for (std::size_t i = 0; i < std::size_t{1} << (2 * (level - block.level)); ++i)
        tiles_->advance("writing coarser tiles");
  }

  const fs::path& folder_;
  mesh_files::MeshSpill& mesh_;
  const MeshTilesetOptions& options_;
  const LargeMeshLimits& limits_;
  const Progress& progress_;
  int depth_ = 0, bucket_level_ = 0;
  double texel_m_ = 0.0;
  std::optional<CellTree> cells_;
  std::optional<TileLevels> tiles_;
  std::optional<ContentSpill> contents_;
  std::vector<ContentSize> sizes_;  ///< one for each cell of the level that was made last
};

}  // namespace

void require_free_space(const fs::path& folder, std::uintmax_t bytes, const std::string& what) {
  std::error_code error;
  const fs::space_info space = fs::space(folder, error);
  if (error || space.available >= bytes) return;
  throw InputError(folder.string(), what + " needs about " + gigabytes(bytes) +
                                        " GB of free disk space for a while; there are " + gigabytes(space.available) +
                                        " GB");
}

MeshTilesetSummary write_large_mesh_tileset(const fs::path& folder, mesh_files::MeshSpill& mesh,
                                            const MeshTilesetOptions& options, const LargeMeshLimits& limits,
                                            const Progress& progress) {
  if (mesh.faces.size() == 0) throw InputError(folder.string(), "there is no triangle to write");
  MeshTilesetSummary out;
  const int most = tbb::this_task_arena::max_concurrency();
  tbb::task_arena arena(limits.threads > 0 ? std::min(limits.threads, most) : most);
  arena.execute([&] { out = LargeMeshTiler(folder, mesh, options, limits, progress).write(); });
  return out;
}

}  // namespace tileflight::tile_writer
