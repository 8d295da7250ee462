#pragma once

#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::render {

/// A ray of an even grid over an image.
struct GridRay {
  geometry::Vec2 pixel;
  geometry::Vec3 direction;  ///< unit, camera frame
};

/// Returns the rays of an even grid over an image. `grid`: rays along the longer side of the image, at least 2. Pixels
/// outside the lens's valid region have none. Throws InputError.
std::vector<GridRay> grid_rays(const imaging::Camera& camera, int grid);

/// Overlap of two views: of the rays of both that hit a surface, the fraction whose surface point is also visible in
/// the other view (within its image and its lens's valid cone, not occluded). 1: both see the same; 0: nothing in
/// common, or no surface at all. Symmetric. Rays form an even grid of pixels.
class ViewOverlap {
 public:
  /// `grid`: rays along the longer side of an image. The scene must outlive it. Throws InputError if `grid` is below 2.
  ViewOverlap(const scene::Scene& scene, const imaging::Camera& a, const imaging::Camera& b, int grid = 48);

  double operator()(const geometry::SE3& T_local_a, const geometry::SE3& T_local_b) const;

 private:
  struct View {
    imaging::Camera camera;
    std::vector<GridRay> rays;
  };
  bool sees(const View& view, const geometry::SE3& T_local_camera, const geometry::Vec3& point) const;

  const scene::Scene& scene_;
  View a_, b_;
};

}  // namespace tileflight::render
