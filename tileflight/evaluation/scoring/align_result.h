#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <variant>

#include "tileflight/core/alignment/align_map.h"
#include "tileflight/core/alignment/regions.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/evaluation/registration/register_map.h"

namespace tileflight::scoring {

/// A map that was registered with all evidence of its flight.
struct RegisteredFlight {
  registration::RegistrationResult registration;
  alignment::IcpResult published;  ///< the last step of the paper's alignment, started from the registration
};

/// A map that was aligned by ICP alone.
struct IcpAlignment {
  alignment::MapAlignment aligned{};
  std::optional<alignment::IcpResult> to_surface{};  ///< refined to the triangles of the ground truth, if it has any
  alignment::RegionList regions{};                   ///< empty: the whole map was aligned
  std::string start{};  ///< "as it is", "given", "geometry", "receiver positions" or "true poses"
};

/// Result of align(), which transform.json stores.
struct AlignResult {
  std::variant<IcpAlignment, RegisteredFlight> found{};
  bool holds_scale = false;             ///< the map is in metres: its scale was held, and compared with the surface's
  std::optional<double> scale_error{};  ///< share by which the lengths of such a map are too long; nullopt: unknown
  std::size_t blocks_read = 1, blocks = 1;  ///< blocks of the ground truth, and those that were read
  Warnings warnings{};

  const geometry::Sim3& T_local_map() const;
};

/// Returns the content of transform.json (docs/formats.md).
nlohmann::json to_json(const AlignResult& result);

/// The part of transform.json that scoring a map needs.
struct ScoringTransform {
  geometry::Sim3 T_published_map;   ///< map to local, for distances to voxel centres
  geometry::Sim3 T_surface_map;     ///< map to local, for distances to the exact surface
  std::optional<double> sigma_m{};  ///< standard deviation of the aligned points due to noise
  std::optional<alignment::RegionList> regions{};
  Warnings warnings{};
};

/// Reads transform.json, written by align() or by hand. A transform that the file lacks is its key `matrix`. Throws
/// InputError.
ScoringTransform read_scoring_transform(const std::filesystem::path& transform_json);

}  // namespace tileflight::scoring
