#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/world/place/block_grid.h"
#include "tileflight/world/place/extract.h"
#include "tileflight/tiles/tileset/region_reader.h"

namespace tileflight::place {

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
