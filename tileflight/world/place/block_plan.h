#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/tiles/tileset/region_reader.h"
#include "tileflight/world/ground_truth/voxelize.h"
#include "tileflight/world/place/extract.h"

namespace tileflight::place {

/// Divides a region's voxel grid into blocks: columns of whole cells over its height, in the order of index.json (by x,
/// then by y).
class BlockGrid {
 public:
  /// Divides the region into blocks of `edge` cells. Throws InputError if that gives more than a million blocks.
  BlockGrid(const geometry::Box3& region, double voxel_m, std::int32_t edge);

  std::size_t size() const { return blocks_.size(); }
  double edge_m() const { return edge_ * voxel_m_; }
  const std::array<std::int32_t, 3>& dims() const { return dims_; }  ///< of the whole grid, cells
  const ground_truth::CellRange& cells(std::size_t block) const { return blocks_[block]; }
  /// Returns the block's folder name, "x00003_y00001".
  std::string name(std::size_t block) const;
  /// Returns the block's bounds, local frame.
  geometry::Box3 bounds(std::size_t block) const;
  /// Returns the box in which contents may decide the block's voxels: the block and `border` cells around it, with some
  /// slack for tiles that only touch them.
  geometry::Box3 reach(std::size_t block, std::int32_t border) const;

 private:
  geometry::Box3 region_;
  double voxel_m_;
  std::int32_t edge_;
  std::array<std::int32_t, 3> dims_;
  std::vector<ground_truth::CellRange> blocks_;
};

/// Converts the length of a block's edge to whole cells, at least one.
std::int32_t edge_in_cells(double edge_m, double voxel_m);

/// Measures what a region's contents hold inside a box of the local frame.
tileset::ContentMeasures measure_within(const std::vector<imaging::TexturedMesh>& meshes,
                                        const std::vector<geometry::PointCloud>& clouds, const geometry::Box3& box);

/// Memory of an extraction, whole and in blocks, estimated from some contents of the region, which are read.
class MemoryPlan {
 public:
  MemoryPlan(tileset::RegionReader& reader, const ExtractSettings& settings);

  /// Returns the cost of the region in one piece.
  const ExtractCost& whole() const { return whole_; }
  /// Returns the memory of the largest block of this edge, bytes.
  double block_bytes(double edge_m) const;
  /// Returns the largest edge whose blocks take at most so many bytes; at least that of a voxel.
  double edge_within(double bytes) const;

 private:
  struct Probe {
    double fixed_bytes = 0.0, divided_bytes = 0.0;  ///< of a content as read; of its part in a block
    double east_m = 0.0, north_m = 0.0;             ///< its extent
  };

  geometry::Vec3 size_;
  double voxel_m_;
  ExtractCost whole_;
  std::vector<Probe> probes_;
};

/// Returns the memory that an extraction may take, bytes.
std::uintmax_t memory_limit(const ExtractSettings& settings);

/// Throws MemoryLimitExceeded if what was read for an extraction, or for one of its blocks (within `box`), is estimated
/// to take more memory than is allowed. `edge_m`: the block's; 0: there are no blocks.
void require_memory(const std::vector<imaging::TexturedMesh>& meshes, const std::vector<geometry::PointCloud>& clouds,
                    const geometry::Box3& box, double edge_m, const ExtractSettings& settings);

/// Returns everything that determines the region's cells, triangles and samples, except the edge of the blocks.
nlohmann::json truth_inputs(const tileset::RegionReader& reader, const ExtractSettings& settings);

/// Returns the edge of the blocks that `settings` ask for, cells. An edge chosen by memory is estimated from a few
/// contents, unless the folder `store` holds blocks from the same inputs, whose edge is kept.
std::int32_t choose_edge(tileset::RegionReader& reader, const ExtractSettings& settings, const nlohmann::json& inputs,
                         const std::filesystem::path& store);

/// Returns the cost of each block: the number of contents that it reads.
std::vector<double> block_costs(const tileset::RegionReader& reader, const BlockGrid& grid);

/// Division of a job into parts.
struct BlockPlan {
  double edge_m = 0.0;  ///< of a block, whole voxels
  int parts = 0;
  double memory_bytes = 0.0;  ///< estimate of what the largest block takes
  std::string inputs_sha256;  ///< equal inputs give equal blocks
};

/// Cuts the blocks of `settings` into `parts`, fewer if there are fewer blocks. Throws InputError.
BlockPlan plan_truth_blocks(const ExtractSettings& settings, const std::filesystem::path& output, int parts);

}  // namespace tileflight::place
