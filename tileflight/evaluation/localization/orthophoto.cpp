#include "tileflight/evaluation/localization/orthophoto.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "tileflight/capture/render/appearance.h"
#include "tileflight/capture/render/camera_renderer.h"

namespace tileflight::localization {

using geometry::Box3;
using geometry::Vec2;
using geometry::Vec3;

namespace {

constexpr int kTile_px = 1024;
constexpr double kViewpoint_m = 50e3;  // height above the tile, so large that rays deviate from the vertical by less
                                       // than a thousandth

/// Pinhole camera for a square tile seen from far above, image top to the north.
imaging::Camera tile_camera(double pixel_m, double distance_m) {
  const double focal_px = distance_m / pixel_m, middle = 0.5 * (kTile_px - 1);
  return {imaging::PinholeRadtan{.fx = focal_px, .fy = focal_px, .cx = middle, .cy = middle}, kTile_px, kTile_px};
}

geometry::SE3 looking_down(const Vec3& position) {
  geometry::Mat3 r;
  r << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  return {r, position};
}

void copy_tile(const render::RenderedFrame& tile, int x0, int y0, const Box3& box, GroundImage& image) {
  const int right = std::min(image.grey.width, x0 + kTile_px), bottom = std::min(image.grey.height, y0 + kTile_px);
  const double top_m = box.max().z() + kViewpoint_m;
  for (int y = y0; y < bottom; ++y) {
    for (int x = x0; x < right; ++x) {
      const float depth_m = tile.depth_m(x - x0, y - y0);
      const auto z = static_cast<float>(top_m - depth_m);
      if (!std::isfinite(depth_m) || z < box.min().z()) continue;
      const imaging::Rgb8& rgb = tile.rgb(x - x0, y - y0);
      image.grey(x, y) = static_cast<std::uint8_t>((299 * rgb[0] + 587 * rgb[1] + 114 * rgb[2] + 500) / 1000);
      image.seen(x, y) = 255;
      constexpr int kStep = GroundImage::kHeightStep;
      if (x % kStep == 0 && y % kStep == 0) image.height(x / kStep, y / kStep) = z;
    }
  }
}

GroundImage empty_image(const Box3& box, double pixel_m) {
  GroundImage image;
  const int width = std::max(1, static_cast<int>(std::ceil(box.sizes().x() / pixel_m)));
  const int height = std::max(1, static_cast<int>(std::ceil(box.sizes().y() / pixel_m)));
  image.grey = imaging::GrayImage(width, height);
  image.seen = imaging::GrayImage(width, height);
  constexpr int kStep = GroundImage::kHeightStep;
  image.height = imaging::FloatImage((width + kStep - 1) / kStep, (height + kStep - 1) / kStep, std::nanf(""));
  image.pixel_size = pixel_m;
  image.origin = Vec2(box.min().x() + 0.5 * pixel_m, box.max().y() - 0.5 * pixel_m);
  return image;
}

/// Side of a texel on a triangle, and the triangle's area.
std::pair<double, double> texel_and_area(const imaging::TexturedMesh& mesh, const geometry::Triangle& t) {
  const Vec3 a = mesh.mesh.vertices[t[1]] - mesh.mesh.vertices[t[0]];
  const Vec3 b = mesh.mesh.vertices[t[2]] - mesh.mesh.vertices[t[0]];
  const Eigen::Vector2d size(mesh.texture->width, mesh.texture->height);
  const Eigen::Vector2d u = (mesh.uv[t[1]] - mesh.uv[t[0]]).cast<double>().cwiseProduct(size);
  const Eigen::Vector2d v = (mesh.uv[t[2]] - mesh.uv[t[0]]).cast<double>().cwiseProduct(size);
  const double area_m2 = 0.5 * a.cross(b).norm();
  const double texels = 0.5 * std::abs(u.x() * v.y() - u.y() * v.x());
  return {texels > 0.0 ? std::sqrt(area_m2 / texels) : 0.0, area_m2};
}

}  // namespace

std::optional<double> median_texel_size_m(const scene::Scene& scene, const Box3& box) {
  std::vector<std::pair<double, double>> sizes;  // texel size and area
  double total_m2 = 0.0;
  for (const imaging::TexturedMesh& mesh : scene.meshes()) {
    if (!mesh.texture || mesh.uv.empty()) continue;
    for (const geometry::Triangle& t : mesh.mesh.triangles) {
      if (!box.contains(mesh.mesh.vertices[t[0]])) continue;
      const auto [texel_m, area_m2] = texel_and_area(mesh, t);
      if (!(texel_m > 0.0)) continue;
      sizes.emplace_back(texel_m, area_m2);
      total_m2 += area_m2;
    }
  }
  if (sizes.empty()) return std::nullopt;
  std::ranges::sort(sizes);
  double below_m2 = 0.0;
  for (const auto& [texel_m, area_m2] : sizes) {
    below_m2 += area_m2;
    if (2.0 * below_m2 >= total_m2) return texel_m;
  }
  return sizes.back().first;
}

GroundImage build_orthophoto(const scene::Scene& scene, std::shared_ptr<const render::Appearance> appearance,
                             const Box3& box, const OrthophotoOptions& options) {
  const double area_m2 = box.sizes().x() * box.sizes().y();
  const double pixel_m = std::max(
      {options.pixel_m, 0.5 * median_texel_size_m(scene, box).value_or(0.0), std::sqrt(area_m2 / options.max_pixels)});
  GroundImage image = empty_image(box, pixel_m);
  const render::CameraRenderer renderer(scene, std::move(appearance), tile_camera(pixel_m, kViewpoint_m), {});
  for (int y = 0; y < image.grey.height; y += kTile_px) {
    for (int x = 0; x < image.grey.width; x += kTile_px) {
      const Vec2 middle = image.position(x + 0.5 * (kTile_px - 1), y + 0.5 * (kTile_px - 1));
      const Vec3 viewpoint(middle.x(), middle.y(), box.max().z() + kViewpoint_m);
      copy_tile(renderer.render(looking_down(viewpoint)), x, y, box, image);
    }
  }
  fill_unseen(image.grey, image.seen);
  return image;
}

}  // namespace tileflight::localization
