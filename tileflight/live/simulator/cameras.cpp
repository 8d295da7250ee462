#include "tileflight/live/simulator/cameras.h"

#include <algorithm>
#include <set>
#include <sstream>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/settings.h"
#include "tileflight/live/simulator/world.h"
#include "tileflight/tiles/tileset/view_criteria.h"

namespace tileflight::simulator {
namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr std::size_t kMaxRequests = 256;
constexpr double kMaxPixels = 64e6;  // per call
constexpr double kFilm_mm = 36.0;    // width of every camera's film

ImageType to_image_type(int image_type) {
  if (image_type < 0 || image_type >= kImageTypeCount)
    throw InputError("image type " + std::to_string(image_type), "is unknown; use 0 (Scene) to 11 (Annotation)");
  return static_cast<ImageType>(image_type);
}

/// Makes a key that is equal for images that are rendered from the same rays.
std::vector<double> make_render_key(const CameraView& shot, const std::string& camera) {
  std::vector<double> key = lens_key(shot.lens);
  const SE3& T = shot.T_local_camera;
  key.insert(key.end(), T.translation.data(), T.translation.data() + 3);
  key.insert(key.end(), T.rotation.coeffs().data(), T.rotation.coeffs().data() + 4);
  for (const char c : camera) key.push_back(c);  // optical flow differs between cameras
  return key;
}

std::vector<std::uint8_t> bgr_bytes(const imaging::RgbImage& image) {
  std::vector<std::uint8_t> bytes(image.pixels.size() * 3);
  std::uint8_t* to = bytes.data();
  for (const imaging::Rgb8& p : image.pixels) {
    *to++ = p[2];
    *to++ = p[1];
    *to++ = p[0];
  }
  return bytes;
}

ImageResponse make_response(const PlannedImage& picture, const RenderLayers& layers, const ObjectLabels& labels) {
  ImageResponse response;
  response.camera_name = picture.request.camera_name;
  response.camera_position = picture.pose.position;
  response.camera_orientation = picture.pose.orientation;
  response.pixels_as_float = picture.request.pixels_as_float;
  response.compress = picture.request.compress;
  response.width = picture.view.lens.width();
  response.height = picture.view.lens.height();
  response.image_type = picture.request.image_type;
  if (response.pixels_as_float) {
    response.image_data_float = to_float_pixels(picture.type, layers, picture.view.lens, labels);
    return response;
  }
  const imaging::RgbImage image = to_colour_pixels(picture.type, layers, picture.view.lens, labels);
  response.image_data_uint8 = response.compress ? imaging::encode_png_rgba(image) : bgr_bytes(image);
  return response;
}

/// Computes for each object the transform from a point's present position to that at the previous image, local frame.
/// It is the identity for objects that did not exist then.
std::vector<Eigen::Affine3d> moved_since(const std::vector<WorldObject>& before, const std::vector<WorldObject>& now,
                                         const SE3& T_local_ned) {
  std::vector<Eigen::Affine3d> moved(now.size(), Eigen::Affine3d::Identity());
  for (std::size_t i = 0; i < now.size(); ++i) {
    const auto old = std::ranges::find(before, now[i].name, &WorldObject::name);
    if (old != before.end()) moved[i] = local_pose(*old, T_local_ned) * local_pose(now[i], T_local_ned).inverse();
  }
  return moved;
}

/// A camera moves as its vehicle does.
void add_motion(const VehicleState& state, const SE3& T_local_ned, CameraView& view) {
  view.velocity_m_s = T_local_ned.rotation * state.velocity_m_s;
  view.angular_velocity_rad_s = T_local_ned.rotation * (state.T_ned_body.rotation * state.angular_velocity_rad_s);
}

std::string missing_tiles_message(const ResidentScene& place) {
  if (place.loaded().tiles_failed == 0) return {};
  return std::to_string(place.loaded().tiles_failed) + " tiles could not be read: parts of the place may be missing";
}

}  // namespace

/// Requires the mutex.
PlannedImages World::plan_images(const std::vector<ImageRequest>& requests, const std::string& vehicle_name,
                                 bool external) {
  if (requests.size() > kMaxRequests) throw InputError("simGetImages", "more than 256 images in one call");
  PlannedImages planned;
  planned.time_ns = clock.time_ns();
  planned.viewpoints = viewpoints();
  planned.objects = world_objects.now();
  planned.outlook = outdoors.outlook(clock.time_s(), enu_from_ned(wind_ned_m_s));
  const Vec3 origin = ned_origin(vehicle_name, external);
  double pixels = 0.0;
  for (const ImageRequest& request : requests) {
    PlannedImage picture{request, to_image_type(request.image_type), {}, {}, {}};
    const SimCamera& taken = camera(request.camera_name, vehicle_name, external);
    const SE3 T_ned = T_ned_camera(taken, vehicle_name, external);
    picture.pose = to_airsim(SE3(T_ned.rotation, T_ned.translation - origin));
    picture.view.lens = taken.lens(request.image_type);
    picture.view.T_local_camera = T_local_ned * T_ned * T_frd_optical();
    if (!external) add_motion(slot(vehicle_name).vehicle->state(), T_local_ned, picture.view);
    const std::string owner = (external ? std::string("/") : slot(vehicle_name).vehicle->name() + "/") + taken.name();
    if (const auto last = last_pictures.find(owner); last != last_pictures.end()) {
      picture.view.T_local_previous = last->second.T_local_camera;
      picture.view.moved = moved_since(*last->second.objects, *planned.objects, T_local_ned);
    }
    planned.camera_poses.insert_or_assign(owner, picture.view.T_local_camera);
    picture.key = make_render_key(picture.view, owner);
    pixels += static_cast<double>(picture.view.lens.width()) * picture.view.lens.height();
    planned.images.push_back(std::move(picture));
  }
  if (pixels > kMaxPixels) throw InputError("simGetImages", "more than 64 million pixels in one call");
  return planned;
}

