#include "tileflight/data/dataset/frame_layers.h"

#include <system_error>

#include "tileflight/core/base/input_error.h"
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

}  // namespace tileflight::dataset
