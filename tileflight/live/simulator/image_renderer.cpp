#include "tileflight/live/simulator/image_renderer.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <type_traits>
#include <variant>

#include "tileflight/capture/render/daylight.h"
#include "tileflight/capture/render/streaks.h"

namespace tileflight::simulator {
namespace {

using geometry::SE3;
using geometry::Vec3;
using imaging::Camera;
using imaging::Rgb8;

constexpr std::size_t kMaxRenderers = 24;
constexpr double kMaxCachedPixels = 48e6;  // 12 bytes per pixel
constexpr float kDepthVisRange_m = 100.0F;
constexpr double kFlowVisRange_px = 32.0;

/// Horizontal focal length, for disparity; for lenses without one, pixels per radian at the image centre.
double focal_px(const Camera& lens) {
  return std::visit([](const auto& model) { return model.fx; }, lens.model());
}

std::array<float, 3> facing_normal(const render::SurfacePoint& point, const Vec3& ray_local) {
  Vec3 normal(point.normal_local[0], point.normal_local[1], point.normal_local[2]);
  const double length = normal.norm();
  if (length <= 0.0) return {};
  normal *= (normal.dot(ray_local) > 0.0 ? -1.0 : 1.0) / length;
  return {static_cast<float>(normal.x()), static_cast<float>(normal.y()), static_cast<float>(normal.z())};
}

RenderLayers empty_layers(int width, int height, const LayerSelection& selection) {
  RenderLayers layers;
  if (selection.depth) layers.depth_m = {width, height, kSkyDistance_m};
  if (selection.range) layers.range_m = {width, height, kSkyDistance_m};
  if (selection.normals) layers.normals_local = {width, height};
  if (selection.objects) layers.objects = {width, height};
  if (selection.flow) layers.flow_px = {width, height};
  return layers;
}

/// Writes the layers of one ray's hit.
class LayerWriter {
 public:
  LayerWriter(const ResidentScene& place, const CameraView& shot, const LayerSelection& selection, RenderLayers& layers)
      : place_(place), view_(shot), selection_(selection), layers_(layers) {
    if (shot.T_local_previous) T_previous_local_ = shot.T_local_previous->inverse();
  }

  void operator()(const render::SurfacePoint& point) const {
    if (!point.hit) return;
    const Vec3 ray(point.ray_camera[0], point.ray_camera[1], point.ray_camera[2]);
    if (selection_.depth) layers_.depth_m(point.x, point.y) = point.distance_m * point.ray_camera[2];
    if (selection_.range) layers_.range_m(point.x, point.y) = point.distance_m;
    if (selection_.objects)
      layers_.objects(point.x, point.y) = 1 + place_.objects().index_of(point.mesh, point.triangle);
    if (!selection_.normals && !selection_.flow) return;
    const Vec3 ray_local = view_.T_local_camera.rotation * ray;
    if (selection_.normals) layers_.normals_local(point.x, point.y) = facing_normal(point, ray_local);
    if (selection_.flow && view_.T_local_previous) {
      write_flow(point, view_.T_local_camera.translation + point.distance_m * ray_local);
    }
  }

 private:
  void write_flow(const render::SurfacePoint& point, Vec3 surface_local) const {
    const scene::Scene& scene = place_.scene();
    if (point.mesh >= scene.first_placed_mesh())
      surface_local = view_.moved[scene.placed_of_mesh(point.mesh)] * surface_local;
    const auto before = view_.lens.project(T_previous_local_ * surface_local);
    if (!before) return;
    layers_.flow_px(point.x, point.y) = {static_cast<float>(point.x - before->x()),
                                         static_cast<float>(point.y - before->y())};
  }

