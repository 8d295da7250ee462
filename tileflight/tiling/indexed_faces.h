#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::tiling {

inline constexpr std::uint32_t kNoIndex = std::numeric_limits<std::uint32_t>::max();

/// A corner of a face: indices, from 0, into positions and texture coordinates (kNoIndex: none).
struct FaceCorner {
  std::uint32_t position = 0;
  std::uint32_t uv = kNoIndex;
};

/// All triangles of one material.
struct FaceGroup {
  std::string material;  ///< empty: none was named
  std::vector<std::array<FaceCorner, 3>> triangles;
};

/// Surfaces as OBJ and PLY have them: corners with separate indices of position and texture coordinates. All indices
/// lead somewhere.
struct IndexedFaces {
  std::vector<geometry::Vec3> positions;     ///< finite; in the file's units and axes
  std::vector<std::array<float, 3>> colors;  ///< one a position, as displayed, 0..1; or empty
  std::vector<Eigen::Vector2f> uv;           ///< finite; v points up
  std::vector<FaceGroup> groups;             ///< in order of first use
};

/// Makes vertices of positions and texture coordinates: each pair that occurs in a group becomes one, in order of first
/// use. One object for all groups.
class VertexJoiner {
 public:
  /// `faces` must outlive this.
  explicit VertexJoiner(const IndexedFaces& faces) : faces_(faces), newest_(faces.positions.size(), kNoIndex) {}

  /// The triangles of a group whose corners all have texture coordinates, or those that lack one; with vertex colours
  /// (linear) where the file has them, without texture. v still points up.
  imaging::TexturedMesh join(const FaceGroup& group, bool with_uv);

 private:
  std::uint32_t vertex(const FaceCorner& corner, imaging::TexturedMesh& out);

  const IndexedFaces& faces_;
  std::vector<std::uint32_t> newest_;  ///< of each position: the last vertex made of it
  std::vector<std::uint32_t> older_;   ///< of each vertex: the one before it at its position
  std::vector<FaceCorner> vertices_;
};

/// Adds a face of any number of corners to a group, as triangles. Fewer than three corners give none.
void add_face(const std::vector<FaceCorner>& corners, const std::vector<geometry::Vec3>& positions, FaceGroup& group);

}  // namespace tileflight::tiling
