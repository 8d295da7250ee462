#include <cmath>

#include "tileflight/geometry/input_error.h"
#include "tileflight/simulator/frames.h"
#include "tileflight/simulator/name_pattern.h"
#include "tileflight/simulator/simulator_impl.h"

namespace tileflight::simulator {
namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr std::size_t kMostNames = 1000;  // of a filter
constexpr double kMostRadius_m = 1e7;
constexpr double kCentimetre_m = 0.01;

DetectionInfo info_of(const SeenObject& seen, const Place& place, const EarthFrame& earth, const SE3& T_local_ned,
                      const SE3& T_camera_local) {
  const Vec3 middle = place.object_bounds()[seen.object].center();
  DetectionInfo info;
  info.name = place.object_names()[seen.object];
  info.geo_point = earth.geo_point(T_local_ned.inverse() * middle);
  info.box2D.min = {static_cast<float>(seen.left), static_cast<float>(seen.top)};
  info.box2D.max = {static_cast<float>(seen.right), static_cast<float>(seen.bottom)};
  info.box3D.min = wire(Vec3(seen.bounds_camera.min()));
  info.box3D.max = wire(Vec3(seen.bounds_camera.max()));
  // Objects of tiles have no axes of their own: those of NED.
  const SE3 T_local_object(T_local_ned.rotation, middle);
  info.relative_pose = wire(T_camera_local * T_local_object);
  return info;
}

}  // namespace

/// With the mutex held. Throws InputError for a camera or a kind of picture that there is not.
DetectionFilter& Simulator::Impl::detection_filter(const std::string& camera_name, int image_type,
                                                   const std::string& vehicle_name, bool external) {
  if (image_type < 0 || image_type >= kImageTypes)
    throw InputError("image type " + std::to_string(image_type), "is not known: 0 (Scene) to 9 (OpticalFlowVis)");
  const SimCamera& wanted = camera(camera_name, vehicle_name, external);
  const std::string owner = external ? std::string() : vehicle(vehicle_name).craft->name();
  return detections[owner + "/" + wanted.name() + "/" + std::to_string(image_type)];
}

void Simulator::sim_add_detection_filter_mesh_name(const std::string& camera, int image_type,
                                                   const std::string& mesh_name, const std::string& vehicle,
                                                   bool external) {
  const NamePattern readable(expression_of_wildcards(mesh_name), NamePattern::Case::kIgnored);
  const std::lock_guard lock(impl_->state);
  DetectionFilter& filter = impl_->detection_filter(camera, image_type, vehicle, external);
  if (filter.names.size() >= kMostNames)
    throw InputError("simAddDetectionFilterMeshName", "more than 1000 names; simClearDetectionMeshNames drops them");
  filter.names.push_back(mesh_name);
}

void Simulator::sim_set_detection_filter_radius(const std::string& camera, int image_type, float radius_cm,
                                                const std::string& vehicle, bool external) {
  const double radius_m = kCentimetre_m * static_cast<double>(radius_cm);
  if (!(radius_m >= 0.0 && radius_m <= kMostRadius_m))
    throw InputError("simSetDetectionFilterRadius", "the radius must be from 0 to 1e9 centimetres");
  const std::lock_guard lock(impl_->state);
  impl_->detection_filter(camera, image_type, vehicle, external).radius_m = radius_m;
}

void Simulator::sim_clear_detection_mesh_names(const std::string& camera, int image_type, const std::string& vehicle,
                                               bool external) {
  const std::lock_guard lock(impl_->state);
  impl_->detection_filter(camera, image_type, vehicle, external).names.clear();
}

std::vector<DetectionInfo> Simulator::sim_get_detections(const std::string& camera, int image_type,
                                                         const std::string& vehicle, bool external) {
  PlannedPictures planned;
  DetectionFilter filter;
  {
    const std::lock_guard lock(impl_->state);
    filter = impl_->detection_filter(camera, image_type, vehicle, external);
    planned = impl_->plan({{camera, image_type, false, false}}, vehicle, external);
  }
  if (filter.names.empty()) return {};
  const auto place = impl_->world.for_looks(planned.looks);
  if (!place->has_surface()) return {};
  const Shot& shot = planned.pictures.front().shot;
  const Layers layers = impl_->renderer.render(place, shot, {.objects = true});
  const SE3 T_camera_local = (shot.T_local_camera * T_frd_optical().inverse()).inverse();
  std::vector<DetectionInfo> detections;
  for (const SeenObject& seen : seen_objects(*place, layers.objects, T_camera_local, filter))
    detections.push_back(info_of(seen, *place, impl_->earth, impl_->T_local_ned, T_camera_local));
  return detections;
}

}  // namespace tileflight::simulator
