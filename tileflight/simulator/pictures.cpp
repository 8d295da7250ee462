#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "tileflight/geometry/input_error.h"
#include "tileflight/simulator/camera_settings.h"
#include "tileflight/simulator/frames.h"
#include "tileflight/simulator/png_rgba.h"
#include "tileflight/simulator/simulator_impl.h"

namespace tileflight::simulator {
namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr std::size_t kMostRequests = 256;
constexpr double kMostPixels = 64e6;  // of one call

ImageType checked_type(int image_type) {
  if (image_type < 0 || image_type >= kImageTypes)
    throw InputError("image type " + std::to_string(image_type), "is not known: 0 (Scene) to 9 (OpticalFlowVis)");
  return static_cast<ImageType>(image_type);
}

/// Equal for pictures that the same rays make.
std::vector<double> key_of(const Shot& shot, const std::string& camera) {
  std::vector<double> key = lens_key(shot.lens);
  const SE3& T = shot.T_local_camera;
  key.insert(key.end(), T.translation.data(), T.translation.data() + 3);
  key.insert(key.end(), T.rotation.coeffs().data(), T.rotation.coeffs().data() + 4);
  for (const char c : camera) key.push_back(c);  // the flow is each camera's own
  return key;
}

std::vector<std::uint8_t> bgr_bytes(const imaging::RgbImage& image) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(image.pixels.size() * 3);
  for (const imaging::Rgb8& p : image.pixels) bytes.insert(bytes.end(), {p[2], p[1], p[0]});
  return bytes;
}

ImageResponse response_of(const PlannedPicture& picture, const Layers& layers, const std::vector<int>& ids) {
  ImageResponse response;
  response.camera_name = picture.request.camera_name;
  response.camera_position = picture.pose.position;
  response.camera_orientation = picture.pose.orientation;
  response.pixels_as_float = picture.request.pixels_as_float;
  response.compress = picture.request.compress;
  response.width = picture.shot.lens.width();
  response.height = picture.shot.lens.height();
  response.image_type = picture.request.image_type;
  if (response.pixels_as_float) {
    response.image_data_float = float_pixels(picture.type, layers, picture.shot.lens, ids);
    return response;
  }
  const imaging::RgbImage image = colour_pixels(picture.type, layers, picture.shot.lens, ids);
  response.image_data_uint8 = response.compress ? png_rgba(image) : bgr_bytes(image);
  return response;
}

