#pragma once

#include <array>
#include <cstddef>
#include <filesystem>

#include "tileflight/core/imaging/image.h"

namespace tileflight::dataset {

/// A frame's data besides its image, each layer in its own folder. Null: no such layer.
struct FrameLayers {
  const imaging::FloatImage* depth_m = nullptr;                   ///< depth/000000.exr, channel Z
  const imaging::FloatImage* range_m = nullptr;                   ///< range/000000.exr, channel Y
  const imaging::Image<std::array<float, 3>>* normals = nullptr;  ///< normals/000000.exr, channels R G B: x y z
  const imaging::Image<std::array<float, 2>>* flow_px = nullptr;  ///< flow/000000.exr, channels R G: right, down
  const imaging::GrayImage* visibility = nullptr;                 ///< visibility/000000.png
};

/// Writes a frame's layers into a dataset's folder; missing folders are created. Safe to call from several threads.
/// Throws InputError.
void write_frame_layers(const std::filesystem::path& dataset_folder, std::size_t index, const FrameLayers& layers);

}  // namespace tileflight::dataset
