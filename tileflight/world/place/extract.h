#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::place {

/// One of several parts of a job, from 1.
struct JobPart {
  int number = 1, count = 1;
};

/// Input and resolution of `tileflight extract`.
struct ExtractSettings {
  std::string source;         ///< SOURCE of the contract
  tileset::LoadOptions load;  ///< region and geometric error
  double voxel_m = 1.0;
  double samples_per_m2 = 16.0;
  /// Edge of the blocks in which the truth is made, metres, rounded to whole voxels; 0: chosen by memory; nullopt: the
  /// region is one piece.
  std::optional<double> block_m;
  /// Of blocks chosen by memory: processes that share this machine's memory.
  int processes = 1;
  /// Keep finished blocks beside the output until it is complete, and reuse those of an earlier job (block_store.h).
  /// Always done with parts, and where such blocks are.
  bool resume = false;
  std::optional<JobPart> part;  ///< make only this part of the blocks, for a later extract with `resume`
  /// Memory that the extraction may take, bytes; default: what is available (available_memory_bytes).
  std::optional<std::uintmax_t> max_memory_bytes;
};

/// Reads the region's tiles and writes its ground truth atomically as a folder: mesh.glb, surface.ply, voxels.binvox,
/// voxels.ply, octree.bt and extract.json, whose content is returned. With blocks, each block is such a folder (without
/// extract.json), index.json names them, and memory depends on the block, not on the region; cells, triangles and
/// samples are together exactly those without blocks. Throws InputError, before most tiles are read if the memory, the
/// disk or the size of a GLB file certainly does not suffice (extract_cost.h).
/// With blocks, `build` is returned in addition: {blocks, blocks_reused, note}. With a part, no output is written and
/// `build` alone returned.
nlohmann::json extract(const ExtractSettings& settings, const std::filesystem::path& folder, bool replace,
                       const Progress& progress = {});

/// The folder that extract() writes.
base::OutputFolder extract_output(const ExtractSettings& settings, const std::filesystem::path& folder, bool replace);

/// Cost of extract(), estimated from the region's cut and a few of its tiles; nothing is written.
/// {dry_run: true, estimate: {...}, tiles_probed, spread, memory_limit_bytes}. Throws InputError as extract() would.
nlohmann::json preview_extract(const ExtractSettings& settings, const std::filesystem::path& folder, bool replace,
                               const Progress& progress = {});

/// Reads extract.json of a folder written by extract().
nlohmann::json read_extract_json(const std::filesystem::path& folder);

/// A region as {center, size} and, if polygons bound it, their rings; metres in the local frame.
nlohmann::json region_json(const tileset::Region& region);

/// The local frame's origin as {origin_lat, origin_lon (degrees), origin_height (metres above the ellipsoid)}; nulls
/// without a frame.
nlohmann::json frame_json(const std::optional<geometry::LocalFrame>& frame);

/// The local frame's origin in an extract.json; nullopt if the place is not georeferenced.
std::optional<geometry::Geodetic> origin_from_json(const nlohmann::json& extract_json);

/// Entries of dataset.yaml that describe the local frame: `frame.kind` is east-north-up with `frame.origin_lat`,
/// `origin_lon` (degrees) and `origin_height` (metres above the ellipsoid), or tileset: its own z-up frame.
std::map<std::string, std::string> describe_frame(const std::optional<geometry::Geodetic>& origin);

}  // namespace tileflight::place
