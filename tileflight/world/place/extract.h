#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/world/place/extract_cost.h"
#include "tileflight/world/place/extract_result.h"

namespace tileflight::place {

/// One of several parts of a job; numbers start at 1.
struct JobPart {
  int number = 1, count = 1;
};

/// Input and options of extract().
struct ExtractSettings {
  std::string source;         ///< folder, archive or address of the tileset, as fetch::open_source() takes it
  tileset::LoadOptions load;  ///< region and geometric error
  double voxel_m = 1.0;
  double samples_per_m2 = 16.0;
  /// Edge of the blocks in which the truth is made, metres, rounded to whole voxels; 0: chosen by memory; nullopt: the
  /// region is one piece.
  std::optional<double> block_m;
  /// Number of processes that share this machine's memory, if the blocks are chosen by memory.
  int processes = 1;
  /// Keep finished blocks beside the output until it is complete, and reuse those of an earlier job (block_store.h).
  /// Always on with parts, and where such blocks exist.
  bool resume = false;
  std::optional<JobPart> part;  ///< make only this part of the blocks, for a later extract with `resume`
  /// Memory that the extraction may take, bytes; default: what is available (available_memory_bytes).
  std::optional<std::uintmax_t> max_memory_bytes;
};

/// Record of how the blocks of a ground truth were made.
struct BlockBuild {
  std::size_t blocks = 0;
  std::size_t blocks_reused = 0;  ///< blocks that an earlier job had made
  std::string note{};  ///< why blocks of an earlier job were not reused; empty: they were, or there were none
  std::optional<JobPart> part{};  ///< the part that was made alone
  std::size_t blocks_made = 0;    ///< by this process
};

/// Result of extract().
struct Extraction {
  std::optional<ExtractResult> result;  ///< content of extract.json; nullopt: only a part was made
  std::optional<BlockBuild> build;      ///< with blocks
};

/// Reads the region's tiles and writes its ground truth atomically as a folder: mesh.glb, surface.ply, voxels.binvox,
/// voxels.ply, octree.bt and extract.json. With blocks, each block is such a folder (without extract.json), index.json
/// names them, and memory depends on the block, not on the region. Cells, triangles and samples are together exactly
/// those without blocks. With a part, no output is written. Throws InputError, before most tiles are read if the
/// memory, the disk or the size of a GLB file certainly does not suffice (extract_cost.h).
Extraction extract(const ExtractSettings& settings, const std::filesystem::path& folder, bool replace,
                   const Progress& progress = {});

/// Converts to the JSON of the result with `build`: {blocks, blocks_reused, note, part, blocks_made} in it; null
/// if there is neither.
nlohmann::json to_json(const Extraction& extraction);

/// Describes the folder that extract() writes.
base::OutputFolder extract_output(const ExtractSettings& settings, const std::filesystem::path& folder, bool replace);

/// Estimated cost of an extraction.
struct ExtractPreview {
  std::string source;  ///< in the form in which it may be displayed
  ExtractCost cost;    ///< without blocks
  bool in_blocks = false;
  std::uintmax_t memory_limit_bytes = 0;
};

/// Estimates the cost of extract() from the region's cut and a few of its tiles; writes nothing. Throws InputError as
/// extract() would.
ExtractPreview preview_extract(const ExtractSettings& settings, const std::filesystem::path& folder, bool replace,
                               const Progress& progress = {});

/// Converts to {dry_run: true, source, estimate: {...}, tiles_probed, spread, in_blocks, memory_limit_bytes, text}.
nlohmann::json to_json(const ExtractPreview& preview);

}  // namespace tileflight::place
