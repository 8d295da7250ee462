#pragma once

#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::events {

/// Surfaces seen by the pixels of a picture: filled by a renderer's SurfaceVisitor.
struct SeenSurface {
  static constexpr std::uint32_t kPlace = std::numeric_limits<std::uint32_t>::max();

  imaging::FloatImage range_m;           ///< along the pixel's ray; +infinity: nothing, NaN: outside the lens
  imaging::Image<std::uint32_t> placed;  ///< index into Scene::placed(), or kPlace: nothing that moves
  SeenSurface(int width, int height);
  /// Returns a visitor that records what the pixels show of `scene`.
  render::SurfaceVisitor visitor(const scene::Scene& scene);
};

/// A camera and the things around it at one instant.
struct SceneInstant {
  geometry::SE3 T_local_camera;
  const scene::Scene* scene = nullptr;  ///< with the placed parts where they are; null: there are none
};

/// Computes how far surfaces move in a camera's image: ESIM's optic flow (section 3.2), over finite times, for any lens
/// and for things that move. The motion of a ray is turned to pixels by the lens's derivative there.
class ImageMotion {
 public:
  explicit ImageMotion(imaging::Camera camera) : camera_(std::move(camera)) {}

  /// A surface of one picture.
  struct Point {
    geometry::Vec3 ray;    ///< unit, camera frame
    double range_m = 0.0;  ///< +infinity: sky
    std::uint32_t placed = SeenSurface::kPlace;
    Eigen::Matrix<double, 2, 3> d_pixel_d_ray;
  };
  /// Returns the nearest surface of each block of 8 x 8 pixels and, if there is one, the nearest moving thing, since
  /// their images move most.
  std::vector<Point> nearest_points(const SeenSurface& seen) const;

  /// Returns the largest motion of the points' images from the instant at which they are seen to another, pixels.
  static double largest_px(const std::vector<Point>& points, const SceneInstant& seen_at, const SceneInstant& other);

 private:
  void add_point(const SeenSurface& seen, int x, int y, std::vector<Point>& points) const;

  imaging::Camera camera_;
};

}  // namespace tileflight::events
