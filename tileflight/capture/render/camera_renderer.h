#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "tileflight/capture/render/linear_color.h"
#include "tileflight/capture/render/weather.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::render {

class Appearance;   // appearance.h
struct CameraRays;  // ray_table.h
class Daylight;     // daylight.h

struct RenderOptions {
  bool depth = true;
  int samples_per_pixel = 1;                  ///< n x n grid for n^2 samples: 1, 4, 9, 16
  imaging::Rgb8 background{135, 180, 225};    ///< colour where no surface is hit (sky)
  double haze_per_m = 0.0;                    ///< light of a surface is attenuated by exp(-haze_per_m distance)
  std::optional<imaging::Rgb8> haze_color{};  ///< default: the background, or daylight's horizon
  /// Light by sun and sky: textures are taken as reflectance, and the sky is the background. Null: textures are shown
  /// as they are.
  std::shared_ptr<const Daylight> daylight{};
  /// Null or clear: no weather. Drops and flakes are drawn by streaks.h; here they only absorb and scatter light.
  std::shared_ptr<const WeatherOptions> weather{};
  double weather_offset_s = 0.0;  ///< time on the weather's clock = a frame's + this
};

/// Statistics of the surfaces that the pixels' central rays meet, for checks of a flight.
struct ViewStatistics {
  double nearest_m = std::numeric_limits<double>::infinity();  ///< distance of the nearest surface
  std::int64_t rays = 0;                                       ///< of the pixels within the lens's valid cone
  std::int64_t surfaces = 0;                                   ///< rays that see a surface
  std::int64_t back_faces = 0;                                 ///< of them, those that see its back face

  double surface_share() const;    ///< of the rays; NaN if there are none
  double back_face_share() const;  ///< of the surfaces; 0 if there are none
  /// Adds the rays of other pixels.
  void add(const ViewStatistics& other);
};

struct RenderedFrame {
  imaging::RgbImage rgb;  ///< black outside the lens's valid cone
  imaging::FloatImage
      depth_m;  ///< along the optical axis (negative behind the camera, for lenses beyond 180 degrees), for the ray
                ///< through the pixel's centre; +infinity if nothing is hit, NaN outside the valid cone
  ViewStatistics view;
};

/// A frame before exposure.
struct LightFrame {
  LinearImage light;
  imaging::FloatImage depth_m;  ///< as in RenderedFrame, at moment moments / 2 of the exposure
  ViewStatistics view;
};

/// Consumes the light of neighbouring pixels of a row, from (x, y) on; called from several threads at once, in any
/// order.
using LightSink = std::function<void(int x, int y, std::span<const LinearRgb> light)>;

/// Camera poses during one frame: the pose at each of `moments` times of the exposure, for the whole image or for each
/// row (rolling shutter).
struct ShutterPoses {
  int moments = 1;
  int rows = 1;                               ///< 1 or the image's height
  std::vector<geometry::SE3> T_local_camera;  ///< moments x rows: moment k of row y is [k * rows + y]
  std::vector<float> scene_times{};           ///< scene::Ray::time at each of these; empty: 0 for all
  std::vector<double> times_s{};              ///< of each, on the clock of the poses; not used by CameraRenderer
};

/// Intersection of the ray through a pixel's centre.
struct SurfacePoint {
  int x = 0, y = 0;                     ///< pixel
  bool hit = false;                     ///< false: nothing is hit, and all members below except ray_camera are 0
  std::uint32_t mesh = 0;               ///< index into Scene::meshes()
  std::uint32_t triangle = 0;           ///< index into that mesh's triangles
  float distance_m = 0.0F;              ///< along the ray
  std::array<float, 3> ray_camera{};    ///< unit, camera frame
  std::array<float, 3> normal_local{};  ///< oriented by the triangle's winding, not unit length
};

/// The pixels for which a SurfaceVisitor is called.
enum class VisitedPixels {
  kAll,     ///< all within the lens's valid cone
  kPlaced,  ///< of them, those that show a placed part of the scene
};

/// A function that is called once for each of its pixels, from several threads at once and in any order; not at all if
/// it is empty.
struct SurfaceVisitor {
  SurfaceVisitor() = default;
  template <std::invocable<const SurfacePoint&> Visit>
  SurfaceVisitor(Visit what, VisitedPixels which = VisitedPixels::kAll) : visit(std::move(what)), pixels(which) {}
  explicit operator bool() const { return static_cast<bool>(visit); }

  std::function<void(const SurfacePoint& point)> visit;
  VisitedPixels pixels = VisitedPixels::kAll;
};

/// Renders frames of one camera in one scene by ray casting; textured, lit or unlit, both faces of surfaces. Texture
/// reads are filtered over the pixel's footprint (mip levels, several trilinear probes along its long axis), which
/// prevents aliasing and excessive blur on receding surfaces; samples, rows and moments are averaged in linear light.
/// The scene must outlive it. Immutable: several threads may render at once. The result does not depend on the number
/// of threads.
class CameraRenderer {
 public:
  CameraRenderer(const scene::Scene& scene, imaging::Camera camera, RenderOptions options);
  /// Uses an appearance shared with other cameras in the same scene.
  CameraRenderer(const scene::Scene& scene, std::shared_ptr<const Appearance> appearance, imaging::Camera camera,
                 RenderOptions options);
  /// Uses the rays of another renderer's camera, in another scene or light.
  CameraRenderer(const scene::Scene& scene, std::shared_ptr<const Appearance> appearance,
                 std::shared_ptr<const CameraRays> rays, RenderOptions options);
  ~CameraRenderer();
  CameraRenderer(const CameraRenderer&) = delete;
  CameraRenderer& operator=(const CameraRenderer&) = delete;

  const imaging::Camera& camera() const;
  const RenderOptions& options() const;
  const geometry::Vec3& anchor() const;  ///< of the scene
  std::shared_ptr<const Appearance> appearance() const;
  /// Returns the camera's rays, to be shared: they are as large as the image and independent of the scene.
  std::shared_ptr<const CameraRays> rays() const;

  /// Renders an image. `visitor`, if any, is called as by visit_surface() for the same rays, which are cast once for
  /// both.
  RenderedFrame render(const geometry::SE3& T_local_camera, const SurfaceVisitor& visitor = {}) const;
  /// Renders each row from its own pose (rolling shutter): one pose per row.
  RenderedFrame render_rows(std::span<const geometry::SE3> T_local_camera_of_row,
                            const SurfaceVisitor& visitor = {}) const;
  /// Renders the linear light averaged over the exposure; `visitor` sees its middle moment. `sink`: takes each pixel's
  /// light once, those without a ray included, and LightFrame::light stays empty. Throws std::invalid_argument if the
  /// number of poses is wrong.
  LightFrame render_light(const ShutterPoses& poses, const SurfaceVisitor& visitor = {},
                          const LightSink& sink = {}) const;
  /// Casts one ray per pixel without shading. `T_local_camera_of_row` is one pose, or one per row; `scene_times`: of
  /// the scene at each (scene::Ray::time), empty: 0.
  void visit_surface(std::span<const geometry::SE3> T_local_camera_of_row, const SurfaceVisitor& visitor,
                     std::span<const float> scene_times = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::render
