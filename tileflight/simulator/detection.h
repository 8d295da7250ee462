#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tileflight/imaging/image.h"
#include "tileflight/simulator/place.h"

namespace tileflight::simulator {

/// What a camera's detections are of.
struct DetectionFilter {
  std::vector<std::string> names;  ///< of objects, whatever their case; `*` stands for any text, `?` for a character
  double radius_m = 200.0;         ///< from the camera to the middle of an object; AirSim's
};

/// The regular expression (of NamePattern) of the whole names that a text with `*` and `?` means.
std::string expression_of_wildcards(const std::string& text);

/// An object in a picture.
struct SeenObject {
  std::uint32_t object = 0;      ///< index into Place::objects()
  int left = 0, top = 0;         ///< the first column and row that show it
  int right = 0, bottom = 0;     ///< one past the last
  geometry::Box3 bounds_camera;  ///< around its bounds, in the axes that clients have for a camera, metres
};

/// The objects that the picture shows and the filter lets through, in the place's order. `objects`: of the picture's
/// pixels, as Layers::objects. `T_camera_local`: into the axes that clients have for a camera.
std::vector<SeenObject> seen_objects(const Place& place, const imaging::Image<std::uint32_t>& objects,
                                     const geometry::SE3& T_camera_local, const DetectionFilter& filter);

}  // namespace tileflight::simulator
