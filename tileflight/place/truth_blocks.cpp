#include "tileflight/place/truth_blocks.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "tileflight/base/elapsed_time.h"
#include "tileflight/base/files.h"
#include "tileflight/base/formatted_text.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/number_text.h"
#include "tileflight/ground_truth/ground_truth.h"
#include "tileflight/place/memory_budget.h"

namespace tileflight::place {
namespace {

using geometry::Box3;
using geometry::Vec3;
using ground_truth::CellRange;

struct Surfaces {
  std::vector<imaging::TexturedMesh> meshes;
  std::vector<geometry::PointCloud> clouds;
};

/// Reads contents of the region; adds what was read to the counts.
Surfaces read_surfaces(tiles::RegionReader& reader, const std::vector<std::size_t>& contents, TruthCounts& counts,
                       const Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  Surfaces surfaces;
  for (tiles::LoadedContent& content : reader.read(contents, progress)) {
    for (const imaging::TexturedMesh& mesh : content.meshes) {
      for (const Vec3& vertex : mesh.mesh.vertices) counts.extent.extend(vertex);
    }
    for (const geometry::PointCloud& cloud : content.clouds) {
      for (const Vec3& point : cloud.positions) counts.extent.extend(point);
    }
    std::move(content.meshes.begin(), content.meshes.end(), std::back_inserter(surfaces.meshes));
    std::move(content.clouds.begin(), content.clouds.end(), std::back_inserter(surfaces.clouds));
  }
  counts.load_seconds += base::seconds_since(start);
  return surfaces;
}

void add(const ground_truth::GroundTruthSummary& part, TruthCounts& counts) {
  counts.triangles += part.triangles;
  counts.surface_points += part.surface_points;
  counts.cloud_points += part.cloud_points;
  counts.voxels_occupied += part.voxels.occupied.size();
  counts.voxel_dims = part.voxels.dims;
  counts.floor.add(part.quantization_floor_m);
}

ground_truth::GroundTruthOptions truth_options(const tiles::RegionReader& reader, const ExtractSettings& settings) {
  return {.voxel_m = settings.voxel_m,
          .samples_per_m2 = settings.samples_per_m2,
          .prisms = reader.placement().region.parts};
}

/// The blocks of a grid, as columns of `edge` cells along x and y.
std::vector<CellRange> blocks_of(const std::array<std::int32_t, 3>& dims, std::int32_t edge) {
  std::vector<CellRange> blocks;
  for (std::int32_t x = 0; x < dims[0]; x += edge) {
    for (std::int32_t y = 0; y < dims[1]; y += edge)
      blocks.push_back({{x, y, 0}, {std::min(x + edge, dims[0]) - 1, std::min(y + edge, dims[1]) - 1, dims[2] - 1}});
  }
  return blocks;
}

/// Memory that the truth of a content takes while it is made, as a multiple of memory_bytes: copies of its triangles,
/// samples, voxels and files.
constexpr double kTruthMemory = 3.0;

/// Share of the default memory limit that blocks chosen by memory may take on average: some hold more.
constexpr double kMemoryShare = 0.5;

/// A block's edge, metres, for which the average block takes that share of the memory, estimated from a few contents.
double edge_by_memory(tiles::RegionReader& reader, const ExtractSettings& settings) {
  constexpr std::size_t kProbes = 8;
  const std::size_t contents = reader.content_count();
  double bytes = 0.0;
  std::size_t read = 0;
  for (std::size_t k = 0; k < std::min(kProbes, contents); ++k) {
    for (const tiles::LoadedContent& content : reader.read({k * contents / std::min(kProbes, contents)})) {
      for (const imaging::TexturedMesh& mesh : content.meshes) {
        bytes += static_cast<double>(tiles::memory_bytes(mesh));
        if (mesh.texture) bytes += static_cast<double>(mesh.texture->pixels.size() * sizeof(imaging::Rgb8));
      }
      for (const geometry::PointCloud& cloud : content.clouds)
        bytes += static_cast<double>(cloud.size() * sizeof(Vec3));
    }
    ++read;
  }
  const Vec3 size = reader.placement().region.box().sizes();
  const double whole = bytes / static_cast<double>(std::max<std::size_t>(1, read)) * static_cast<double>(contents);
  const double share = kMemoryShare * static_cast<double>(settings.max_memory_bytes.value_or(default_memory_bytes())) /
                       (kTruthMemory * whole);
  return std::min(std::max(size.x(), size.y()), std::sqrt(size.x() * size.y() * share));
}

std::int32_t edge_in_cells(tiles::RegionReader& reader, const ExtractSettings& settings,
                           const std::array<std::int32_t, 3>& dims) {
  const double edge_m = *settings.block_m > 0.0 ? *settings.block_m : edge_by_memory(reader, settings);
  const double cells = std::clamp(std::round(edge_m / settings.voxel_m), 1.0, static_cast<double>(1 << 24));
  constexpr double kMostBlocks = 1e6;
  if (std::ceil(dims[0] / cells) * std::ceil(dims[1] / cells) > kMostBlocks) {
    throw InputError("--block " + base::trimmed_text(edge_m, 3) + " m",
                     "would give more than a million blocks: choose a larger edge, in metres");
  }
  return static_cast<std::int32_t>(cells);
}

/// Bounds of cells in metres, with some slack: tiles that only touch them may decide a voxel.
Box3 bounds_of(const CellRange& cells, const Vec3& origin, double edge_m, std::int32_t border) {
  const auto corner = [&](const std::array<std::int32_t, 3>& cell, double shift) {
    return Vec3(origin + edge_m * (Vec3(cell[0], cell[1], cell[2]) + Vec3::Constant(shift)));
  };
  return {corner(cells.low, -border - 0.6), corner(cells.high, border + 1.6)};
}

/// Makes the blocks of a region one after the other.
class BlockWriter {
 public:
  BlockWriter(tiles::RegionReader& reader, const ExtractSettings& settings, std::filesystem::path folder,
              const Progress& progress)
      : reader_(reader),
        options_(truth_options(reader, settings)),
        region_(reader.placement().region.box()),
        dims_(ground_truth::grid_dims(region_, settings.voxel_m)),
        edge_(edge_in_cells(reader, settings, dims_)),
        folder_(std::move(folder)),
        progress_(progress) {}