/// Returns the colours in an annotation layer, by the values of RenderLayers::objects.
std::vector<imaging::Rgb8> World::annotation_colours(const ResidentScene& place, const std::string& layer) const {
  std::vector<imaging::Rgb8> colours = annotation_layers.colours(layer, place.object_names());
  colours.insert(colours.begin(), imaging::Rgb8{});
  return colours;
}

/// Requires the mutex.
void World::remember_camera_poses(const PlannedImages& planned) {
  for (const auto& [owner, T_local_camera] : planned.camera_poses)
    last_pictures.insert_or_assign(owner, LatestPicture{T_local_camera, planned.objects});
}

/// Runs without the mutex. Images with the same rays are rendered once.
std::vector<ImageResponse> World::render_images(const PlannedImages& planned) {
  const auto start = std::chrono::steady_clock::now();
  const std::shared_ptr<const ResidentScene> place =
      world_objects.populate(working_set.load_for(planned.viewpoints), planned.objects, T_local_ned);
  ObjectLabels labels;
  std::vector<ImageResponse> responses(planned.images.size());
  std::vector<bool> done(planned.images.size(), false);
  for (std::size_t i = 0; i < planned.images.size(); ++i) {
    if (done[i]) continue;
    std::vector<std::size_t> together;
    LayerSelection selection;
    for (std::size_t k = i; k < planned.images.size(); ++k) {
      if (planned.images[k].key != planned.images[i].key) continue;
      together.push_back(k);
      selection.add(planned.images[k].type);
    }
    if (selection.objects && labels.ids.empty()) labels = ObjectLabels::of(*place, segmentation_ids);
    const RenderLayers layers = renderer.render(place, planned.images[i].view, selection, planned.outlook);
    for (const std::size_t k : together) {
      if (planned.images[k].type == ImageType::kAnnotation)
        labels.annotation = annotation_colours(*place, planned.images[k].request.annotation_name);
      responses[k] = make_response(planned.images[k], layers, labels);
      responses[k].time_stamp = planned.time_ns;
      responses[k].message = missing_tiles_message(*place);
      done[k] = true;
    }
  }
  images += responses.size();
  const double seconds = base::seconds_since(start);
  last_image_seconds = seconds;
  image_seconds += seconds;
  return responses;
}

/// Runs without the mutex.
imaging::RgbImage World::render_colours(const PlannedImages& planned) {
  const std::shared_ptr<const ResidentScene> place =
      world_objects.populate(working_set.load_for(planned.viewpoints), planned.objects, T_local_ned);
  LayerSelection colours;
  colours.add(ImageType::kScene);
  return renderer.render(place, planned.images.front().view, colours, planned.outlook).rgb;
}

std::vector<ImageResponse> Cameras::get_images(const std::vector<ImageRequest>& requests, const std::string& vehicle,
                                               bool external) {
  PlannedImages planned;
  {
    const std::lock_guard lock(world_.state_mutex);
    planned = world_.plan_images(requests, vehicle, external);
    world_.remember_camera_poses(planned);
  }
  return world_.render_images(planned);
}

std::vector<std::uint8_t> Cameras::get_image(const std::string& camera, int image_type, const std::string& vehicle,
                                             bool external, const std::string& annotation_name) {
  const ImageRequest request{camera, image_type, false, true, annotation_name};
  return get_images({request}, vehicle, external).front().image_data_uint8;
}

CameraInfo Cameras::get_camera_info(const std::string& camera, const std::string& vehicle, bool external) const {
  const std::lock_guard lock(world_.state_mutex);
  const SimCamera& chosen = world_.camera(camera, vehicle, external);
  SE3 T = world_.T_ned_camera(chosen, vehicle, external);
  T.translation -= world_.ned_origin(vehicle, external);
  return chosen.info(T);
}

float Cameras::get_focal_length(const std::string& camera, const std::string& vehicle, bool external) const {
  const std::lock_guard lock(world_.state_mutex);
  const SimCamera& chosen = world_.camera(camera, vehicle, external);
  return static_cast<float>(chosen.focal_px() * kFilm_mm / chosen.width(0));
}

