#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "tileflight/imaging/camera.h"
#include "tileflight/imaging/image.h"
#include "tileflight/scene/scene.h"
#include "tileflight/sensors/light.h"

namespace tileflight::sensors {

class Appearance;  // appearance.h
class Daylight;    // daylight.h

struct RenderOptions {
  bool depth = true;
  int samples_per_pixel = 1;                  ///< n x n even grid for n^2 samples: 1, 4, 9, 16
  imaging::Rgb8 background{135, 180, 225};    ///< where no surface is (sky)
  double haze_per_m = 0.0;                    ///< of a surface's light exp(-haze_per_m distance) is left
  std::optional<imaging::Rgb8> haze_color{};  ///< what surfaces fade to; none: the background, or daylight's horizon
  /// Sun and sky light the surfaces, whose textures are taken for their reflectance, and are the background. Null: the
  /// textures' own light.
  std::shared_ptr<const Daylight> daylight{};
};

/// What the pixels' central rays met, for the checks of a flight.
struct FrameView {
  double nearest_m = std::numeric_limits<double>::infinity();  ///< distance of the nearest surface seen
  double surface_share = 0.0;  ///< of the pixels within the lens's valid cone: those that see a surface
  double back_share = 0.0;     ///< of the pixels that see a surface: those that see it from behind
};

struct RenderedFrame {
  imaging::RgbImage rgb;  ///< black outside the lens's valid cone
  imaging::FloatImage
      depth_m;  ///< along the optical axis (negative behind the camera, where a lens sees there), by
                ///< the ray through the pixel's centre; +infinity where nothing is hit, NaN outside the valid cone
  FrameView view;
};

/// A frame before its exposure.
struct LightFrame {
  LightImage light;
  imaging::FloatImage depth_m;  ///< as in RenderedFrame, at moment times / 2 of the exposure
  FrameView view;
};

/// Where the camera is while it takes one frame: the pose at each of `times` moments of the exposure, for the whole
/// image or for each row (rolling shutter).
struct ShutterPoses {
  int times = 1;
  int rows = 1;                               ///< 1 or the image's height
  std::vector<geometry::SE3> T_local_camera;  ///< times x rows: moment k of row y is [k * rows + y]
};

/// What the ray through a pixel's centre met.
struct SurfacePoint {
  int x = 0, y = 0;                     ///< pixel
  bool hit = false;                     ///< false: nothing is there, and what follows but the ray is 0
  std::uint32_t mesh = 0;               ///< index into Scene::meshes()
  std::uint32_t triangle = 0;           ///< index into that mesh's triangles
  float distance_m = 0.0F;              ///< along the ray
  std::array<float, 3> ray_camera{};    ///< unit, camera frame
  std::array<float, 3> normal_local{};  ///< by the triangle's winding, not of unit length
};

/// Called once for each pixel within the lens's valid cone, from several threads at once and in any order.
using SurfaceVisitor = std::function<void(const SurfacePoint& point)>;

/// Frames of one camera in one scene, by casting each pixel's own ray; textured, lit or not, either side of a surface.
/// Texture reads are filtered over the pixel's footprint (mip levels, several trilinear probes along its long axis), so
/// that frames neither shimmer nor blur where surfaces recede; samples, rows and moments are averaged in linear light.
/// The scene must outlive it. Immutable: several threads may render at once. Same bytes for any thread count.
class CameraRenderer {
 public:
  CameraRenderer(const scene::Scene& scene, imaging::Camera camera, RenderOptions options);
  /// With an appearance that another camera in the same scene uses too.
  CameraRenderer(const scene::Scene& scene, std::shared_ptr<const Appearance> appearance, imaging::Camera camera,
                 RenderOptions options);
  ~CameraRenderer();
  CameraRenderer(const CameraRenderer&) = delete;
  CameraRenderer& operator=(const CameraRenderer&) = delete;

  const imaging::Camera& camera() const;
  std::shared_ptr<const Appearance> appearance() const;

  RenderedFrame render(const geometry::SE3& T_local_camera) const;
  /// Each row from its own pose (rolling shutter): one pose a row.
  RenderedFrame render_rows(std::span<const geometry::SE3> T_local_camera_of_row) const;
  /// Linear light averaged over the exposure. Throws std::invalid_argument when the number of poses is wrong.
  LightFrame render_light(const ShutterPoses& poses) const;
  /// Geometry alone, one ray a pixel: `T_local_camera_of_row` is one pose, or one a row.
  void visit_surface(std::span<const geometry::SE3> T_local_camera_of_row, const SurfaceVisitor& visitor) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::sensors
