#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>

#include "tileflight/core/imaging/image.h"
#include "tileflight/data/dataset/dataset.h"

namespace tileflight::dataset {

/// Data of a frame besides its image; each layer has its own folder. A null layer is not written.
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

/// Reads the depth of a frame's pixels along the optical axis, metres; +infinity where there is none. The file is an
/// EXR image in metres, or a 16-bit grey PNG in which Dataset::depth_units_per_m are a metre and 0 is none. Returns
/// nullopt if the frame has no depth. Throws InputError for a file that is not an image of that kind.
std::optional<imaging::FloatImage> read_depth(const Dataset& dataset, const Frame& frame);

/// Converts depth to a 16-bit image in units of 1/`units_per_m` metres; 0 where there is none, where it is not
/// positive, or too far.
imaging::Gray16Image quantize_depth(const imaging::FloatImage& depth_m, double units_per_m);

/// Returns the finest of 5000, 2000, 1000, 500, ... units a metre with which all depths of the dataset fit into 16
/// bits; 0 if no frame has a depth. Throws InputError as read_depth().
double finest_depth_units_per_m(const Dataset& dataset);

}  // namespace tileflight::dataset
