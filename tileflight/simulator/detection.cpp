#include "tileflight/simulator/detection.h"

#include <algorithm>
#include <cctype>
#include <memory>

#include "tileflight/simulator/name_pattern.h"

namespace tileflight::simulator {
namespace {

using geometry::Box3;
using geometry::Vec3;

/// Around a box's eight corners.
Box3 moved(const Box3& box, const geometry::SE3& T) {
  Box3 around;
  for (int i = 0; i < 8; ++i) around.extend(T * box.corner(static_cast<Box3::CornerType>(i)));
  return around;
}

/// Where each object of a picture is in it, by the object's number in the picture.
std::vector<SeenObject> boxes_of(const imaging::Image<std::uint32_t>& objects, std::size_t count) {
  std::vector<SeenObject> boxes(count);
  for (int y = 0; y < objects.height; ++y) {
    for (int x = 0; x < objects.width; ++x) {
      if (objects(x, y) == 0) continue;
      SeenObject& seen = boxes[objects(x, y) - 1];
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

std::string expression_of_wildcards(const std::string& text) {
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

std::vector<SeenObject> seen_objects(const Place& place, const imaging::Image<std::uint32_t>& objects,
                                     const geometry::SE3& T_camera_local, const DetectionFilter& filter) {
  std::vector<std::unique_ptr<NamePattern>> patterns;
  for (const std::string& name : filter.names)
    patterns.push_back(std::make_unique<NamePattern>(expression_of_wildcards(name), NamePattern::Case::kIgnored));
  std::vector<SeenObject> seen = boxes_of(objects, place.object_names().size());
  for (std::uint32_t i = 0; i < seen.size(); ++i) seen[i].object = i;
  std::erase_if(seen, [&](const SeenObject& one) {
    if (one.right == 0) return true;
    const Vec3 middle = T_camera_local * place.object_bounds()[one.object].center();
    if (middle.norm() > filter.radius_m) return true;
    const std::string& name = place.object_names()[one.object];
    return std::ranges::none_of(patterns, [&](const auto& pattern) { return pattern->matches(name); });
  });
  for (SeenObject& one : seen) one.bounds_camera = moved(place.object_bounds()[one.object], T_camera_local);
  return seen;
}

}  // namespace tileflight::simulator
