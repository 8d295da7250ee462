#include <cstddef>
#include <cstdint>
#include <span>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/tileset/subtree.h"

/// A subtree of any bytes, with metadata that name volumes and URIs; its outside buffers are these same bytes.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tileflight;
  const auto bytes = std::as_bytes(std::span(data, size));
  tile_content::MetadataProperty box{.id = "box", .semantic = "TILE_BOUNDING_BOX", .component_type = "FLOAT32"};
  box.is_array = true;
  box.array_length = 12;
  const tile_content::MetadataProperty error{
      .id = "error", .semantic = "TILE_GEOMETRIC_ERROR", .component_type = "UINT16", .normalized = true};
  tile_content::MetadataProperty uri{.id = "uri", .semantic = "CONTENT_URI"};
  uri.kind = tile_content::MetadataProperty::Kind::kString;
  auto tiling = std::make_shared<tileset::ImplicitTiling>();
  tiling->octree = size % 2 == 1;
  tiling->subtree_levels = 3;
  tiling->available_levels = 6;
  tiling->content_templates = {"a", "b"};
  tiling->root_volume = tileset::OrientedBox{geometry::Vec3::Zero(), geometry::Mat3::Identity()};
  tiling->schema = std::make_shared<const tile_content::MetadataSchema>(
      tile_content::MetadataSchema{{"tile", {{box, error}}}, {"content", {{uri}}}});
  try {
    const std::vector<std::byte> file(bytes.begin(), bytes.end());
    const tileset::Subtree subtree =
        tileset::parse_subtree(file, {tiling, {}}, "input", [&](const std::string&) { return file; });
    std::vector<std::uint32_t> pending{0};
    while (!pending.empty()) {
      const std::uint32_t tile = pending.back();
      pending.pop_back();
      if (subtree.is_child_subtree(tile)) continue;
      subtree.tile(tile);
      for (const std::uint32_t child : subtree.children(tile)) pending.push_back(child);
    }
  } catch (const InputError&) {
    // one clear line is what broken input is worth
  }
  return 0;
}
