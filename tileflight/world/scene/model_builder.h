#pragma once

#include <array>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::scene {

/// A ring of points in a plane x = constant, for lofted shapes; counter-clockwise seen from +x.
using Ring = std::vector<geometry::Vec3>;

/// Builds a mesh of flat, coloured faces whose fronts (counter-clockwise) face outwards. Colours are sRGB; they are
/// stored linear, as TexturedMesh wants them, and shaded a little by the face's slope, as if under an even sky: tiles'
/// textures hold their light, so that faces of one colour would look cut out of paper beside them.
class ModelBuilder {
 public:
  void triangle(const geometry::Vec3& a, const geometry::Vec3& b, const geometry::Vec3& c, const imaging::Rgb8& colour);
  void quad(const geometry::Vec3& a, const geometry::Vec3& b, const geometry::Vec3& c, const geometry::Vec3& d,
            const imaging::Rgb8& colour);
  /// Sides between two rings of as many points, in the same order; `from` is the one with the smaller coordinate along
  /// the rings' axis.
  void loft(const Ring& from, const Ring& to, const imaging::Rgb8& colour);
  /// A convex ring as a face, seen as its points turn.
  void face(const Ring& ring, const imaging::Rgb8& colour);
  /// Frustum between two level rectangles: centres, and half sizes along x and y.
  void frustum(const geometry::Vec3& bottom, const geometry::Vec2& bottom_half, const geometry::Vec3& top,
               const geometry::Vec2& top_half, const imaging::Rgb8& colour);
  /// Frustum of a cone with its axis from `from` to `to`; radius 0 makes a tip. With end faces.
  void cone(const geometry::Vec3& from, double from_radius, const geometry::Vec3& to, double to_radius, int sides,
            const imaging::Rgb8& colour);
  void ellipsoid(const geometry::Vec3& center, const geometry::Vec3& radii, int segments, const imaging::Rgb8& colour);

  /// The mesh so far, which is taken.
  imaging::TexturedMesh take();

 private:
  imaging::TexturedMesh mesh_;
};

}  // namespace tileflight::scene
