#include "tileflight/tiles/tile_content/gltf_extensions.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "tileflight/core/base/input_error.h"

namespace tileflight::tile_content {
namespace {

/// Supported required extensions, including those that only affect lighting or metadata.
constexpr std::array<std::string_view, 16> kSupportedExtensions = {
    "KHR_draco_mesh_compression", "EXT_meshopt_compression",  "KHR_mesh_quantization",   "KHR_texture_transform",
    "EXT_texture_webp",           "KHR_texture_basisu",       "EXT_mesh_gpu_instancing", "CESIUM_RTC",
    "KHR_lights_punctual",        "CESIUM_primitive_outline", "EXT_mesh_features",       "EXT_instance_features",
    "EXT_structural_metadata",    "EXT_feature_metadata",     "KHR_xmp_json_ld",         "KHR_xmp"};
/// Relevant for images only.
constexpr std::array<std::string_view, 2> kImageExtensions = {"MSFT_texture_dds", "EXT_texture_avif"};

template <std::size_t N>
bool contains(const std::array<std::string_view, N>& list, const std::string& value) {
  return std::find(list.begin(), list.end(), value) != list.end();
}

bool is_supported(const std::string& extension, bool textures) {
  return contains(kSupportedExtensions, extension) || extension.starts_with("KHR_materials_") ||
         (!textures && contains(kImageExtensions, extension));
}

}  // namespace

void require_supported(const gltf::Document& document, const std::string& name, bool textures) {
  for (const std::string& extension : document.extensions_required) {
    if (!is_supported(extension, textures))
      throw InputError(name, "needs the glTF extension " + extension + ", which is not supported");
  }
}

}  // namespace tileflight::tile_content
