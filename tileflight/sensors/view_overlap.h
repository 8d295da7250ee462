#pragma once

#include <vector>

#include "tileflight/geometry/transform.h"
#include "tileflight/imaging/camera.h"
#include "tileflight/scene/scene.h"

namespace tileflight::sensors {

/// How much two views share: of the rays of both that meet a surface, the share whose surface point the other view sees
/// too (within its image and its lens's valid cone, and nothing in front). 1: both see the same; 0: nothing in common,
/// or no surface at all. Symmetric. Rays are an even grid of pixels.
class ViewOverlap {
 public:
  /// `grid`: rays along the longer side of an image. The scene must outlive it. Throws InputError for a grid below 2.
  ViewOverlap(const scene::Scene& scene, const imaging::Camera& a, const imaging::Camera& b, int grid = 48);

  double operator()(const geometry::SE3& T_local_a, const geometry::SE3& T_local_b) const;

 private:
  struct View {
    imaging::Camera camera;
    std::vector<geometry::Vec3> rays;  ///< unit, camera frame
  };
  static View view_of(const imaging::Camera& camera, int grid);
  bool sees(const View& view, const geometry::SE3& T_local_camera, const geometry::Vec3& point) const;

  const scene::Scene& scene_;
  View a_, b_;
};

}  // namespace tileflight::sensors
