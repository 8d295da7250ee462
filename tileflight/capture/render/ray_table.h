#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "tileflight/core/imaging/camera.h"

namespace tileflight::render {

/// Rays of 4 x 2 neighbouring samples in the camera frame; lane = 4 * row + column. Every lane has a direction (outside
/// the lens's valid cone, that of the nearest sample inside), so that differences between lanes are defined.
struct alignas(32) RayBlock {
  static constexpr int kColumns = 4;
  static constexpr int kRows = 2;
  static constexpr int kLanes = 8;
  float x[kLanes], y[kLanes], z[kLanes];  ///< unit length
};

/// The ray of every sample of an image, computed once per camera. With n x n samples a pixel, sample (i, j) is at pixel
/// position ((i + 0.5) / n - 0.5, (j + 0.5) / n - 0.5). 12 bytes a sample.
class RayTable {
 public:
  RayTable(const imaging::Camera& camera, int samples_along_axis);

  int samples_along_axis() const { return samples_; }
  int block_columns() const { return block_columns_; }
  int block_rows() const { return block_rows_; }
  const RayBlock& block(int column, int row) const { return blocks_[index(column, row)]; }
  /// Bit mask of the lanes that are samples of the image and within the lens's valid cone.
  std::uint8_t valid(int column, int row) const { return valid_[index(column, row)]; }

 private:
  std::size_t index(int column, int row) const { return static_cast<std::size_t>(row) * block_columns_ + column; }
  void fill_block(const imaging::Camera& camera, int column, int row);

  int samples_;
  int block_columns_;
  int block_rows_;
  std::vector<RayBlock> blocks_;
  std::vector<std::uint8_t> valid_;
};

/// A camera with its tables.
struct CameraRays {
  imaging::Camera camera;
  RayTable central;                 ///< one ray per pixel
  std::optional<RayTable> samples;  ///< set if there are several samples per pixel

  CameraRays(imaging::Camera of, int samples_along_axis) : camera(std::move(of)), central(camera, 1) {
    if (samples_along_axis > 1) samples.emplace(camera, samples_along_axis);
  }
  int samples_along_axis() const { return samples ? samples->samples_along_axis() : 1; }
};

}  // namespace tileflight::render
