#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/point_cloud.h"

namespace tileflight::geometry {

enum class CloudEncoding { kAscii, kBinary };

/// Reads PLY (ascii, binary little and big endian), PCD (ascii, binary, binary_compressed) or XYZ text, chosen by the
/// file extension. Unknown properties become scalars. Throws InputError (file, line or byte, cause) for malformed,
/// truncated or non-finite data; counts in headers are checked against the file's size before allocation.
PointCloud read_cloud(const std::filesystem::path& file);

/// Writes .ply, .pcd or .xyz, chosen by the file extension. Positions are doubles in PLY (to keep millimetres far from
/// the origin) and floats in PCD.
void write_cloud(const std::filesystem::path& file, const PointCloud& cloud,
                 CloudEncoding encoding = CloudEncoding::kBinary);

/// Parses a PCD file (Point Cloud Library, versions .5 to .7; ascii, binary, binary_compressed). Invalid points of an
/// organised cloud (HEIGHT above 1), which PCD marks with NaN, are left out. `file` is used in messages. Throws
/// InputError.
PointCloud parse_pcd(std::string_view bytes, const std::string& file);

enum class PcdEncoding { kAscii, kBinary, kBinaryCompressed };
/// Encodes a cloud as PCD version 0.7. Positions, normals and scalars are floats, colours a packed "rgb".
std::string encode_pcd(const PointCloud& cloud, PcdEncoding encoding);

}  // namespace tileflight::geometry