std::string message_of(const Place& place) {
  if (place.loaded().tiles_failed == 0) return {};
  return std::to_string(place.loaded().tiles_failed) + " tiles could not be read: parts of the place may be missing";
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

/// With the mutex held.
PlannedPictures Simulator::Impl::plan(const std::vector<ImageRequest>& requests, const std::string& vehicle_name,
                                      bool external) const {
  if (requests.size() > kMostRequests) throw InputError("simGetImages", "more than 256 pictures in a call");
  PlannedPictures planned;
  planned.time_ns = engine.time_ns();
  planned.looks = looks();
  const Vec3 origin = origin_of(vehicle_name, external);
  double pixels = 0.0;
  for (const ImageRequest& request : requests) {
    PlannedPicture picture{request, checked_type(request.image_type), {}, {}, {}};
    const SimCamera& taken = camera(request.camera_name, vehicle_name, external);
    const SE3 T_ned = T_ned_camera(taken, vehicle_name, external);
    picture.pose = wire(SE3(T_ned.rotation, T_ned.translation - origin));
    picture.shot.lens = taken.lens(request.image_type);
    picture.shot.T_local_camera = T_local_ned * T_ned * T_frd_optical();
    const std::string owner = (external ? std::string("/") : vehicle(vehicle_name).craft->name() + "/") + taken.name();
    if (const auto last = last_pictures.find(owner); last != last_pictures.end())
      picture.shot.T_local_before = last->second;
    planned.cameras.insert_or_assign(owner, picture.shot.T_local_camera);
    picture.key = key_of(picture.shot, owner);
    pixels += static_cast<double>(picture.shot.lens.width()) * picture.shot.lens.height();
    planned.pictures.push_back(std::move(picture));
  }
  if (pixels > kMostPixels) throw InputError("simGetImages", "more than 64 million pixels in a call");
  return planned;
}

/// With the mutex held.
void Simulator::Impl::note_taken(const PlannedPictures& planned) {
  for (const auto& [owner, T_local_camera] : planned.cameras) last_pictures.insert_or_assign(owner, T_local_camera);
}

/// Without the mutex. What the same rays show is rendered once.
std::vector<ImageResponse> Simulator::Impl::take(const PlannedPictures& planned) {
  const auto start = std::chrono::steady_clock::now();
  const std::shared_ptr<const Place> place = world.for_looks(planned.looks);
  std::vector<int> object_ids;
  std::vector<ImageResponse> responses(planned.pictures.size());
  std::vector<bool> done(planned.pictures.size(), false);
  for (std::size_t i = 0; i < planned.pictures.size(); ++i) {
    if (done[i]) continue;
    std::vector<std::size_t> together;
    WantedLayers wanted;
    for (std::size_t k = i; k < planned.pictures.size(); ++k) {
      if (planned.pictures[k].key != planned.pictures[i].key) continue;
      together.push_back(k);
      wanted.add(planned.pictures[k].type);
    }
    if (wanted.objects && object_ids.empty()) object_ids = ids_of(*place, ids);
    const Layers layers = renderer.render(place, planned.pictures[i].shot, wanted);
    for (const std::size_t k : together) {
      responses[k] = response_of(planned.pictures[k], layers, object_ids);
      responses[k].time_stamp = planned.time_ns;
      responses[k].message = message_of(*place);
      done[k] = true;
    }
  }
  images += responses.size();
  const double seconds = seconds_since(start);
  last_image_seconds = seconds;
  image_seconds += seconds;
  return responses;
}

std::vector<ImageResponse> Simulator::sim_get_images(const std::vector<ImageRequest>& requests,
                                                     const std::string& vehicle, bool external) {
  PlannedPictures planned;
  {
    const std::lock_guard lock(impl_->state);
    planned = impl_->plan(requests, vehicle, external);
    impl_->note_taken(planned);
  }
  return impl_->take(planned);
}

std::vector<std::uint8_t> Simulator::sim_get_image(const std::string& camera, int image_type,
                                                   const std::string& vehicle, bool external) {
  return sim_get_images({{camera, image_type, false, true}}, vehicle, external).front().image_data_uint8;
}

/// A vehicle that flies is put there, too, and stays until its next command.
void Simulator::sim_set_vehicle_pose(const Pose& pose, bool ignore_collision, const std::string& vehicle) {
  const std::lock_guard lock(impl_->state);
  Craft& craft = *impl_->vehicle(vehicle).craft;
  const SE3& before = craft.state().T_ned_body;
  const SE3 own(before.rotation, before.translation - craft.start_ned());
  SE3 wanted = merged_pose(pose, own, "simSetVehiclePose");
  wanted.translation += craft.start_ned();
  if (ignore_collision) {
    craft.place({wanted});
  } else {
    craft.sweep_to(wanted, impl_->engine.time_s());
  }
  impl_->engine.wake();
}

Pose Simulator::sim_get_vehicle_pose(const std::string& vehicle) const {
  const std::lock_guard lock(impl_->state);
  const Craft& craft = *impl_->vehicle(vehicle).craft;
  const SE3& T = craft.state().T_ned_body;
  return wire(SE3(T.rotation, T.translation - craft.start_ned()));
}

CameraInfo Simulator::sim_get_camera_info(const std::string& camera, const std::string& vehicle, bool external) const {
  const std::lock_guard lock(impl_->state);
  const SimCamera& wanted = impl_->camera(camera, vehicle, external);
  SE3 T = impl_->T_ned_camera(wanted, vehicle, external);
  T.translation -= impl_->origin_of(vehicle, external);
  return wanted.info(T);
}

void Simulator::sim_set_camera_pose(const std::string& camera, const Pose& pose, const std::string& vehicle,
                                    bool external) {
  const std::lock_guard lock(impl_->state);
  SimCamera& wanted = impl_->camera(camera, vehicle, external);
  wanted.set_pose(merged_pose(pose, wanted.T_body_camera(), "simSetCameraPose"));
}

void Simulator::sim_set_camera_fov(const std::string& camera, float fov_degrees, const std::string& vehicle,
                                   bool external) {
  const std::lock_guard lock(impl_->state);
  impl_->camera(camera, vehicle, external).set_fov(fov_degrees);
}

std::vector<float> Simulator::sim_get_distortion_params(const std::string& camera, const std::string& vehicle,
                                                        bool external) const {
  const std::lock_guard lock(impl_->state);
  const auto& k = impl_->camera(camera, vehicle, external).distortion();
  return {k.begin(), k.end()};
}

void Simulator::sim_set_distortion_param(const std::string& camera, const std::string& name, float value,
                                         const std::string& vehicle, bool external) {
  const std::lock_guard lock(impl_->state);
  impl_->camera(camera, vehicle, external).set_distortion(name, value);
}

void Simulator::tf_set_lens(const std::string& camera, const LensDescription& lens, const std::string& vehicle,
                            bool external) {
  const std::lock_guard lock(impl_->state);
  impl_->camera(camera, vehicle, external).set_lens(lens);
}

}  // namespace tileflight::simulator
