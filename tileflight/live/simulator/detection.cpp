#include "tileflight/live/simulator/detection.h"

#include <algorithm>
#include <cctype>
#include <memory>

#include "tileflight/live/simulator/object_names.h"

namespace tileflight::simulator {
namespace {

using geometry::Box3;
using geometry::Vec3;

/// Bounds of a box's eight transformed corners.
Box3 transform_box(const Box3& box, const geometry::SE3& T) {
  Box3 around;
  for (int i = 0; i < 8; ++i) around.extend(T * box.corner(static_cast<Box3::CornerType>(i)));
  return around;
}

/// Objects beside the tiles have a box of their own, which fits them however they are turned.
Box3 bounds_in_camera(const ResidentScene& place, std::uint32_t object, const geometry::SE3& T_camera_local) {
  if (object < place.first_placed_object()) return transform_box(place.object_bounds()[object], T_camera_local);
  const std::size_t placed = object - place.first_placed_object();
  Eigen::Affine3d pose = place.scene().placed_pose(placed, 0.0);
  pose = Eigen::Translation3d(T_camera_local.translation) * T_camera_local.rotation * pose;
  const Box3& own = place.scene().placed()[placed].part->bounds();
  Box3 around;
  for (int i = 0; i < 8; ++i) around.extend(Vec3(pose * own.corner(static_cast<Box3::CornerType>(i))));
  return around;
}

/// The bounding rectangle of each object in an image, by object index.
std::vector<DetectedObject> find_object_boxes(const imaging::Image<std::uint32_t>& objects, std::size_t count) {
  std::vector<DetectedObject> boxes(count);
  for (int y = 0; y < objects.height; ++y) {
    for (int x = 0; x < objects.width; ++x) {
      if (objects(x, y) == 0) continue;
      DetectedObject& seen = boxes[objects(x, y) - 1];
      const bool first = seen.right == 0;
      seen.left = first ? x : std::min(seen.left, x);
      seen.top = first ? y : seen.top;
      seen.right = std::max(seen.right, x + 1);
      seen.bottom = y + 1;
    }
  }
  return boxes;
}

}  // namespace

std::string wildcards_to_regex(const std::string& text) {
  std::string expression;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '*') {
      expression += ".*";
    } else if (c == '?') {
      expression += '.';
    } else {
      if (byte < 0x80 && std::isalnum(byte) == 0) expression += '\\';
      expression += c;
    }
  }
  return expression;
}

std::vector<DetectedObject> detect_objects(const ResidentScene& place, const imaging::Image<std::uint32_t>& objects,
                                           const geometry::SE3& T_camera_local, const DetectionFilter& filter) {
  std::vector<std::unique_ptr<simulator::NamePattern>> patterns;
  for (const std::string& name : filter.names)
    patterns.push_back(
        std::make_unique<simulator::NamePattern>(wildcards_to_regex(name), simulator::NamePattern::Case::kIgnored));
  std::vector<DetectedObject> seen = find_object_boxes(objects, place.object_names().size());
  for (std::uint32_t i = 0; i < seen.size(); ++i) seen[i].object = i;
  std::erase_if(seen, [&](const DetectedObject& one) {
    if (one.right == 0) return true;
    const Vec3 middle = T_camera_local * place.object_bounds()[one.object].center();
    if (middle.norm() > filter.radius_m) return true;
    const std::string& name = place.object_names()[one.object];
    return std::ranges::none_of(patterns, [&](const auto& pattern) { return pattern->matches(name); });
  });
  for (DetectedObject& one : seen) one.bounds_camera = bounds_in_camera(place, one.object, T_camera_local);
  return seen;
}

}  // namespace tileflight::simulator
