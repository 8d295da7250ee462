#include "tileflight/live/simulator/detections.h"

#include <algorithm>
#include <cctype>
#include <memory>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/object_names.h"
#include "tileflight/live/simulator/world.h"

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
  std::vector<std::unique_ptr<NamePattern>> patterns;
  for (const std::string& name : filter.names)
    patterns.push_back(std::make_unique<NamePattern>(wildcards_to_regex(name), NamePattern::Case::kIgnored));
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

namespace {

using geometry::SE3;

constexpr std::size_t kMaxNames = 1000;  // per filter
constexpr double kMaxRadius_m = 1e7;
constexpr double kCentimetre_m = 0.01;

DetectionInfo make_detection_info(const DetectedObject& seen, const ResidentScene& place, const GeodeticFrame& earth,
                                  const SE3& T_local_ned, const SE3& T_camera_local) {
  const Vec3 middle = place.object_bounds()[seen.object].center();
  DetectionInfo info;
  info.name = place.object_names()[seen.object];
  info.geo_point = earth.to_geo_point(T_local_ned.inverse() * middle);
  info.box2D.min = {static_cast<float>(seen.left), static_cast<float>(seen.top)};
  info.box2D.max = {static_cast<float>(seen.right), static_cast<float>(seen.bottom)};
  info.box3D.min = to_airsim(Vec3(seen.bounds_camera.min()));
  info.box3D.max = to_airsim(Vec3(seen.bounds_camera.max()));
  // Tiles' objects have no axes of their own: NED's are used.
  const SE3 T_local_object(T_local_ned.rotation, middle);
  info.relative_pose = to_airsim(T_camera_local * T_local_object);
  if (seen.object < place.first_placed_object()) return info;
  const Eigen::Affine3d pose = place.scene().placed_pose(seen.object - place.first_placed_object(), 0.0);
  const SE3 T_local_part(geometry::Mat3(pose.rotation()), pose.translation());
  SE3 T_camera_object = T_camera_local * T_local_part * T_flu_frd().inverse();
  if (T_camera_object.rotation.w() < 0.0) T_camera_object.rotation.coeffs() *= -1.0;  // the same rotation
  info.relative_pose = to_airsim(T_camera_object);
  return info;
}

}  // namespace

/// Requires the mutex. Throws InputError for an unknown camera or image type.
DetectionFilter& World::detection_filter(const std::string& camera_name, int image_type,
                                         const std::string& vehicle_name, bool external) {
  if (image_type < 0 || image_type >= kImageTypeCount)
    throw InputError("image type " + std::to_string(image_type), "is unknown; use 0 (Scene) to 11 (Annotation)");
  const SimCamera& chosen = camera(camera_name, vehicle_name, external);
  const std::string owner = external ? std::string() : slot(vehicle_name).vehicle->name();
  return detection_filters[owner + "/" + chosen.name() + "/" + std::to_string(image_type)];
}

void Detections::add_detection_filter_mesh_name(const std::string& camera, int image_type, const std::string& mesh_name,
                                                const std::string& vehicle, bool external) {
  const NamePattern readable(wildcards_to_regex(mesh_name), NamePattern::Case::kIgnored);
  const std::lock_guard lock(world_.state_mutex);
  DetectionFilter& filter = world_.detection_filter(camera, image_type, vehicle, external);
  if (filter.names.size() >= kMaxNames)
    throw InputError("simAddDetectionFilterMeshName",
                     "more than 1000 names; remove them with simClearDetectionMeshNames");
  filter.names.push_back(mesh_name);
}

void Detections::set_detection_filter_radius(const std::string& camera, int image_type, float radius_cm,
                                             const std::string& vehicle, bool external) {
  const double radius_m = kCentimetre_m * static_cast<double>(radius_cm);
  if (!(radius_m >= 0.0 && radius_m <= kMaxRadius_m))
    throw InputError("simSetDetectionFilterRadius", "the radius must be from 0 to 1e9 centimetres");
  const std::lock_guard lock(world_.state_mutex);
  world_.detection_filter(camera, image_type, vehicle, external).radius_m = radius_m;
}

void Detections::clear_detection_mesh_names(const std::string& camera, int image_type, const std::string& vehicle,
                                            bool external) {
  const std::lock_guard lock(world_.state_mutex);
  world_.detection_filter(camera, image_type, vehicle, external).names.clear();
}

std::vector<DetectionInfo> Detections::get_detections(const std::string& camera, int image_type,
                                                      const std::string& vehicle, bool external) {
  PlannedImages planned;
  DetectionFilter filter;
  {
    const std::lock_guard lock(world_.state_mutex);
    filter = world_.detection_filter(camera, image_type, vehicle, external);
    planned = world_.plan_images({{camera, image_type, false, false}}, vehicle, external);
  }
  if (filter.names.empty()) return {};
  const auto place = world_.world_objects.populate(world_.working_set.load_for(planned.viewpoints), planned.objects,
                                                   world_.T_local_ned);
  if (!place->has_surface()) return {};
  const CameraView& shot = planned.images.front().view;
  const RenderLayers layers = world_.renderer.render(place, shot, {.objects = true});
  const SE3 T_camera_local = (shot.T_local_camera * T_frd_optical().inverse()).inverse();
  std::vector<DetectionInfo> detections;
  for (const DetectedObject& seen : detect_objects(*place, layers.objects, T_camera_local, filter))
    detections.push_back(make_detection_info(seen, *place, world_.geodetic_frame, world_.T_local_ned, T_camera_local));
  return detections;
}

}  // namespace tileflight::simulator
