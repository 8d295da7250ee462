#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>

#include "tileflight/imaging/image.h"
#include "tileflight/sensors/render.h"
#include "tileflight/sensors/scene_objects.h"

namespace tileflight::sensors {

/// What a frame gives beside its picture and depth.
struct FrameOutputs {
  bool range = false;
  bool normals = false;
  bool objects = false;
  bool flow = false;
  bool visibility = false;

  bool any() const { return range || normals || objects || flow || visibility; }
};

/// Of the ray through each pixel's centre, at the middle of the exposure, each row at its own time. Not asked for:
/// empty.
struct OutputImages {
  imaging::FloatImage range_m;  ///< along the ray; +infinity where nothing is hit, NaN outside the lens's valid cone
  imaging::Image<std::array<float, 3>> normals;  ///< unit, camera frame (of the row's pose), of the side that is seen;
                                                 ///< NaN where nothing is hit
  imaging::Image<std::uint32_t> objects;         ///< 1 + index into SceneObjects::all(); 0 where nothing is hit
  /// To the next frame: pixels right and down. NaN where nothing is hit and where the surface leaves the image or the
  /// lens's valid cone; also given where something hides it there. Empty for the last frame.
  imaging::Image<std::array<float, 2>> flow_px;
  imaging::GrayImage visibility;  ///< 255 where a surface is seen that lies in the place that counts, else 0
};

/// Whether a point of the local frame belongs to the place that is scored. Asked from several threads at once.
using PlaceTest = std::function<bool(const geometry::Vec3& point)>;

/// Where a point of the local frame is seen by a frame whose rows may each have their own pose (one pose, or one a
/// row): the pixel p for which the pose of row p.y projects the point to p. Between rows the projection is taken to be
/// linear, which it is to well below a thousandth of a pixel. nullopt where it is not within the image (up to half a
/// pixel beyond the outer pixels' centres) or the lens's valid cone.
std::optional<geometry::Vec2> project_by_rows(const imaging::Camera& camera,
                                              std::span<const geometry::SE3> T_local_camera_of_row,
                                              const geometry::Vec3& point);

/// Makes the outputs of one frame after another; several threads may each make one. Renderer and scene must outlive it.
class OutputRenderer {
 public:
  /// `place` is for visibility alone; without it, everything counts.
  OutputRenderer(const CameraRenderer& renderer, const scene::Scene& scene, const FrameOutputs& outputs,
                 PlaceTest place = {});

  /// The objects that images name; empty where they are not asked for.
  std::span<const SceneObject> objects() const;
  /// `T_local_camera_of_row`: one pose, or one a row; `next`: the same of the next frame, empty for the last one.
  OutputImages render(std::span<const geometry::SE3> T_local_camera_of_row, std::span<const geometry::SE3> next) const;

 private:
  const CameraRenderer& renderer_;
  FrameOutputs outputs_;
  PlaceTest place_;
  std::optional<SceneObjects> objects_;
};

}  // namespace tileflight::sensors
