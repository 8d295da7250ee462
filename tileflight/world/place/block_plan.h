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

/// The blocks of a region's voxel grid: columns of whole cells over its height, in the order of index.json (by x, then
/// by y).
class BlockGrid {
 public:
  /// `edge`: of a block, cells. Throws InputError if that gives more than a million blocks.
  BlockGrid(const geometry::Box3& region, double voxel_m, std::int32_t edge);

  std::size_t size() const { return blocks_.size(); }
  double edge_m() const { return edge_ * voxel_m_; }
  const std::array<std::int32_t, 3>& dims() const { return dims_; }  ///< of the whole grid, cells
  const ground_truth::CellRange& cells(std::size_t block) const { return blocks_[block]; }
  /// "x00003_y00001".
  std::string name(std::size_t block) const;
  /// Its bounds, local frame.
  geometry::Box3 bounds(std::size_t block) const;
  /// Where contents may decide its voxels: the block and so many cells around it, with some slack for tiles that only
  /// touch them.
  geometry::Box3 reach(std::size_t block, std::int32_t border) const;

 private:
  geometry::Box3 region_;
  double voxel_m_;
  std::int32_t edge_;
  std::array<std::int32_t, 3> dims_;
  std::vector<ground_truth::CellRange> blocks_;
};

/// A length as the edge of blocks: whole cells, at least one.
std::int32_t edge_in_cells(double edge_m, double voxel_m);

/// All that determines the region's cells, triangles and samples; not yet the edge of the blocks.
nlohmann::json truth_inputs(const tileset::RegionReader& reader, const ExtractSettings& settings);

/// The edge of the blocks that `settings` ask for, cells; one chosen by memory is estimated from a few contents, and
/// stays that of blocks which are in the folder `store` from the same inputs.
std::int32_t choose_edge(tileset::RegionReader& reader, const ExtractSettings& settings, const nlohmann::json& inputs,
                         const std::filesystem::path& store);

/// What it costs to make each block: the contents that it reads.
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
