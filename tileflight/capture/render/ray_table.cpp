#include "tileflight/capture/render/ray_table.h"

#include <tbb/parallel_for.h>

#include <array>
#include <optional>

namespace tileflight::render {
namespace {

using geometry::Vec2;
using geometry::Vec3;

/// The ray of `pixel` or, if the lens has none there, of the nearest valid pixel towards the principal point.
Vec3 nearest_ray(const imaging::Camera& camera, const Vec2& pixel) {
  if (const auto ray = camera.unproject(pixel)) return *ray;
  const auto principal_point = camera.project(Vec3::UnitZ());
  if (!principal_point) return Vec3::UnitZ();
  Vec3 nearest = Vec3::UnitZ();
  double inside = 0.0;
  double outside = 1.0;
  for (int i = 0; i < 24; ++i) {
    const double middle = 0.5 * (inside + outside);
    const auto ray = camera.unproject(*principal_point + middle * (pixel - *principal_point));
    (ray ? inside : outside) = middle;
    if (ray) nearest = *ray;
  }
  return nearest;
}

}  // namespace

RayTable::RayTable(const imaging::Camera& camera, int samples_along_axis)
    : samples_(samples_along_axis),
      block_columns_((camera.width() * samples_ + RayBlock::kColumns - 1) / RayBlock::kColumns),
      block_rows_((camera.height() * samples_ + RayBlock::kRows - 1) / RayBlock::kRows),
      blocks_(static_cast<std::size_t>(block_columns_) * block_rows_),
      valid_(blocks_.size()) {
  tbb::parallel_for(0, block_rows_, [&](int row) {
    for (int column = 0; column < block_columns_; ++column) fill_block(camera, column, row);
  });
}

void RayTable::fill_block(const imaging::Camera& camera, int column, int row) {
  const auto pixel_of = [&](int lane) {
    const int i = column * RayBlock::kColumns + lane % RayBlock::kColumns;
    const int j = row * RayBlock::kRows + lane / RayBlock::kColumns;
    return Vec2((i + 0.5) / samples_ - 0.5, (j + 0.5) / samples_ - 0.5);
  };
  const auto in_image = [&](const Vec2& pixel) {
    return pixel.x() < camera.width() - 0.5 && pixel.y() < camera.height() - 0.5;
  };
  std::array<std::optional<Vec3>, RayBlock::kLanes> rays;
  std::uint8_t valid = 0;
  for (int lane = 0; lane < RayBlock::kLanes; ++lane) {
    rays[lane] = camera.unproject(pixel_of(lane));
    if (rays[lane] && in_image(pixel_of(lane))) valid |= static_cast<std::uint8_t>(1U << lane);
  }
  valid_[index(column, row)] = valid;
  if (valid == 0) return;
  RayBlock& block = blocks_[index(column, row)];
  for (int lane = 0; lane < RayBlock::kLanes; ++lane) {
    const Vec3 ray = rays[lane] ? *rays[lane] : nearest_ray(camera, pixel_of(lane));
    block.x[lane] = static_cast<float>(ray.x());
    block.y[lane] = static_cast<float>(ray.y());
    block.z[lane] = static_cast<float>(ray.z());
  }
}

}  // namespace tileflight::render
