#pragma once

#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/live/simulator/object_labels.h"
#include "tileflight/live/simulator/resident_scene.h"

namespace tileflight::simulator {

/// Depth where there is no surface: the largest number that AirSim's depth can hold, metres.
inline constexpr float kSkyDistance_m = 65504.0F;
/// Baseline of the virtual stereo pair used for disparity.
inline constexpr double kStereoBaseline_m = 0.25;

/// Light by the sun and the sky at a place and a time.
struct Sunlight {
  double utc_s = 0.0;
  double latitude_deg = 0.0, longitude_deg = 0.0, height_m = 0.0;

  bool operator==(const Sunlight&) const = default;
  geometry::Geodetic place() const { return {latitude_deg, longitude_deg, {height_m}}; }
};

/// Light and weather of scene images at a time.
struct Outlook {
  double time_s = 0.0;                                    ///< of the simulation: where drops and flakes are
  std::optional<Sunlight> sunlight;                       ///< nullopt: the light of the textures
  std::shared_ptr<const render::WeatherOptions> weather;  ///< null: clear

  bool needs_same_renderer(const Outlook& other) const {
    return sunlight == other.sunlight && weather == other.weather;
  }
};

/// A self-contained view to render, independent of the simulator's state.
struct CameraView {
  imaging::Camera lens;
  geometry::SE3 T_local_camera;                          ///< camera axes of images: x right, y down, z forward
  std::optional<geometry::SE3> T_local_previous;         ///< camera pose of the previous image, for optical flow
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();  ///< local frame
  geometry::Vec3 angular_velocity_rad_s = geometry::Vec3::Zero();  ///< local frame
  /// For each spawned object: maps a point's present position to its previous one, local frame.
  std::vector<Eigen::Affine3d> moved{};
};

/// Results for the pixels' central rays; layers that were not requested are empty.
struct RenderLayers {
  imaging::RgbImage rgb;
  imaging::FloatImage depth_m;                         ///< along the axis; kSkyDistance_m without a surface
  imaging::FloatImage range_m;                         ///< along the ray
  imaging::Image<std::array<float, 3>> normals_local;  ///< unit length, of the visible side; zero without a surface
  imaging::Image<std::uint32_t> objects;               ///< 1 + index into ResidentScene::objects(); 0 without an object
  imaging::Image<std::array<float, 2>> flow_px;        ///< from the previous image; zero if there is none
};

/// The layers from which an image of a type is computed.
struct LayerSelection {
  bool rgb = false, depth = false, range = false, normals = false, objects = false, flow = false;

  void add(ImageType type);
  bool geometry() const { return depth || range || normals || objects || flow; }
};

/// Renders images and caches renderers between them. Thread-safe; several images may be rendered at once.
class ImageRenderer {
 public:
  /// Renders the requested layers; rays are cast once for all of them.
  /// `outlook`: light and weather of the colours; geometric layers do not depend on it.
  RenderLayers render(const std::shared_ptr<const ResidentScene>& place, const CameraView& shot,
                      const LayerSelection& selection, const Outlook& outlook = {});
  /// Returns a renderer for a lens, in any light or in that of `outlook`.
  std::shared_ptr<const render::CameraRenderer> camera_renderer(const std::shared_ptr<const ResidentScene>& place,
                                                                const imaging::Camera& lens,
                                                                const Outlook* outlook = nullptr);

 private:
  struct CachedRenderer {
    std::vector<double> lens;  ///< lens_key()
    std::shared_ptr<const render::CameraRays> rays;
    double pixels = 0.0;
    Outlook outlook;                             ///< compared without its time
    std::shared_ptr<const ResidentScene> place;  ///< null, like the renderer, once the place has changed
    std::shared_ptr<const render::CameraRenderer> renderer;
  };

  std::shared_ptr<const render::Daylight> daylight(const Sunlight& sunlight);
  imaging::RgbImage render_colours(const render::CameraRenderer& renderer, const CameraView& shot, double time_s,
                                   const render::SurfaceVisitor& visitor);

  std::mutex mutex_;
  std::optional<Sunlight> lit_for_;
  std::shared_ptr<const render::Daylight> daylight_;  ///< of lit_for_
  std::list<CachedRenderer> cache_;                   ///< one for each lens, most recently used first
};

/// All parameters of a lens: equal lenses have equal keys.
std::vector<double> lens_key(const imaging::Camera& lens);

/// The labels that an image shows, by the values of RenderLayers::objects; index 0 is "no object".
struct ObjectLabels {
  std::vector<int> ids;                   ///< segmentation ids
  std::vector<imaging::Rgb8> annotation;  ///< of the annotation layer asked for; empty: none was

  static ObjectLabels of(const ResidentScene& place, const simulator::SegmentationIds& ids);
};

/// Converts to one number per pixel, top row first (AirSim's red channel).
std::vector<float> to_float_pixels(ImageType type, const RenderLayers& layers, const imaging::Camera& lens,
                                   const ObjectLabels& labels);
/// Converts to colours.
imaging::RgbImage to_colour_pixels(ImageType type, const RenderLayers& layers, const imaging::Camera& lens,
                                   const ObjectLabels& labels);

}  // namespace tileflight::simulator
