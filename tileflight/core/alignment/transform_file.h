#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "tileflight/core/alignment/icp.h"

namespace tileflight::alignment {

/// Returns the keys of `transform.json`: matrix (4x4 row-major, map to local, scale included), scale, rmse, fitness,
/// iterations, converged, method, note; also correspondences, points, the constraint by the surface, and the
/// uncertainty (metres, degrees, covariance of metres, radians and log scale; not read back).
nlohmann::json to_json(const IcpResult& result);

/// Reads what to_json() returns. `matrix` is required and must be a similarity consistent with `scale`; other keys are
/// optional, so that a hand-written file can serve as a start. Throws InputError (`where`, key, cause).
IcpResult alignment_from_json(const nlohmann::json& json, const std::string& where);

/// Reads a transform.json. Throws InputError.
IcpResult read_transform(const std::filesystem::path& file);

}  // namespace tileflight::alignment