std::string Cameras::get_filmback_settings(const std::string& camera, const std::string& vehicle, bool external) const {
  const std::lock_guard lock(world_.state_mutex);
  const imaging::Camera lens = world_.camera(camera, vehicle, external).lens(0);
  const double aspect = static_cast<double>(lens.width()) / lens.height();
  std::ostringstream text;  // AirSim's words, which clients take apart
  text << "Name: Custom;\n\t Sensor Width: " << kFilm_mm << "; \t Sensor Height: " << kFilm_mm / aspect
       << "\n\t Sensor Aspect Ratio: " << aspect;
  return text.str();
}

std::string Cameras::get_current_field_of_view(const std::string& camera, const std::string& vehicle,
                                               bool external) const {
  const std::lock_guard lock(world_.state_mutex);
  const SimCamera& chosen = world_.camera(camera, vehicle, external);
  std::ostringstream text;  // AirSim's words, which clients take apart
  text << "Current Field Of View:\n\tHorizontal Field Of View: " << chosen.lens(0).horizontal_fov_deg()
       << ";\n\t Vertical Field Of View: " << chosen.vertical_fov_deg();
  return text.str();
}

void Cameras::set_camera_pose(const std::string& camera, const Pose& pose, const std::string& vehicle, bool external) {
  const std::lock_guard lock(world_.state_mutex);
  SimCamera& chosen = world_.camera(camera, vehicle, external);
  chosen.set_pose(merge_pose(pose, chosen.T_body_camera(), "simSetCameraPose"));
}

void Cameras::set_camera_fov(const std::string& camera, float fov_degrees, const std::string& vehicle, bool external) {
  const std::lock_guard lock(world_.state_mutex);
  world_.camera(camera, vehicle, external).set_fov(fov_degrees);
}

std::vector<float> Cameras::get_distortion_params(const std::string& camera, const std::string& vehicle,
                                                  bool external) const {
  const std::lock_guard lock(world_.state_mutex);
  const auto& k = world_.camera(camera, vehicle, external).distortion();
  return {k.begin(), k.end()};
}

void Cameras::set_distortion_param(const std::string& camera, const std::string& name, float value,
                                   const std::string& vehicle, bool external) {
  const std::lock_guard lock(world_.state_mutex);
  world_.camera(camera, vehicle, external).set_distortion(name, value);
}

void Cameras::set_lens(const std::string& camera, const LensDescription& lens, const std::string& vehicle,
                       bool external) {
  const std::lock_guard lock(world_.state_mutex);
  world_.camera(camera, vehicle, external).set_lens(lens);
}

/// The error of each pixel is the geometric error of its tile at its distance from the camera.
Coverage Cameras::coverage(const std::string& camera, const std::string& vehicle, bool external) {
  PlannedImages planned;
  {
    const std::lock_guard lock(world_.state_mutex);
    planned = world_.plan_images({{camera, 0, false, false}}, vehicle, external);
  }
  const auto place = world_.place_for(planned.viewpoints);
  const CameraView& shot = planned.images.front().view;
  const double pixels_per_rad = tileset::view_cone_of(shot.lens).pixels_per_rad;
  imaging::FloatImage error_px(shot.lens.width(), shot.lens.height(), -1.0F);
  imaging::Image<std::uint32_t> tile(shot.lens.width(), shot.lens.height());
  world_.renderer.camera_renderer(place, shot.lens)
      ->visit_surface(std::span(&shot.T_local_camera, 1), [&](const render::SurfacePoint& point) {
        if (!point.hit) return;
        const double error_m = place->geometric_error_m(point.mesh);
        error_px(point.x, point.y) = static_cast<float>(error_m * pixels_per_rad / std::max(1e-3F, point.distance_m));
        tile(point.x, point.y) = place->tile_of_mesh(point.mesh);
      });
  Coverage coverage{.camera_name = camera,
                    .error_wanted = static_cast<float>(world_.working_set.error_px()),
                    .loaded = place->loaded()};
  std::set<std::uint32_t> seen;
  double sum = 0.0;
  std::size_t surface = 0;
  for (std::size_t i = 0; i < error_px.pixels.size(); ++i) {
    if (error_px.pixels[i] < 0.0F) continue;
    ++surface;
    sum += error_px.pixels[i];
    coverage.error_max = std::max(coverage.error_max, error_px.pixels[i]);
    seen.insert(tile.pixels[i]);
  }
  coverage.complete = coverage.loaded.complete;
  coverage.surface_share = static_cast<float>(surface) / static_cast<float>(error_px.pixels.size());
  coverage.error_mean = surface > 0 ? static_cast<float>(sum / static_cast<double>(surface)) : 0.0F;
  coverage.tiles_seen = static_cast<int>(seen.size());
  return coverage;
}

}  // namespace tileflight::simulator