  /// The contents of all blocks, in counts and in index.json.
  TruthCounts run() {
    TruthCounts counts = write_blocks();
    // A tile may hold more than its bounding volume says; now that all are read, it is known where.
    if (any_content_missed()) counts = write_blocks();
    if (counts.triangles == 0 && counts.cloud_points == 0)
      throw InputError("region", "contains no triangle: check its centre, size and height");
    base::write_file(folder_ / "index.json",
                     nlohmann::json{{"block", edge_ * options_.voxel_m}, {"blocks", index_}}.dump(2) + "\n");
    return counts;
  }

 private:
  TruthCounts write_blocks() {
    TruthCounts counts(options_.voxel_m);
    index_ = nlohmann::json::array();
    read_.clear();
    const std::vector<CellRange> blocks = blocks_of(dims_, edge_);
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      report_progress(progress_, static_cast<std::int64_t>(i), static_cast<std::int64_t>(blocks.size()), "blocks");
      write(blocks[i], counts);
    }
    counts.voxel_dims = dims_;
    return counts;
  }

  void write(const CellRange& block, TruthCounts& counts) {
    const std::string name = base::formatted("blocks/x%05d_y%05d", block.low[0] / edge_, block.low[1] / edge_);
    const std::filesystem::path folder = folder_ / name;
    std::filesystem::remove_all(folder);
    std::filesystem::create_directories(folder);
    ground_truth::GroundTruthSummary part;
    for (std::int32_t border = 1;; border *= 2) {
      const Box3 bounds = bounds_of(block, region_.min(), options_.voxel_m, border);
      const std::vector<std::size_t> contents = reader_.contents_in(bounds);
      const Surfaces surfaces = read_surfaces(reader_, contents, counts, {});
      options_.block = {block, border};
      part = write_ground_truth(surfaces.meshes, region_, options_, folder, {}, surfaces.clouds);
      if (part.border_too_narrow) continue;
      read_.emplace_back(bounds, contents);
      break;
    }
    add(part, counts);
    if (std::filesystem::is_empty(folder)) {
      std::filesystem::remove(folder);
      return;
    }
    const Box3 own = bounds_of(block, region_.min(), options_.voxel_m, 0);
    const Vec3 slack = Vec3::Constant(0.6 * options_.voxel_m);
    const Vec3 low = own.min() + slack, high = own.max() - slack;
    index_.push_back({{"folder", name},
                      {"min", {low.x(), low.y(), low.z()}},
                      {"max", {high.x(), high.y(), high.z()}},
                      {"triangles", part.triangles},
                      {"voxels_occupied", part.voxels.occupied.size()}});
  }

  bool any_content_missed() const {
    return std::ranges::any_of(read_,
                               [&](const auto& block) { return reader_.contents_in(block.first) != block.second; });
  }

  tiles::RegionReader& reader_;
  ground_truth::GroundTruthOptions options_;
  Box3 region_;
  std::array<std::int32_t, 3> dims_;
  std::int32_t edge_;  ///< of a block, cells
  std::filesystem::path folder_;
  const Progress& progress_;
  nlohmann::json index_;
  std::vector<std::pair<Box3, std::vector<std::size_t>>>
      read_;  ///< of each block: where contents were sought, and found
};

}  // namespace

TruthCounts write_whole_truth(tiles::RegionReader& reader, const ExtractSettings& settings,
                              const std::filesystem::path& folder, const Progress& progress) {
  TruthCounts counts(settings.voxel_m);
  const Surfaces surfaces = read_surfaces(reader, reader.all_contents(), counts, progress);
  add(ground_truth::write_ground_truth(surfaces.meshes, reader.placement().region.box(),
                                       truth_options(reader, settings), folder, progress, surfaces.clouds),
      counts);
  return counts;
}

TruthCounts write_truth_in_blocks(tiles::RegionReader& reader, const ExtractSettings& settings,
                                  const std::filesystem::path& folder, const Progress& progress) {
  return BlockWriter(reader, settings, folder, progress).run();
}

}  // namespace tileflight::place
