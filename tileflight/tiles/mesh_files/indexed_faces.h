#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::mesh_files {

/// Index of an element that is not there.
inline constexpr std::uint32_t kInvalidIndex = std::numeric_limits<std::uint32_t>::max();

/// A corner of a face: zero-based indices of its position and of its texture coordinates (kInvalidIndex: none).
struct FaceCorner {
  std::uint32_t position = 0;
  std::uint32_t uv = kInvalidIndex;
};

/// All triangles of one material.
struct FaceGroup {
  std::string material;  ///< empty: unnamed
  std::vector<std::array<FaceCorner, 3>> triangles;
};

/// Faces as in OBJ and PLY files: corners with separate indices of position and texture coordinates. All indices are
/// valid.
struct IndexedFaces {
  std::vector<geometry::Vec3> positions;     ///< finite; in the file's units and axes
  std::vector<std::array<float, 3>> colors;  ///< one for each position, sRGB, 0..1; or empty
  std::vector<Eigen::Vector2f> uv;           ///< finite; v points up
  std::vector<FaceGroup> groups;             ///< in order of first use
};

/// Receives the faces of an OBJ or PLY file in its order, so that the reader need not hold them.
class FaceReceiver {
 public:
  virtual ~FaceReceiver() = default;
  /// Receives a finite position and its colour (as in the file: in OBJ files possibly out of 255).
  virtual void add_position(const geometry::Vec3& position, const std::optional<std::array<float, 3>>& color) = 0;
  /// Receives texture coordinates, v up.
  virtual void add_uv(const Eigen::Vector2f& uv) = 0;
  /// Sets the material of the faces that follow.
  virtual void use_material(const std::string& material) = 0;
  /// Receives a face of at least three corners, whose indices are valid.
  virtual void add_face(const std::vector<FaceCorner>& corners) = 0;
};

/// Merges positions and texture coordinates into vertices: each distinct pair in a group becomes one vertex, in order
/// of first use. One instance serves all groups.
class VertexDeduplicator {
 public:
  /// `faces` must outlive this object.
  explicit VertexDeduplicator(const IndexedFaces& faces)
      : faces_(faces), newest_(faces.positions.size(), kInvalidIndex) {}

  /// Returns the triangles of a group whose corners all have texture coordinates (`with_uv`), or those where one lacks
  /// them. The latter have vertex colours (linear) if the file has them, and no texture. v still points up.
  imaging::TexturedMesh build_mesh(const FaceGroup& group, bool with_uv);

 private:
  std::uint32_t vertex(const FaceCorner& corner, imaging::TexturedMesh& out);

  const IndexedFaces& faces_;
  std::vector<std::uint32_t> newest_;  ///< for each position: the last vertex created from it
  std::vector<std::uint32_t> older_;   ///< for each vertex: the previous one at its position
  std::vector<FaceCorner> vertices_;
};

/// Returns the index of a material's group, which is added at its first use. `group_of`: the groups by material.
std::size_t find_or_add_group(const std::string& material, std::map<std::string, std::size_t>& group_of,
                              IndexedFaces& faces);

/// Adds a face of any number of corners to a group, triangulated. Fewer than three corners add nothing.
void add_face(const std::vector<FaceCorner>& corners, const std::vector<geometry::Vec3>& positions, FaceGroup& group);

}  // namespace tileflight::mesh_files
