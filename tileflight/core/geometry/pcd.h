#pragma once

#include <string>
#include <string_view>

#include "tileflight/core/geometry/cloud_files.h"

namespace tileflight::geometry {

/// Parses a PCD file (Point Cloud Library, versions .5 to .7; ascii, binary, binary_compressed). Invalid points of an
/// organised cloud (HEIGHT above 1), which PCD marks with NaN, are left out. `file` is used in messages. Throws
/// InputError.
PointCloud parse_pcd(std::string_view bytes, const std::string& file);

/// Encodes a cloud as PCD version 0.7. Positions, normals and scalars are floats, colours a packed "rgb".
enum class PcdEncoding { kAscii, kBinary, kBinaryCompressed };
std::string encode_pcd(const PointCloud& cloud, PcdEncoding encoding);

}  // namespace tileflight::geometry
