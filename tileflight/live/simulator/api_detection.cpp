
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/object_names.h"
#include "tileflight/live/simulator/simulator_impl.h"

namespace tileflight::simulator {
namespace {

using geometry::SE3;
using geometry::Vec3;

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
DetectionFilter& Simulator::Impl::detection_filter(const std::string& camera_name, int image_type,
                                                   const std::string& vehicle_name, bool external) {
  if (image_type < 0 || image_type >= kImageTypeCount)
    throw InputError("image type " + std::to_string(image_type), "is unknown; use 0 (Scene) to 11 (Annotation)");
  const SimCamera& chosen = camera(camera_name, vehicle_name, external);
  const std::string owner = external ? std::string() : slot(vehicle_name).vehicle->name();
  return detection_filters[owner + "/" + chosen.name() + "/" + std::to_string(image_type)];
}

void Simulator::sim_add_detection_filter_mesh_name(const std::string& camera, int image_type,
                                                   const std::string& mesh_name, const std::string& vehicle,
                                                   bool external) {
  const simulator::NamePattern readable(wildcards_to_regex(mesh_name), simulator::NamePattern::Case::kIgnored);
  const std::lock_guard lock(impl_->state_mutex);
  DetectionFilter& filter = impl_->detection_filter(camera, image_type, vehicle, external);
  if (filter.names.size() >= kMaxNames)
    throw InputError("simAddDetectionFilterMeshName",
                     "more than 1000 names; remove them with simClearDetectionMeshNames");
  filter.names.push_back(mesh_name);
}

void Simulator::sim_set_detection_filter_radius(const std::string& camera, int image_type, float radius_cm,
                                                const std::string& vehicle, bool external) {
  const double radius_m = kCentimetre_m * static_cast<double>(radius_cm);
  if (!(radius_m >= 0.0 && radius_m <= kMaxRadius_m))
    throw InputError("simSetDetectionFilterRadius", "the radius must be from 0 to 1e9 centimetres");
  const std::lock_guard lock(impl_->state_mutex);
  impl_->detection_filter(camera, image_type, vehicle, external).radius_m = radius_m;
}

void Simulator::sim_clear_detection_mesh_names(const std::string& camera, int image_type, const std::string& vehicle,
                                               bool external) {
  const std::lock_guard lock(impl_->state_mutex);
  impl_->detection_filter(camera, image_type, vehicle, external).names.clear();
}

std::vector<DetectionInfo> Simulator::sim_get_detections(const std::string& camera, int image_type,
                                                         const std::string& vehicle, bool external) {
  PlannedImages planned;
  DetectionFilter filter;
  {
    const std::lock_guard lock(impl_->state_mutex);
    filter = impl_->detection_filter(camera, image_type, vehicle, external);
    planned = impl_->plan_images({{camera, image_type, false, false}}, vehicle, external);
  }
  if (filter.names.empty()) return {};
  const auto place = impl_->world_objects.populate(impl_->working_set.load_for(planned.viewpoints), planned.objects,
                                                   impl_->T_local_ned);
  if (!place->has_surface()) return {};
  const CameraView& shot = planned.images.front().view;
  const RenderLayers layers = impl_->renderer.render(place, shot, {.objects = true});
  const SE3 T_camera_local = (shot.T_local_camera * T_frd_optical().inverse()).inverse();
  std::vector<DetectionInfo> detections;
  for (const DetectedObject& seen : detect_objects(*place, layers.objects, T_camera_local, filter))
    detections.push_back(make_detection_info(seen, *place, impl_->geodetic_frame, impl_->T_local_ned, T_camera_local));
  return detections;
}

}  // namespace tileflight::simulator
