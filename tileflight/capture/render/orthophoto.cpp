#include "tileflight/capture/render/orthophoto.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "tileflight/capture/render/appearance.h"
#include "tileflight/capture/render/daylight.h"
#include "tileflight/capture/render/linear_color.h"
#include "tileflight/capture/render/surface_color.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::render {
namespace {

using geometry::Vec3;

/// Shading of untextured surfaces by a light from the north-west at 45 degrees elevation.
constexpr double kUntexturedAlbedo = 0.62, kAmbient = 0.35;

LinearRgb shade_untextured(const scene::Scene& scene, const scene::Hit& hit, const LinearRgb& color) {
  const Vec3 towards_light = Vec3(-1, 1, std::sqrt(2.0)).normalized();
  Vec3 normal = scene.normal(hit);
  if (normal.z() < 0) normal = -normal;  // seen from above, regardless of the winding
  const auto shade =
      static_cast<float>(kUntexturedAlbedo * (kAmbient + (1 - kAmbient) * std::max(0.0, normal.dot(towards_light))));
  return {shade * color[0], shade * color[1], shade * color[2]};
}

/// A surface that lies less far below one that blends counts as the same.
constexpr double kLayerGap_m = 1e-3;

/// The rays of one image.
class Rays {
 public:
  Rays(const scene::Scene& scene, const GroundGrid& grid, const OrthophotoOptions& options)
      : scene_(scene),
        appearance_(scene),
        grid_(grid),
        options_(options),
        from_m_(std::min(options.top_m, scene.bounds().max().z() + 1.0)),
        length_m_(from_m_ - std::max(options.bottom_m, scene.bounds().min().z() - 1.0)) {
    scene.build_ray_tree();
  }

  void cast(int x, int y, Orthophoto& out) const {
    const int n = options_.samples_along_axis;
    LinearRgb sum{};
    int hits = 0;
    double highest_m = -INFINITY;
    for (int k = 0; k < n * n; ++k) {
      const Vec3 origin(grid_.west_m + grid_.pixel_m * (x + (k % n + 0.5) / n),
                        grid_.north_m - grid_.pixel_m * (y + (k / n + 0.5) / n), from_m_);
      const auto hit = length_m_ > 0 ? scene_.intersect({origin, -Vec3::UnitZ()}, length_m_) : std::nullopt;
      if (!hit) continue;
      ++hits;
      highest_m = std::max(highest_m, from_m_ - hit->distance_m);
      const LinearRgb light = color_along(origin, *hit);
      for (std::size_t c = 0; c < 3; ++c) sum[c] += light[c];
    }
    if (hits == 0) return;
    for (float& channel : sum) channel /= static_cast<float>(hits);
    out.rgb(x, y) = SrgbTables::get().encode(sum);
    out.height_m(x, y) = static_cast<float>(highest_m);
  }

 private:
  /// Color of the surfaces below `origin`, of which `first` is the highest: those that blend show what lies below.
  LinearRgb color_along(const Vec3& origin, const scene::Hit& first) const {
    LinearRgb sum = color_of(first);
    float share = 1.0F - opacity_of(first);
    if (share <= 0.0F) return sum;
    for (float& channel : sum) channel *= 1.0F - share;
    double depth_m = first.distance_m;
    for (int layer = 1; share > 0.0F && layer < kMostBlendedSurfaces; ++layer) {
      depth_m += kLayerGap_m;
      const Vec3 from = origin - depth_m * Vec3::UnitZ();
      const auto hit =
          length_m_ > depth_m ? scene_.intersect({from, -Vec3::UnitZ()}, length_m_ - depth_m) : std::nullopt;
      if (!hit) break;
      depth_m += hit->distance_m;
      const LinearRgb light = color_of(*hit);
      const float opacity = layer + 1 < kMostBlendedSurfaces ? opacity_of(*hit) : 1.0F;
      for (std::size_t c = 0; c < 3; ++c) sum[c] += share * opacity * light[c];
      share *= 1.0F - opacity;
    }
    // Without anything below, the surfaces that are there give the color.
    if (share < 1.0F) {
      for (float& channel : sum) channel /= 1.0F - share;
    }
    return sum;
  }

