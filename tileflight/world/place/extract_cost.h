#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/tiles/tileset/content_sample.h"

namespace tileflight::place {

/// Cost of an extraction, estimated from some of its tiles.
struct ExtractCost {
  double tiles = 0.0;
  std::size_t tiles_probed = 0;
  double bytes_read = 0.0;
  double triangles = 0.0;
  double memory_bytes = 0.0;  ///< at most at a time, without blocks
  double disk_bytes = 0.0;    ///< of the files written
  double glb_bytes = 0.0;     ///< of mesh.glb among these, at least: without its textures
  double cpu_s = 0.0;         ///< processor time on one core of 2023
  /// Two standard errors of the sample, relative: if the other tiles are like these, the true cost lies within with a
  /// probability of 95 percent. Infinite if a single tile was probed.
  double spread = 0.0;

  /// Returns the cost of a part or a multiple of the place.
  ExtractCost scaled(double factor) const;
};

/// Estimates the cost of an extraction. `probes`: measures of some of the `tiles` contents, spread evenly over them.
/// `bytes_read`: size of all their files; below 0: not known, estimated from the probes.
ExtractCost estimate_extract_cost(const std::vector<tileset::ContentMeasures>& probes, double tiles, double bytes_read,
                                  double samples_per_m2);

/// Returns the memory that an extraction takes whose tiles have these sizes together.
double extraction_memory_bytes(const tileset::ContentMeasures& measures, double samples_per_m2);

/// Converts to {tiles, bytes, triangles, memory_bytes, disk_bytes, seconds}; numbers are rounded to three digits.
nlohmann::json to_json(const ExtractCost& cost);
/// Describes the cost: "462 tiles (58 MB), 3.0 million triangles: 0.9 GB of memory, 0.4 GB on disk, 5 s of processor
/// time (± 12 %)".
std::string cost_text(const ExtractCost& cost);

/// Throws InputError if the program alone takes more memory than is allowed, however small the blocks are.
void require_program_memory(std::uintmax_t memory_limit_bytes, const std::filesystem::path& folder);

/// Throws InputError, saying what to change, if the extraction certainly exceeds the memory (`memory_limit_bytes`), the
/// disk of `folder`, or the size that a GLB file can have; if it is only likely, nothing is thrown.
void require_affordable(const ExtractCost& cost, std::uintmax_t memory_limit_bytes,
                        const std::filesystem::path& folder);

/// Throws InputError if the disk of `folder` certainly lacks the space. An extraction in blocks needs no other check.
void require_disk_space(const ExtractCost& cost, const std::filesystem::path& folder);

}  // namespace tileflight::place
