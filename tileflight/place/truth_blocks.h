#pragma once

#include <array>
#include <cstdint>
#include <filesystem>

#include "tileflight/base/progress.h"
#include "tileflight/ground_truth/quantization_floor.h"
#include "tileflight/place/extract.h"
#include "tileflight/tiles/region_reader.h"

namespace tileflight::place {

/// What a region's ground truth holds, over all its blocks.
struct TruthCounts {
  explicit TruthCounts(double voxel_m) : floor(voxel_m) {}

  std::size_t triangles = 0, surface_points = 0, cloud_points = 0, voxels_occupied = 0;
  std::array<std::int32_t, 3> voxel_dims{};  ///< of the whole region
  geometry::Box3 extent;                     ///< of the contents read, which may reach beyond the region
  ground_truth::QuantizationFloor floor;
  double load_seconds = 0.0;  ///< spent reading tiles
};

/// Writes a region's ground truth into a folder, in one piece. Throws InputError.
TruthCounts write_whole_truth(tiles::RegionReader& reader, const ExtractSettings& settings,
                              const std::filesystem::path& folder, const Progress& progress);

/// Writes it as blocks of `settings.block_m` (which is set), each in a folder below `folder` that index.json names.
/// Blocks are columns over the region's height; a block that holds nothing has no folder. Throws InputError.
TruthCounts write_truth_in_blocks(tiles::RegionReader& reader, const ExtractSettings& settings,
                                  const std::filesystem::path& folder, const Progress& progress);

}  // namespace tileflight::place
