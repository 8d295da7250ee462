#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/live/simulator/airsim_types.h"

namespace tileflight::simulator {

class ResidentScene;
struct World;

/// Selects the objects that a camera detects.
struct DetectionFilter {
  std::vector<std::string> names;  ///< of objects, case-insensitive; `*` matches any text, `?` one character
  double radius_m = 200.0;         ///< maximum distance from the camera to an object's centre; AirSim's default
};

/// Converts a wildcard text with `*` and `?` to a regular expression for whole names (NamePattern).
std::string wildcards_to_regex(const std::string& text);

/// An object detected in an image.
struct DetectedObject {
  std::uint32_t object = 0;      ///< index into ResidentScene::objects()
  int left = 0, top = 0;         ///< first column and row that show it
  int right = 0, bottom = 0;     ///< one past the last
  geometry::Box3 bounds_camera;  ///< the object's bounds in the client's camera axes, metres
};

/// Finds the objects that are visible in an image and pass the filter, in the order of the place. `objects`: object
/// index per pixel, as RenderLayers::objects. `T_camera_local`: transform into the client's camera axes.
std::vector<DetectedObject> detect_objects(const ResidentScene& place, const imaging::Image<std::uint32_t>& objects,
                                           const geometry::SE3& T_camera_local, const DetectionFilter& filter);

/// Detections: objects of the scene that a camera's image of a type shows and that its filter selects.
class Detections {
 public:
  explicit Detections(World& world) : world_(world) {}

  /// Adds names of objects to detect, with the wildcards `*` and `?`. Throws InputError for more than 1000.
  void add_detection_filter_mesh_name(const std::string& camera, int image_type, const std::string& mesh_name,
                                      const std::string& vehicle, bool external);
  /// Sets the greatest distance from the camera to an object's centre.
  void set_detection_filter_radius(const std::string& camera, int image_type, float radius_cm,
                                   const std::string& vehicle, bool external);
  /// Removes all names.
  void clear_detection_mesh_names(const std::string& camera, int image_type, const std::string& vehicle, bool external);
  /// Renders the image and returns the detected objects.
  std::vector<DetectionInfo> get_detections(const std::string& camera, int image_type, const std::string& vehicle,
                                            bool external);

 private:
  World& world_;
};

}  // namespace tileflight::simulator
