#include "tileflight/tiling/mesh_source.h"

#include <algorithm>
#include <cctype>
#include <cmath>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/text_fields.h"
#include "tileflight/imaging/image_files.h"
#include "tileflight/imaging/ktx2.h"
#include "tileflight/tile_contents/content.h"
#include "tileflight/tile_contents/gltf_meshes.h"
#include "tileflight/tiling/obj_meshes.h"
#include "tileflight/tiling/ply_meshes.h"
#include "tileflight/transport/uri.h"

namespace tileflight::tiling {
namespace {

namespace fs = std::filesystem;
using geometry::Triangle;
using geometry::Vec3;
using imaging::TexturedMesh;
using tile_contents::UpAxis;

MeshSource read_gltf(const fs::path& file, const MeshSourceOptions& options) {
  tile_contents::ContentOptions content;
  content.textures = options.textures;
  content.up_axis = options.up.value_or(UpAxis::kY);
  const auto beside = [&](const std::string& uri) { return file.parent_path() / transport::uri_path(uri); };
  content.read_resource = [&](const std::string& uri) { return base::read_bytes(beside(uri)); };
  content.read_image = [&](const std::string& uri) {
    return std::make_shared<const imaging::RgbImage>(imaging::decode_texture(
        base::read_bytes(beside(uri)), beside(uri).string(), content.limits.max_texture_pixels));
  };
  content.limits.max_texture_pixels = imaging::DecodeLimits{}.max_pixels;
  const std::vector<std::byte> bytes = base::read_bytes(file);
  if (const std::string kind = tile_contents::detect_content_format(bytes); kind != "glb" && kind != "JSON")
    throw InputError(file.string(), "is not a glTF file, judging by its first bytes");
  tile_contents::DecodedContent decoded = tile_contents::decode_content(bytes, file.string(), content);
  if (decoded.meshes.empty() && !decoded.clouds.empty())
    throw InputError(file.string(), "contains points without a surface; a mesh is needed");
  return {std::move(decoded.meshes), std::move(decoded.copyrights), std::move(decoded.warnings)};
}

/// Whether the triangle's area is distinguishable from zero in float precision.
bool has_area(const geometry::TriangleMesh& mesh, const Triangle& t) {
  const Vec3 ab = mesh.vertices[t[1]] - mesh.vertices[t[0]], ac = mesh.vertices[t[2]] - mesh.vertices[t[0]];
  return ab.cross(ac).squaredNorm() > 0;
}

/// Removes degenerate triangles, then meshes without triangles; returns the number of removed triangles.
std::int64_t drop_flat_triangles(std::vector<TexturedMesh>& meshes) {
  std::int64_t dropped = 0;
  for (TexturedMesh& m : meshes) {
    dropped += std::erase_if(m.mesh.triangles, [&](const Triangle& t) { return !has_area(m.mesh, t); });
  }
  std::erase_if(meshes, [](const TexturedMesh& m) { return m.mesh.triangles.empty(); });
  return dropped;
}

/// Rotates and scales; positions stay bit-identical if there is nothing to do.
void place(std::vector<TexturedMesh>& meshes, UpAxis up, double metres_per_unit) {
  const geometry::Mat3 turn = metres_per_unit * tile_contents::R_tile_gltf(up);
  if (turn.isIdentity(0)) return;
  for (TexturedMesh& m : meshes)
    for (Vec3& vertex : m.mesh.vertices) vertex = turn * vertex;
}

/// Sets texture coordinates that became infinite by a scale or an offset to 0.
void hold_texture_coordinates(std::vector<TexturedMesh>& meshes) {
  for (TexturedMesh& m : meshes)
    for (Eigen::Vector2f& uv : m.uv)
      if (!uv.allFinite()) uv.setZero();
}

/// Rejects coordinates too large for boxes or floats.
void check_extent(const std::vector<TexturedMesh>& meshes, const std::string& file) {
  constexpr double kMost_m = 1e8;
  for (const TexturedMesh& m : meshes)
    for (const Vec3& vertex : m.mesh.vertices)
      if (!(vertex.cwiseAbs().maxCoeff() <= kMost_m))
        throw InputError(file, "has a vertex farther than 100 000 km from its origin; check --scale");
}

}  // namespace

MeshSource read_mesh_source(const fs::path& file, const MeshSourceOptions& options) {
  const std::string ending = base::to_lower(file.extension().string());
  const bool is_gltf = ending == ".glb" || ending == ".gltf";
  if (!is_gltf && ending != ".obj" && ending != ".ply")
    throw InputError(file.string(), "unknown mesh format (.obj, .glb, .gltf or .ply expected)");
  MeshSource source = is_gltf            ? read_gltf(file, options)
                      : ending == ".obj" ? read_obj_meshes(file, options.textures)
                                         : read_ply_meshes(file, options.textures);
  place(source.meshes, is_gltf ? UpAxis::kZ : options.up.value_or(UpAxis::kZ), options.metres_per_unit);
  check_extent(source.meshes, file.string());
  hold_texture_coordinates(source.meshes);
  if (const std::int64_t dropped = drop_flat_triangles(source.meshes); dropped > 0)
    source.warnings.push_back(std::to_string(dropped) + " triangles without area are left out");
  if (source.meshes.empty()) throw InputError(file.string(), "contains no triangle with an area");
  return source;
}

}  // namespace tileflight::tiling
