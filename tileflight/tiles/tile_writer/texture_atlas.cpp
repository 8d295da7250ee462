#include "tileflight/tiles/tile_writer/texture_atlas.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "tileflight/core/imaging/rectangle_packing.h"
#include "tileflight/tiles/tile_writer/texture_filter.h"

namespace tileflight::tile_writer {
namespace {

using imaging::RgbImage;
using imaging::TexturedMesh;

constexpr int kGutter_px = 2;

RgbImage small_image(const TexturedMesh& mesh, int halvings) {
  if (!mesh.texture) {
    const auto byte = [&](std::size_t c) {
      return static_cast<std::uint8_t>(std::lround(255.0F * mesh.base_color[c]));
    };
    return RgbImage(2, 2, {byte(0), byte(1), byte(2)});
  }
  const auto scaled_length = [&](int length) { return std::max(1, (length + (1 << halvings) - 1) >> halvings); };
  return resize_area(*mesh.texture, scaled_length(mesh.texture->width), scaled_length(mesh.texture->height));
}

/// Copies an image to (x, y) with its edge repeated around it.
void place(const RgbImage& image, imaging::PixelPosition at, RgbImage& sheet) {
  for (int row = -kGutter_px; row < image.height + kGutter_px; ++row) {
    const imaging::Rgb8* from = image.row(std::clamp(row, 0, image.height - 1));
    imaging::Rgb8* to = sheet.row(at.y + kGutter_px + row) + at.x;
    std::fill_n(to, kGutter_px, from[0]);
    std::copy_n(from, image.width, to + kGutter_px);
    std::fill_n(to + kGutter_px + image.width, kGutter_px, from[image.width - 1]);
  }
}

void add_mesh(const TexturedMesh& mesh, imaging::PixelPosition at, const RgbImage& image, const RgbImage& sheet,
              TexturedMesh& out) {
  const auto first = static_cast<std::uint32_t>(out.mesh.vertices.size());
  out.mesh.vertices.insert(out.mesh.vertices.end(), mesh.mesh.vertices.begin(), mesh.mesh.vertices.end());
  for (const geometry::Triangle& t : mesh.mesh.triangles)
    out.mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  const Eigen::Vector2f low(static_cast<float>(at.x + kGutter_px), static_cast<float>(at.y + kGutter_px));
  const Eigen::Vector2f size(static_cast<float>(image.width), static_cast<float>(image.height));
  const Eigen::Vector2f whole(static_cast<float>(sheet.width), static_cast<float>(sheet.height));
  for (std::size_t i = 0; i < mesh.mesh.vertices.size(); ++i) {
    const Eigen::Vector2f uv = mesh.uv.empty() ? Eigen::Vector2f(0.5F, 0.5F) : mesh.uv[i];
    out.uv.emplace_back((low + uv.cwiseProduct(size)).cwiseQuotient(whole));
  }
}

}  // namespace

TexturedMesh merge_into_atlas(const std::vector<const TexturedMesh*>& meshes, int halvings) {
  std::vector<const TexturedMesh*> used;
  for (const TexturedMesh* mesh : meshes)
    if (!mesh->mesh.triangles.empty()) used.push_back(mesh);
  TexturedMesh out;
  out.wrap_u = out.wrap_v = imaging::Wrap::kClampToEdge;
  if (used.empty()) return out;
  std::vector<RgbImage> images;
  std::vector<imaging::PixelSize> sizes;
  for (const TexturedMesh* mesh : used) {
    images.push_back(small_image(*mesh, halvings));
    sizes.push_back({images.back().width + 2 * kGutter_px, images.back().height + 2 * kGutter_px});
  }
  const imaging::RectanglePacking packing = imaging::pack_rectangles(sizes);
  const auto sheet = std::make_shared<RgbImage>(packing.size.width, packing.size.height);
  for (std::size_t i = 0; i < used.size(); ++i) {
    place(images[i], packing.positions[i], *sheet);
    add_mesh(*used[i], packing.positions[i], images[i], *sheet, out);
  }
  out.texture = sheet;
  return out;
}

}  // namespace tileflight::tile_writer
