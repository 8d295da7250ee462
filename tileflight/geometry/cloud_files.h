#pragma once

#include <filesystem>

#include "tileflight/geometry/mesh.h"
#include "tileflight/geometry/point_cloud.h"

namespace tileflight::geometry {

enum class CloudEncoding { kAscii, kBinary };

/// Reads PLY (ascii, binary little and big endian), PCD (ascii, binary, binary_compressed) or XYZ text, by the
/// file's ending. Unknown properties become scalars. Throws InputError (file, line or byte, cause) on anything
/// malformed, truncated or not finite; counts in headers are checked against the file's size before allocation.
PointCloud read_cloud(const std::filesystem::path& file);

/// Writes .ply, .pcd or .xyz by the file's ending. Positions are written as double in PLY (so that a cloud far
/// from the origin keeps its millimetres) and float in PCD.
void write_cloud(const std::filesystem::path& file, const PointCloud& cloud,
                 CloudEncoding encoding = CloudEncoding::kBinary);

/// Triangles of a PLY file with faces (polygons become fans); throws InputError where there are none.
TriangleMesh read_ply_mesh(const std::filesystem::path& file);
void write_ply_mesh(const std::filesystem::path& file, const TriangleMesh& mesh);

}  // namespace tileflight::geometry
