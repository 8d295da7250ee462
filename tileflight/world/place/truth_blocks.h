#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "tileflight/core/base/progress.h"
#include "tileflight/tiles/tileset/region_reader.h"
#include "tileflight/world/ground_truth/quantization_floor.h"
#include "tileflight/world/place/extract.h"

namespace tileflight::place {

/// Totals of a region's ground truth over all its blocks.
struct TruthCounts {
  explicit TruthCounts(double voxel_m) : floor(voxel_m) {}

  std::size_t triangles = 0, surface_points = 0, cloud_points = 0, voxels_occupied = 0;
  std::array<std::int32_t, 3> voxel_dims{};  ///< of the whole region
  geometry::Box3 extent;                     ///< of the contents read, which may reach beyond the region
  ground_truth::QuantizationFloor floor;
  double load_seconds = 0.0;  ///< spent reading tiles, by this process
};

/// Writes a region's ground truth into a folder, in one piece. Throws InputError.
TruthCounts write_whole_truth(tileset::RegionReader& reader, const ExtractSettings& settings,
                              const std::filesystem::path& folder, const Progress& progress);

/// Makes a region's ground truth in blocks of `settings.block_m` (which is set) beside the output folder
/// (block_store.h): this process and others each make some, then one joins them. Blocks are columns over the region's
/// height; a block that holds nothing has no folder.
class TruthBlocks {
 public:
  /// Prepares and enters the store. Blocks of an earlier job with the same inputs are kept. References must outlive it.
  /// Throws InputError.
  TruthBlocks(tileset::RegionReader& reader, const ExtractSettings& settings, const std::filesystem::path& output,
              const Progress& progress);
  /// Unless blocks are to be kept for another job (`settings.resume`, a part), removes what is unfinished.
  ~TruthBlocks();
  TruthBlocks(const TruthBlocks&) = delete;
  TruthBlocks& operator=(const TruthBlocks&) = delete;

  /// Makes the blocks that are not there, with `settings.part` only those of that part. Throws MemoryLimitExceeded if
  /// one takes more memory than is allowed.
  void make();
  /// Once all are there: writes index.json into truth_folder(). Throws InputError if the region holds nothing.
  TruthCounts join();
  /// The folder that becomes the output.
  std::filesystem::path truth_folder() const;
  /// Removes the store, whose truth folder is elsewhere by now.
  void remove();

  double edge_m() const;       ///< of a block
  std::size_t count() const;   ///< of blocks
  std::size_t reused() const;  ///< blocks that an earlier job had made
  std::size_t made() const;    ///< by this process
  /// Says why blocks of an earlier job were not reused; empty: they were, or there were none.
  const std::string& note() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Folder of an output's finished blocks until it is complete.
std::filesystem::path block_build_folder(const std::filesystem::path& output);

}  // namespace tileflight::place