  /// Light that the surface reflects upwards.
  LinearRgb lit(const scene::Hit& hit, const LinearRgb& albedo) const {
    Vec3 normal = scene_.normal(hit);
    if (normal.z() < 0) normal = -normal;
    const std::array<float, 3> n{static_cast<float>(normal.x()), static_cast<float>(normal.y()),
                                 static_cast<float>(normal.z())};
    const std::array<float, 3>& s = options_.daylight->toward_sun();
    const float sun = std::max(0.0F, n[0] * s[0] + n[1] * s[1] + n[2] * s[2]);
    LinearRgb light = options_.daylight->diffuse(n);
    for (std::size_t c = 0; c < 3; ++c) light[c] = albedo[c] * (light[c] + sun * options_.daylight->sunlight()[c]);
    return light;
  }

  float opacity_of(const scene::Hit& hit) const {
    return surface_opacity(scene_, appearance_, hit, grid_.pixel_m / options_.samples_along_axis);
  }

  LinearRgb color_of(const scene::Hit& hit) const {
    const LinearRgb light = surface_color(scene_, appearance_, hit, grid_.pixel_m / options_.samples_along_axis);
    const Material& material = appearance_.material(hit.mesh);
    if (options_.daylight) return lit(hit, light);
    const bool has_colors = material.texture.pyramid != nullptr || material.vertex_colors != nullptr;
    return has_colors ? light : shade_untextured(scene_, hit, light);
  }

  const scene::Scene& scene_;
  Appearance appearance_;
  const GroundGrid& grid_;
  const OrthophotoOptions& options_;
  double from_m_, length_m_;
};

/// Half the spacing, in pixels, of points spread evenly over their part of the image.
int dot_radius_px(const std::vector<Vec3>& points, const GroundGrid& grid) {
  geometry::Box3 box;
  for (const Vec3& p : points) box.extend(p);
  const double area_px = std::max(1.0, box.sizes().x() / grid.pixel_m) * std::max(1.0, box.sizes().y() / grid.pixel_m);
  const double apart_px = std::sqrt(area_px / static_cast<double>(points.size()));
  return std::clamp(static_cast<int>(std::floor(apart_px / 2 + 0.5)), 0, 3);
}

}  // namespace

Orthophoto render_orthophoto(const scene::Scene& scene, const GroundGrid& grid, const OrthophotoOptions& options) {
  if (grid.width < 1 || grid.height < 1 || !(grid.pixel_m > 0))
    throw InputError("top view", "must have at least one pixel");
  Orthophoto out(grid.width, grid.height);
  const Rays rays(scene, grid, options);
  tbb::parallel_for(0, grid.height, [&](int y) {
    for (int x = 0; x < grid.width; ++x) rays.cast(x, y, out);
  });
  return out;
}

void splat_points(const geometry::PointCloud& cloud, const GroundGrid& grid, const OrthophotoOptions& options,
                  Orthophoto& image) {
  if (cloud.empty()) return;
  constexpr imaging::Rgb8 kGrey{150, 150, 150};
  const int reach = dot_radius_px(cloud.positions, grid);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vec3& p = cloud.positions[i];
    if (p.z() > options.top_m || p.z() < options.bottom_m) continue;
    const geometry::Vec2 pixel = grid.pixel_at(p);
    if (!(pixel.cwiseAbs().maxCoeff() < 1e6)) continue;
    const int column = static_cast<int>(std::lround(pixel.x())), row = static_cast<int>(std::lround(pixel.y()));
    for (int y = std::max(0, row - reach); y <= std::min(grid.height - 1, row + reach); ++y) {
      for (int x = std::max(0, column - reach); x <= std::min(grid.width - 1, column + reach); ++x) {
        float& height_m = image.height_m(x, y);
        if (height_m >= static_cast<float>(p.z())) continue;  // NaN compares false: nothing is there yet
        height_m = static_cast<float>(p.z());
        image.rgb(x, y) = cloud.colors.empty() ? kGrey : cloud.colors[i];
      }
    }
  }
}

}  // namespace tileflight::render
