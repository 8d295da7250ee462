#include "tileflight/data/dataset/frame_layers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <system_error>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/frame_list.h"

namespace tileflight::dataset {

namespace {

namespace fs = std::filesystem;

/// folder/layer/000000.ext
fs::path layer_file(const fs::path& folder, const char* layer, std::size_t index, const char* ending) {
  std::error_code error;
  fs::create_directory(folder / layer, error);
  if (error) throw InputError((folder / layer).string(), "cannot be created: " + error.message());
  return folder / layer / (frame_id(index) + ending);
}

}  // namespace

void write_frame_layers(const fs::path& folder, std::size_t index, const FrameLayers& layers) {
  if (layers.depth_m != nullptr) imaging::write_exr(layer_file(folder, "depth", index, ".exr"), *layers.depth_m, "Z");
  if (layers.range_m != nullptr) imaging::write_exr(layer_file(folder, "range", index, ".exr"), *layers.range_m, "Y");
  if (layers.normals != nullptr)
    imaging::write_exr_channels<3>(layer_file(folder, "normals", index, ".exr"), *layers.normals, {"R", "G", "B"});
  if (layers.flow_px != nullptr)
    imaging::write_exr_channels<2>(layer_file(folder, "flow", index, ".exr"), *layers.flow_px, {"R", "G"});
  if (layers.visibility != nullptr)
    imaging::write_gray(layer_file(folder, "visibility", index, ".png"), *layers.visibility);
}

namespace {

constexpr double kMostUnits = std::numeric_limits<std::uint16_t>::max();

imaging::FloatImage metres_of(const imaging::Gray16Image& units, double units_per_m) {
  imaging::FloatImage depth_m(units.width, units.height);
  std::transform(units.pixels.begin(), units.pixels.end(), depth_m.pixels.begin(), [&](std::uint16_t value) {
    return value == 0 ? std::numeric_limits<float>::infinity() : static_cast<float>(value / units_per_m);
  });
  return depth_m;
}

}  // namespace

std::optional<imaging::FloatImage> read_depth(const Dataset& dataset, const Frame& frame) {
  if (frame.depth.empty()) return std::nullopt;
  if (base::to_lower(frame.depth.extension().string()) == ".exr") return imaging::read_exr(frame.depth);
  return metres_of(imaging::read_gray16(frame.depth), dataset.depth_units_per_m);
}

imaging::Gray16Image quantize_depth(const imaging::FloatImage& depth_m, double units_per_m) {
  imaging::Gray16Image units(depth_m.width, depth_m.height);
  std::transform(depth_m.pixels.begin(), depth_m.pixels.end(), units.pixels.begin(), [&](float metres) {
    const double value = std::round(static_cast<double>(metres) * units_per_m);
    return value > 0.0 && value <= kMostUnits ? static_cast<std::uint16_t>(value) : std::uint16_t{0};
  });
  return units;
}

double finest_depth_units_per_m(const Dataset& dataset) {
  bool has_depth = false;
  float largest_m = 0.0F;
  for (const Frame& frame : dataset.frames) {
    const auto depth_m = read_depth(dataset, frame);
    if (!depth_m) continue;
    has_depth = true;
    for (const float metres : depth_m->pixels)
      if (std::isfinite(metres)) largest_m = std::max(largest_m, metres);
  }
  if (!has_depth) return 0.0;
  constexpr std::array<double, 3> kSteps{5.0, 2.0, 1.0};
  for (double power = 1000.0; power > 1e-40; power /= 10.0)
    for (const double step : kSteps)
      if (step * power * static_cast<double>(largest_m) <= kMostUnits) return step * power;
  return 1e-40;  // a float is not larger
}

}  // namespace tileflight::dataset
