#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>

#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/scene_objects.h"
#include "tileflight/core/imaging/image.h"

namespace tileflight::render {

/// Optional outputs of a frame besides colour and depth.
struct OutputChannels {
  bool range = false;
  bool normals = false;
  bool objects = false;
  bool flow = false;
  bool visibility = false;
  /// The objects that are placed parts, and no others; alone, it costs only the pixels around these.
  bool placed_objects = false;

  bool any() const { return has_whole_images() || placed_objects; }
  bool has_whole_images() const { return range || normals || objects || flow || visibility; }
};

/// Values for the ray through each pixel's centre, at the middle of the exposure, each row at its own time. Outputs
/// that are not requested are empty.
struct OutputImages {
  imaging::FloatImage range_m;  ///< along the ray; +infinity where nothing is hit, NaN outside the lens's valid cone
  imaging::Image<std::array<float, 3>> normals;  ///< unit, in the row's camera frame, visible face; NaN: no hit
  imaging::Image<std::uint32_t> objects;         ///< 1 + index into SceneObjects::all(); 0 if nothing is hit
  /// Optical flow to the next frame: pixels right and down. NaN if nothing is hit or the point leaves the image or the
  /// lens's valid cone; not NaN if it is occluded there. Empty for the last frame.
  imaging::Image<std::array<float, 2>> flow_px;
  imaging::GrayImage visibility;  ///< 255 for visible surfaces inside the scored region, else 0
};

/// Tells whether a point of the local frame belongs to the scored region. Called from several threads at once.
using RegionPredicate = std::function<bool(const geometry::Vec3& point)>;

/// Projects a point of the local frame into a frame whose rows may have their own poses (one pose, or one per row):
/// finds the pixel p for which the pose of row p.y projects the point to p. Between rows the projection is interpolated
/// linearly (error well below a thousandth of a pixel). nullopt if p is outside the image (beyond half a pixel from the
/// outer pixels' centres) or the lens's valid cone.
std::optional<geometry::Vec2> project_by_rows(const imaging::Camera& camera,
                                              std::span<const geometry::SE3> T_local_camera_of_row,
                                              const geometry::Vec3& point);

/// A frame of a scene whose placed parts move, for OutputRenderer::render.
struct MovingFrame {
  const scene::Scene* scene = nullptr;      ///< at this frame
  std::span<const float> scene_times;       ///< of each row (or of the one pose)
  const scene::Scene* next = nullptr;       ///< at the next frame, with the same placed parts; null for the last one
  std::span<const float> next_scene_times;  ///< of its rows
};

/// Position of a point at the time of a row.
using PointOfRow = std::function<geometry::Vec3(int row)>;
/// Projects a moving point into a frame. It must move by far less than a row from one row to the next.
std::optional<geometry::Vec2> project_by_rows(const imaging::Camera& camera,
                                              std::span<const geometry::SE3> T_local_camera_of_row,
                                              const PointOfRow& point);

/// Casts the rays of a frame's pixels, once, and calls the visitor for them, unless it is empty: as
/// CameraRenderer::render does, whose picture is made on the way.
using SurfacePass = std::function<void(const SurfaceVisitor& visitor)>;

/// Renders the outputs of frames; several threads may each render one. Renderer and scene must outlive it.
class OutputRenderer {
 public:
  /// `place`: scored region, used for visibility only; empty: everything counts.
  OutputRenderer(const CameraRenderer& renderer, const scene::Scene& scene, const OutputChannels& outputs,
                 RegionPredicate place = {});

  /// Returns the objects that the object images index; empty if these are not requested.
  std::span<const SceneObject> objects() const;
  /// Renders the outputs of a frame. `T_local_camera_of_row`: one pose, or one per row; `next`: those of the next
  /// frame, empty for the last frame.
  OutputImages render(std::span<const geometry::SE3> T_local_camera_of_row, std::span<const geometry::SE3> next) const;
  /// Renders the outputs of a frame with placed parts that move, seen by `renderer`, which is in the scene of `moving`.
  /// The flow of a point of a placed part is to where that point is in the next frame. `pass` is called once, and casts
  /// the same rays.
  OutputImages render(const CameraRenderer& renderer, std::span<const geometry::SE3> T_local_camera_of_row,
                      std::span<const geometry::SE3> next, const MovingFrame& moving, const SurfacePass& pass) const;

 private:
  const CameraRenderer& renderer_;
  OutputChannels outputs_;
  RegionPredicate place_;
  std::optional<SceneObjects> objects_;
};

}  // namespace tileflight::render
