#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tileflight/alignment/icp.h"

namespace tileflight::alignment {

/// The keys of `transform.json`: matrix (4x4 row-major, map to local, scale included), scale, rmse, fitness,
/// iterations, converged, method, note; with correspondences, points, how firmly the surface holds the transform, and
/// its uncertainty (metres, degrees, covariance of metres, radians and log scale; it is not read back).
nlohmann::json to_json(const AlignmentResult& result);

/// The inverse of to_json. `matrix` must be there and be a similarity that agrees with `scale`; the other keys may be
/// missing, so that a file written by hand can give a start. Throws InputError (`where`, key, cause).
AlignmentResult alignment_from_json(const nlohmann::json& json, const std::string& where);

/// One file, written whole or not at all. Throws InputError.
void write_transform(const std::filesystem::path& file, const AlignmentResult& result);
AlignmentResult read_transform(const std::filesystem::path& file);

}  // namespace tileflight::alignment