  const ResidentScene& place_;
  const CameraView& view_;
  const LayerSelection& selection_;
  RenderLayers& layers_;
  SE3 T_previous_local_;
};

std::uint8_t to_byte(double share) { return static_cast<std::uint8_t>(std::clamp(share, 0.0, 1.0) * 255.0 + 0.5); }

Rgb8 grey(double share) {
  const std::uint8_t value = to_byte(share);
  return {value, value, value};
}

/// Unreal's colours of world normals: x north, y east, z up, each from -1 to 1.
Rgb8 normal_colour(const std::array<float, 3>& enu) {
  if (enu == std::array<float, 3>{}) return {};
  return {to_byte(0.5 + 0.5 * enu[1]), to_byte(0.5 + 0.5 * enu[0]), to_byte(0.5 + 0.5 * enu[2])};
}

std::uint8_t flow_byte(float pixels) {
  return static_cast<std::uint8_t>(std::clamp(std::lround(pixels) + 128L, 0L, 255L));
}

/// Direction as hue, magnitude as brightness.
Rgb8 flow_colour(const std::array<float, 2>& flow) {
  const double sixths = (std::atan2(flow[1], flow[0]) / std::numbers::pi + 1.0) * 3.0;
  const double value = std::hypot(flow[0], flow[1]) / kFlowVisRange_px;
  const auto channel = [&](double offset) {
    const double k = std::fmod(offset + sixths, 6.0);
    return to_byte(value * (1.0 - std::clamp(std::min(k, 4.0 - k), 0.0, 1.0)));
  };
  return {channel(5.0), channel(3.0), channel(1.0)};
}

double disparity(float depth_m, const Camera& lens) {
  return depth_m > 0.0F && depth_m < kSkyDistance_m ? focal_px(lens) * kStereoBaseline_m / depth_m / lens.width() : 0.0;
}

/// Applies a function to the pixels of a layer.
template <class Out, class Pixel, class Function>
std::vector<Out> transform_pixels(const imaging::Image<Pixel>& layer, const Function& of) {
  std::vector<Out> out(layer.pixels.size());
  std::ranges::transform(layer.pixels, out.begin(), of);
  return out;
}

/// Returns the grey value of an id, from 0 to 1: ids up to 255 are distinct, and -1 is black.
double grey_share(int id) { return std::clamp(id, 0, 255) / 255.0; }

/// The colour of each object in an image of labels.
std::vector<Rgb8> colours_of(ImageType type, const ObjectLabels& labels) {
  if (type == ImageType::kAnnotation) return labels.annotation;
  std::vector<Rgb8> colours;
  for (const int id : labels.ids) colours.push_back(simulator::segmentation_colour(id));
  return colours;
}

/// Tiles hold their light in their textures, and nothing else lights them: a surface is white.
double light_share(std::uint32_t object) { return object == 0 ? 0.0 : 1.0; }

}  // namespace

void LayerSelection::add(ImageType type) {
  switch (type) {
    case ImageType::kScene:
      rgb = true;
      break;
    case ImageType::kDepthPlanar:
    case ImageType::kDepthVis:
    case ImageType::kDisparityNormalized:
      depth = true;
      break;
    case ImageType::kDepthPerspective:
      range = true;
      break;
    case ImageType::kSegmentation:
    case ImageType::kInfrared:
    case ImageType::kLighting:
    case ImageType::kAnnotation:
      objects = true;
      break;
    case ImageType::kSurfaceNormals:
      normals = true;
      break;
    case ImageType::kOpticalFlow:
    case ImageType::kOpticalFlowVis:
      flow = true;
      break;
  }
}

std::vector<double> lens_key(const Camera& lens) {
  std::vector<double> key{static_cast<double>(lens.model().index()), static_cast<double>(lens.width()),
                          static_cast<double>(lens.height())};
  std::visit(
      [&](const auto& model) {
        // All lens models consist of doubles only.
        using Model = std::decay_t<decltype(model)>;
        static_assert(std::is_trivially_copyable_v<Model> && sizeof(Model) % sizeof(double) == 0);
        const auto* numbers = reinterpret_cast<const double*>(&model);
        key.insert(key.end(), numbers, numbers + sizeof(Model) / sizeof(double));
      },
      lens.model());
  return key;
}

/// Kept until there is another light.
std::shared_ptr<const render::Daylight> ImageRenderer::daylight(const Sunlight& sunlight) {
  {
    const std::lock_guard lock(mutex_);
    if (lit_for_ == sunlight) return daylight_;
  }
  auto made = std::make_shared<const render::Daylight>(
      render::DaylightOptions{
          .utc_s = sunlight.utc_s, .white_balance = render::WhiteBalance::kDaylight, .allows_night = true},
      sunlight.place());
  const std::lock_guard lock(mutex_);
  lit_for_ = sunlight;
  return daylight_ = std::move(made);
}

std::shared_ptr<const render::CameraRenderer> ImageRenderer::camera_renderer(
    const std::shared_ptr<const ResidentScene>& place, const Camera& lens, const Outlook* outlook) {
  const std::vector<double> key = lens_key(lens);
  const Outlook seen = outlook != nullptr ? *outlook : Outlook();
  std::shared_ptr<const render::CameraRays> rays;
  {
    const std::lock_guard lock(mutex_);
    const auto at = std::ranges::find(cache_, key, &CachedRenderer::lens);
    if (at != cache_.end()) {
      cache_.splice(cache_.begin(), cache_, at);
      if (at->place == place && (outlook == nullptr || at->outlook.needs_same_renderer(seen))) return at->renderer;
      rays = at->rays;
    }
  }
  render::RenderOptions options{.depth = false};
  if (seen.sunlight) options.daylight = daylight(*seen.sunlight);
  options.weather = seen.weather;
  options.depth = seen.weather && seen.weather->has_precipitation();  // what falls is hidden by surfaces
  const auto made =
      rays ? std::make_shared<const render::CameraRenderer>(place->scene(), place->appearance(), rays, options)
           : std::make_shared<const render::CameraRenderer>(place->scene(), place->appearance(), lens, options);
  const std::lock_guard lock(mutex_);
  std::erase_if(cache_, [&](const CachedRenderer& kept) { return kept.lens == key; });
  for (CachedRenderer& kept : cache_) {
    if (kept.place == place) continue;
    kept.renderer = nullptr;
    kept.place = nullptr;
  }
  cache_.push_front({key, made->rays(), static_cast<double>(lens.width()) * lens.height(), seen, place, made});
  double pixels = 0.0;
  std::size_t count = 0;
  std::erase_if(cache_, [&](const CachedRenderer& kept) {
    pixels += kept.pixels;
    return ++count > 1 && (count > kMaxRenderers || pixels > kMaxCachedPixels);
  });
  return made;
}

/// The camera's exposure takes no time, but that of what falls does: meanwhile it goes on as it moves.
imaging::RgbImage ImageRenderer::render_colours(const render::CameraRenderer& renderer, const CameraView& shot,
                                                double time_s, const render::SurfaceVisitor& visitor) {
  const auto& weather = renderer.options().weather;
  if (!weather || !weather->has_precipitation()) return renderer.render(shot.T_local_camera, visitor).rgb;
  render::LightFrame frame = renderer.render_light({1, 1, {shot.T_local_camera}}, visitor);
  const auto pose_at = [&](double at_s) {
    const double later_s = at_s - time_s;
    const Vec3 turned = later_s * shot.angular_velocity_rad_s;
    const Eigen::Quaterniond turn(
        Eigen::AngleAxisd(turned.norm(), turned.norm() > 0.0 ? turned.normalized() : Vec3::UnitZ()));
    return SE3(turn * shot.T_local_camera.rotation, shot.T_local_camera.translation + later_s * shot.velocity_m_s);
  };
  const render::StreakRenderer streaks(renderer.options(), renderer.anchor().z());
  streaks.draw(shot.lens, {pose_at, time_s, weather->streak_exposure_s, 0.0}, frame.depth_m, frame.light);
  imaging::RgbImage image(frame.light.width, frame.light.height);
  std::ranges::transform(frame.light.pixels, image.pixels.begin(),
                         [](const render::LinearRgb& light) { return render::SrgbTables::get().encode(light); });
  return image;
}

RenderLayers ImageRenderer::render(const std::shared_ptr<const ResidentScene>& place, const CameraView& shot,
                                   const LayerSelection& selection, const Outlook& outlook) {
  const auto renderer = this->camera_renderer(place, shot.lens, selection.rgb ? &outlook : nullptr);
  RenderLayers layers = empty_layers(shot.lens.width(), shot.lens.height(), selection);
  const LayerWriter notes(*place, shot, selection, layers);
  const render::SurfaceVisitor visitor = selection.geometry() ? std::cref(notes) : render::SurfaceVisitor();
  if (selection.rgb) {
    layers.rgb = render_colours(*renderer, shot, outlook.time_s, visitor);
  } else if (visitor) {
    renderer->visit_surface(std::span(&shot.T_local_camera, 1), visitor);
  }
  return layers;
}

ObjectLabels ObjectLabels::of(const ResidentScene& place, const simulator::SegmentationIds& ids) {
  std::vector<int> all = ids.lookup(place.object_names());
  all.insert(all.begin(), 0);
  return {std::move(all), {}};
}

std::vector<float> to_float_pixels(ImageType type, const RenderLayers& layers, const Camera& lens,
                                   const ObjectLabels& labels) {
  switch (type) {
    case ImageType::kScene:
      return transform_pixels<float>(layers.rgb, [](const Rgb8& p) { return p[0] / 255.0F; });
    case ImageType::kDepthPlanar:
      return layers.depth_m.pixels;
    case ImageType::kDepthPerspective:
      return layers.range_m.pixels;
    case ImageType::kDepthVis:
      return transform_pixels<float>(layers.depth_m,
                                     [](float d) { return std::clamp(d / kDepthVisRange_m, 0.0F, 1.0F); });
    case ImageType::kDisparityNormalized:
      return transform_pixels<float>(layers.depth_m, [&](float d) { return static_cast<float>(disparity(d, lens)); });
    case ImageType::kSegmentation:
    case ImageType::kAnnotation:
      return transform_pixels<float>(layers.objects, [colours = colours_of(type, labels)](std::uint32_t object) {
        return colours[object][0] / 255.0F;
      });
    case ImageType::kInfrared:
      return transform_pixels<float>(
          layers.objects, [&](std::uint32_t object) { return static_cast<float>(grey_share(labels.ids[object])); });
    case ImageType::kLighting:
      return transform_pixels<float>(layers.objects,
                                     [](std::uint32_t object) { return static_cast<float>(light_share(object)); });
    case ImageType::kSurfaceNormals:
      return transform_pixels<float>(layers.normals_local, [](const auto& n) { return normal_colour(n)[0] / 255.0F; });
    case ImageType::kOpticalFlow:
      return transform_pixels<float>(layers.flow_px, [](const auto& flow) { return flow[0]; });
    case ImageType::kOpticalFlowVis:
      return transform_pixels<float>(layers.flow_px, [](const auto& flow) { return flow_colour(flow)[0] / 255.0F; });
  }
  return {};
}

imaging::RgbImage to_colour_pixels(ImageType type, const RenderLayers& layers, const Camera& lens,
                                   const ObjectLabels& labels) {
  imaging::RgbImage image;
  image.width = lens.width();
  image.height = lens.height();
  switch (type) {
    case ImageType::kScene:
      return layers.rgb;
    case ImageType::kDepthPlanar:
      image.pixels = transform_pixels<Rgb8>(layers.depth_m, [](float d) { return grey(d); });
      break;
    case ImageType::kDepthPerspective:
      image.pixels = transform_pixels<Rgb8>(layers.range_m, [](float d) { return grey(d); });
      break;
    case ImageType::kDepthVis:
      image.pixels = transform_pixels<Rgb8>(layers.depth_m, [](float d) { return grey(d / kDepthVisRange_m); });
      break;
    case ImageType::kDisparityNormalized:
      image.pixels = transform_pixels<Rgb8>(layers.depth_m, [&](float d) { return grey(disparity(d, lens)); });
      break;
    case ImageType::kSegmentation:
    case ImageType::kAnnotation:
      image.pixels = transform_pixels<Rgb8>(
          layers.objects, [colours = colours_of(type, labels)](std::uint32_t object) { return colours[object]; });
      break;
    case ImageType::kInfrared:
      image.pixels = transform_pixels<Rgb8>(layers.objects,
                                            [&](std::uint32_t object) { return grey(grey_share(labels.ids[object])); });
      break;
    case ImageType::kLighting:
      image.pixels =
          transform_pixels<Rgb8>(layers.objects, [](std::uint32_t object) { return grey(light_share(object)); });
      break;
    case ImageType::kSurfaceNormals:
      image.pixels = transform_pixels<Rgb8>(layers.normals_local, normal_colour);
      break;
    case ImageType::kOpticalFlow:
      image.pixels = transform_pixels<Rgb8>(layers.flow_px, [](const auto& flow) {
        return Rgb8{flow_byte(flow[0]), flow_byte(flow[1]), 0};
      });
      break;
    case ImageType::kOpticalFlowVis:
      image.pixels = transform_pixels<Rgb8>(layers.flow_px, flow_colour);
      break;
  }
  return image;
}

}  // namespace tileflight::simulator
