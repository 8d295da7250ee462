#pragma once

#include <nlohmann/json.hpp>

#include "tileflight/core/geometry/transform.h"

// Vectors and quaternions as lists of numbers in JSON. Sources include it, headers do not: it brings all of
// nlohmann/json.

namespace tileflight::geometry {

/// Converts a vector to [x, y, z].
inline nlohmann::json json_numbers(const Vec3& v) { return {v.x(), v.y(), v.z()}; }
/// Converts a quaternion to [x, y, z, w].
inline nlohmann::json json_numbers(const Eigen::Quaterniond& q) { return {q.x(), q.y(), q.z(), q.w()}; }

}  // namespace tileflight::geometry
