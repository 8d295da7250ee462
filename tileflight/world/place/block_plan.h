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
