#include "tileflight/tiles/tile_writer/tileset_json.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/files.h"

namespace tileflight::tile_writer {
namespace {

using geometry::Box3;
using nlohmann::json;

/// Levels of a subtree: 341 tiles at most.
constexpr std::size_t kSubtreeLevels = 5;

std::size_t cells_of(std::size_t level) { return std::size_t{1} << (2 * level); }

/// Bounds of each cell's content and descendants; empty where there are none.
std::vector<std::vector<Box3>> bounds_of_cells(const ImplicitTree& tree) {
  std::vector<std::vector<Box3>> bounds = tree.content;
  for (std::size_t level = bounds.size(); level-- > 1;)
    for (std::size_t cell = 0; cell < bounds[level].size(); ++cell)
      bounds[level - 1][cell / 4].extend(bounds[level][cell]);
  return bounds;
}

/// The binary part of a subtree with its views.
class SubtreeBuffer {
 public:
  std::size_t add(const void* bytes, std::size_t size) {
    views_.push_back({{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", size}});
    bytes_.append(static_cast<const char*>(bytes), size);
    bytes_.resize((bytes_.size() + 7) / 8 * 8, '\0');
    return views_.size() - 1;
  }

  /// 3D Tiles 1.1, "Availability": one bit each, the first in the lowest bit of the first byte.
  json availability(const std::vector<bool>& is_available) {
    const auto count = static_cast<std::size_t>(std::count(is_available.begin(), is_available.end(), true));
    if (count == 0 || count == is_available.size()) return {{"constant", count == 0 ? 0 : 1}};
    std::vector<std::uint8_t> bits((is_available.size() + 7) / 8);
    for (std::size_t i = 0; i < is_available.size(); ++i)
      if (is_available[i]) bits[i / 8] = static_cast<std::uint8_t>(bits[i / 8] | 1U << (i % 8));
    return {{"bitstream", add(bits.data(), bits.size())}, {"availableCount", count}};
  }

  const json& views() const { return views_; }
  const std::string& bytes() const { return bytes_; }

 private:
  json views_ = json::array();
  std::string bytes_;
};

void append_u64(std::string& bytes, std::uint64_t value) {
  for (unsigned shift = 0; shift < 64; shift += 8) bytes.push_back(static_cast<char>(value >> shift & 0xffU));
}

/// 3D Tiles 1.1, "Subtree Binary Format": header, JSON padded with blanks, binary part.
std::string subtree_bytes(json subtree, const SubtreeBuffer& buffer) {
  if (!buffer.bytes().empty()) {
    subtree["buffers"] = json::array({{{"byteLength", buffer.bytes().size()}}});
    subtree["bufferViews"] = buffer.views();
  }
  std::string text = subtree.dump();
  text.resize((text.size() + 7) / 8 * 8, ' ');
  std::string out("subt\1\0\0\0", 8);
  append_u64(out, text.size());
  append_u64(out, buffer.bytes().size());
  return out + text + buffer.bytes();
}

/// The subtree below a cell of `level`.
std::string subtree_of(const ImplicitTree& tree, const std::vector<std::vector<Box3>>& bounds, std::size_t level,
                       std::size_t cell) {
  std::vector<bool> tiles, contents, subtrees;
  std::vector<double> boxes, errors;
  for (std::size_t below = 0; below < kSubtreeLevels; ++below)
    for (std::size_t i = 0; i < cells_of(below); ++i) {
      const std::size_t own = level + below, number = cell * cells_of(below) + i;
      const bool is_tile = own < bounds.size() && !bounds[own][number].isEmpty();
      tiles.push_back(is_tile);
      contents.push_back(is_tile && !tree.content[own][number].isEmpty());
      if (!is_tile) continue;
      const std::array<double, 12> box = box_numbers(bounds[own][number]);
      boxes.insert(boxes.end(), box.begin(), box.end());
      errors.push_back(tree.geometric_error_m[own]);
    }
  const std::size_t next = level + kSubtreeLevels;
  for (std::size_t i = 0; i < cells_of(kSubtreeLevels); ++i)
    subtrees.push_back(next < bounds.size() && !bounds[next][cell * cells_of(kSubtreeLevels) + i].isEmpty());
  SubtreeBuffer buffer;
  json out{{"tileAvailability", buffer.availability(tiles)},
           {"contentAvailability", json::array({buffer.availability(contents)})},
           {"childSubtreeAvailability", buffer.availability(subtrees)},
           {"tileMetadata", 0}};
  const json values{{"boundingBox", {{"values", buffer.add(boxes.data(), boxes.size() * sizeof(double))}}},
                    {"geometricError", {{"values", buffer.add(errors.data(), errors.size() * sizeof(double))}}}};
  out["propertyTables"] = json::array({{{"class", "tile"}, {"count", errors.size()}, {"properties", values}}});
  return subtree_bytes(std::move(out), buffer);
}

/// 3D Tiles 1.1, "Metadata Semantics".
json schema_json() {
  const json box{{"type", "SCALAR"}, {"componentType", "FLOAT64"},      {"array", true},
                 {"count", 12},      {"semantic", "TILE_BOUNDING_BOX"}, {"required", true}};
  const json error{
      {"type", "SCALAR"}, {"componentType", "FLOAT64"}, {"semantic", "TILE_GEOMETRIC_ERROR"}, {"required", true}};
  return {{"id", "tileflight"},
          {"classes", {{"tile", {{"properties", {{"boundingBox", box}, {"geometricError", error}}}}}}}};
}

}  // namespace

std::pair<std::uint32_t, std::uint32_t> implicit_coordinates(std::size_t cell) {
  std::uint32_t x = 0, y = 0;
  for (unsigned bit = 0; bit < 32; ++bit) {
    x |= static_cast<std::uint32_t>(cell >> (2 * bit) & 1U) << bit;
    y |= static_cast<std::uint32_t>(cell >> (2 * bit + 1) & 1U) << bit;
    if (bit == 30) break;  // 62 bits of a number
  }
  return {x, y};
}

std::int64_t write_subtrees(const std::filesystem::path& folder, const ImplicitTree& tree) {
  const std::vector<std::vector<Box3>> bounds = bounds_of_cells(tree);
  std::filesystem::create_directories(folder / "subtrees");
  std::int64_t bytes = 0;
  for (std::size_t level = 0; level < bounds.size(); level += kSubtreeLevels)
    for (std::size_t cell = 0; cell < bounds[level].size(); ++cell) {
      if (bounds[level][cell].isEmpty()) continue;
      const std::string subtree = subtree_of(tree, bounds, level, cell);
      const auto [x, y] = implicit_coordinates(cell);
      const std::string name = std::to_string(level) + "-" + std::to_string(x) + "-" + std::to_string(y) + ".subtree";
      base::write_file(folder / "subtrees" / name, subtree);
      bytes += static_cast<std::int64_t>(subtree.size());
    }
  return bytes;
}

std::string implicit_tileset_json(const ImplicitTree& tree, const std::optional<geometry::SE3>& T_ecef_local) {
  const Box3 box = bounds_of_cells(tree)[0][0];
  json root{{"boundingVolume", {{"box", box_numbers(box)}}},
            {"geometricError", tree.geometric_error_m[0]},
            {"refine", "REPLACE"},
            {"content", {{"uri", "tiles/{level}-{x}-{y}.glb"}}},
            {"implicitTiling",
             {{"subdivisionScheme", "QUADTREE"},
              {"availableLevels", tree.content.size()},
              {"subtreeLevels", kSubtreeLevels},
              {"subtrees", {{"uri", "subtrees/{level}-{x}-{y}.subtree"}}}}}};
  if (T_ecef_local) {
    const geometry::Mat4 m = T_ecef_local->matrix();
    root["transform"] = std::vector<double>(m.data(), m.data() + 16);  // column-major, as in the specification
  }
  const json tileset{{"asset", {{"version", "1.1"}, {"generator", "tileflight"}}},
                     {"schema", schema_json()},
                     {"geometricError", std::max(box.diagonal().norm(), tree.geometric_error_m[0])},
                     {"root", root}};
  return tileset.dump(1);
}

namespace {

using geometry::Vec3;

json box_json(const geometry::Box3& box) {
  const Vec3 c = box.center(), h = box.sizes() / 2 + Vec3::Constant(1e-3);
  return {{"box", {c.x(), c.y(), c.z(), h.x(), 0, 0, 0, h.y(), 0, 0, 0, h.z()}}};
}

json tile_json(const TileEntry& tile) {
  json out{{"boundingVolume", box_json(tile.bounds)}, {"geometricError", tile.geometric_error_m}};
  if (!tile.uri.empty()) out["content"] = {{"uri", tile.uri}, {"boundingVolume", box_json(tile.content)}};
  for (const TileEntry& child : tile.children) out["children"].push_back(tile_json(child));
  return out;
}

}  // namespace

std::array<double, 12> box_numbers(const geometry::Box3& bounds) {
  const Vec3 c = bounds.center(), h = bounds.sizes() / 2 + Vec3::Constant(1e-3);
  return {c.x(), c.y(), c.z(), h.x(), 0, 0, 0, h.y(), 0, 0, 0, h.z()};
}

void compute_bounds(TileEntry& tile) {
  tile.bounds = tile.content;
  for (TileEntry& child : tile.children) {
    compute_bounds(child);
    tile.bounds.extend(child.bounds);
  }
}

std::string tileset_json(const TileEntry& root, const std::optional<geometry::SE3>& T_ecef_local) {
  json tile = tile_json(root);
  tile["refine"] = "REPLACE";
  if (T_ecef_local) {
    const geometry::Mat4 m = T_ecef_local->matrix();
    tile["transform"] = std::vector<double>(m.data(), m.data() + 16);  // column-major, as in the specification
  }
  const json tileset{{"asset", {{"version", "1.1"}, {"generator", "tileflight"}}},
                     {"geometricError", std::max(root.bounds.diagonal().norm(), root.geometric_error_m)},
                     {"root", tile}};
  return tileset.dump(1);
}

}  // namespace tileflight::tile_writer
