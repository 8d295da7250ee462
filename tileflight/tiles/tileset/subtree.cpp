#include "tileflight/tiles/tileset/subtree.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/tiles/tile_content/json_reader.h"
#include "tileflight/tiles/tile_content/property_table.h"
#include "tileflight/tiles/tileset/tile_semantics.h"

namespace tileflight::tileset {
namespace {

using Bytes = std::span<const std::byte>;
using tile_content::find_array;
using tile_content::find_index;
using tile_content::Json;
using tile_content::require_value;

/// Reads a file that a buffer refers to, by its URI as written.
using ResourceReader = std::function<std::vector<std::byte>(const std::string& uri)>;

/// The two parts of a subtree file (3D Tiles 1.1, section "Subtree JSON Format"); a JSON subtree has no binary part.
struct SubtreeFile {
  std::string_view json;
  std::span<const std::byte> binary;
};

/// Splits a subtree file. Throws InputError (name, cause) for an unsupported version or impossible sizes.
SubtreeFile split_subtree_file(Bytes bytes, const std::string& name) {
  constexpr std::size_t kHeader = 24;
  if (!base::as_text(bytes).starts_with("subt")) return {base::as_text(bytes), {}};
  if (bytes.size() < kHeader) throw InputError(name, "truncated: the header of a subtree has 24 bytes");
  const auto version = base::read_raw<std::uint32_t>(bytes, 4);
  const auto json = base::read_raw<std::uint64_t>(bytes, 8), binary = base::read_raw<std::uint64_t>(bytes, 16);
  if (version != 1) throw InputError(name, "subtree version " + std::to_string(version) + " is not supported, only 1");
  const Bytes rest = bytes.subspan(kHeader);
  if (json > rest.size() || binary > rest.size() - json) {
    throw InputError(name, "truncated: " + std::to_string(bytes.size()) + " bytes, fewer than its header declares");
  }
  return {base::as_text(rest.first(json)), rest.subspan(json, binary)};
}

/// The buffers of a subtree and the views into them.
class SubtreeBuffers {
 public:
  /// `outside`: takes the files that buffers refer to, which the views need. All must outlive this object.
  SubtreeBuffers(const tile_content::Json& json, std::span<const std::byte> binary, const std::string& name,
                 const ResourceReader& read_resource, std::map<std::size_t, std::vector<std::byte>>& outside)
      : json_(json), binary_(binary), name_(name), read_resource_(read_resource), outside_(outside) {}

  /// The bytes of a buffer view. Throws InputError (view, cause) if there is none, or it lies outside its buffer.
  std::span<const std::byte> view(std::size_t index) {
    const std::string where = name_ + ": bufferViews[" + std::to_string(index) + "]";
    const Json* views = find_array(json_, "bufferViews", name_);
    if (views == nullptr || index >= views->size()) throw InputError(where, "does not exist");
    const Json& json = (*views)[index];
    const Bytes bytes = buffer(require_value(find_index(json, "buffer", where), "buffer", where));
    const std::size_t offset = find_index(json, "byteOffset", where).value_or(0);
    const std::size_t length = require_value(find_index(json, "byteLength", where), "byteLength", where);
    if (offset > bytes.size() || length > bytes.size() - offset) {
      throw InputError(where, "lies outside its buffer of " + std::to_string(bytes.size()) + " bytes");
    }
    return bytes.subspan(offset, length);
  }

 private:
  std::span<const std::byte> buffer(std::size_t index) {
    const std::string where = name_ + ": buffers[" + std::to_string(index) + "]";
    const Json* buffers = find_array(json_, "buffers", name_);
    if (buffers == nullptr || index >= buffers->size()) throw InputError(where, "does not exist");
    const std::optional<std::string> uri = tile_content::find_string((*buffers)[index], "uri", where);
    const std::size_t length = require_value(find_index((*buffers)[index], "byteLength", where), "byteLength", where);
    if (!uri) {
      if (length > binary_.size()) throw InputError(where, "is longer than the file's binary part");
      return binary_.first(length);
    }
    auto it = outside_.find(index);
    if (it == outside_.end()) {
      if (!read_resource_) throw InputError(where, "refers to another file, which is not available here");
      it = outside_.emplace(index, read_resource_(*uri)).first;
    }
    if (it->second.size() < length) throw InputError(where, "is shorter than declared");
    return Bytes(it->second).first(length);
  }

  const tile_content::Json& json_;
  std::span<const std::byte> binary_;
  std::string name_;
  const ResourceReader& read_resource_;
  std::map<std::size_t, std::vector<std::byte>>& outside_;
};

/// One bit for each possible tile, or one for all of them (3D Tiles 1.1, section "Availability"). A view into the
/// subtree's buffers.
class Availability {
 public:
  Availability() = default;
  /// `bits`: number of bits. Throws InputError (where, cause) if they are not there.
  Availability(const tile_content::Json& json, std::size_t bits, SubtreeBuffers& buffers, const std::string& where)
      : bits_(bits) {
    auto stream = tile_content::find_index(json, "bitstream", where);
    if (!stream) stream = tile_content::find_index(json, "bufferView", where);  // before 1.1
    const auto constant = tile_content::find_index(json, "constant", where, 1);
    if (!stream && !constant) throw InputError(where, "has no bitstream and no constant");
    if (stream && constant) throw InputError(where, "has both bitstream and constant");
    constant_ = constant.value_or(0) == 1;
    if (!stream) return;
    stream_ = buffers.view(*stream);
    if (stream_.size() < (bits + 7) / 8) {
      throw InputError(where, "its bitstream has " + std::to_string(stream_.size()) + " bytes, expected " +
                                  std::to_string((bits + 7) / 8));
    }
  }

  bool at(std::size_t index) const {
    if (stream_.empty()) return constant_;
    return (std::to_integer<unsigned>(stream_[index / 8]) >> (index % 8) & 1U) != 0;
  }
  /// Number of set bits among the first `bits`.
  std::size_t count(std::size_t bits) const {
    if (stream_.empty()) return constant_ ? bits : 0;
    std::size_t set = 0;
    for (std::size_t i = 0; i < bits / 8; ++i)
      set += static_cast<std::size_t>(std::popcount(std::to_integer<unsigned>(stream_[i])));
    return set + count(bits / 8 * 8, bits);
  }
  std::size_t count() const { return count(bits_); }
  /// Number of set bits from one index up to, not including, another.
  std::size_t count(std::size_t from, std::size_t to) const {
    std::size_t set = 0;
    for (std::size_t i = from; i < to; ++i) set += at(i) ? 1 : 0;
    return set;
  }

 private:
  std::size_t bits_ = 0;
  bool constant_ = false;
  std::span<const std::byte> stream_;
};

/// Row of an available entry in its metadata: the number of available entries before it.
class AvailabilityRank {
 public:
  AvailabilityRank() = default;
  AvailabilityRank(const Availability& availability, std::size_t bits) {
    before_.reserve(bits / kBlock + 1);
    std::size_t set = 0;
    for (std::size_t from = 0; from <= bits; from += kBlock) {
      before_.push_back(static_cast<std::uint32_t>(set));
      set += availability.count(from, std::min(from + kBlock, bits));
    }
  }

  std::size_t of(const Availability& availability, std::size_t index) const {
    return before_[index / kBlock] + availability.count(index / kBlock * kBlock, index);
  }

 private:
  static constexpr std::size_t kBlock = 128;
  std::vector<std::uint32_t> before_;  ///< available entries before each block
};

/// Limit of tiles per file, because a few bytes can declare many ("constant": 1 makes all tiles available).
constexpr std::size_t kMaxTiles = std::size_t{1} << 20;

TileSemantics semantics_of(const tile_content::PropertyTable& table, std::size_t row, const std::string& prefix,
                           const std::string& where) {
  const auto find = [&](const std::string& semantic) -> std::optional<std::size_t> {
    for (std::size_t i = 0; i < table.columns().size(); ++i) {
      if (table.columns()[i].semantic == semantic) return row < table.rows() ? std::optional(i) : std::nullopt;
    }
    return std::nullopt;
  };
  SemanticValues values;
  values.numbers = [&](const std::string& semantic) {
    const auto column = find(semantic);
    return column ? table.numbers(*column, row) : std::nullopt;
  };
  values.text = [&](const std::string& semantic) {
    const auto column = find(semantic);
    return column ? std::optional(table.text(*column, row)) : std::nullopt;
  };
  return read_semantics(prefix, values, where);
}

}  // namespace

/// The parts of a subtree file. Availabilities and tables are views into its bytes.
struct Subtree::Parts {
  std::shared_ptr<const ImplicitTiling> tiling;
  TileCoordinates root;
  std::string name;
  std::vector<std::byte> bytes;
  std::map<std::size_t, std::vector<std::byte>> outside;  ///< files that buffers refer to
  std::uint32_t levels = 0;                               ///< levels of this subtree that lie inside the tree
  std::vector<std::size_t> level_start;  ///< index of each level's first tile; then that of the child subtrees
  Availability tiles, subtrees;
  std::vector<Availability> contents;
  std::optional<tile_content::PropertyTable> tile_metadata;
  std::vector<tile_content::PropertyTable> content_metadata;
  AvailabilityRank tile_rank;
  std::vector<AvailabilityRank> content_ranks;
  std::size_t tile_count = 0;
  std::vector<std::string> warnings;

  std::size_t bits() const { return level_start.back(); }
  /// Level within the subtree.
  std::size_t level_of(std::size_t index) const {
    return static_cast<std::size_t>(std::upper_bound(level_start.begin(), level_start.end(), index) -
                                    level_start.begin()) -
           1;
  }
};

namespace {

/// Reads one file; one object per file.
class SubtreeParser {
 public:
  SubtreeParser(const tile_content::Json& json, SubtreeBuffers& buffers, Subtree::Parts& out)
      : json_(json), buffers_(buffers), tiling_(*out.tiling), name_(out.name), out_(out) {}

  void parse() {
    read_availability();
    read_metadata();
    if (!out_.tiles.at(0))
      throw InputError(name_, "its root tile is marked as unavailable, but its parent lists the subtree as available");
    out_.tile_count = count_reached();
    if (out_.tile_count < out_.tiles.count(out_.level_start[out_.levels]))
      warn("a subtree has tiles whose parents are not there; they are left out");
  }

 private:
  void warn(const std::string& what) {
    if (std::find(out_.warnings.begin(), out_.warnings.end(), what) == out_.warnings.end())
      out_.warnings.push_back(what);
  }

  void read_availability() {
    out_.levels = std::min(tiling_.subtree_levels, tiling_.available_levels - out_.root.level);
    std::size_t in_level = 1, bits = 0;
    for (std::uint32_t level = 0; level < tiling_.subtree_levels; ++level) {
      out_.level_start.push_back(bits);
      bits += in_level;
      in_level *= tiling_.children_per_tile();
    }
    out_.level_start.push_back(bits);
    const auto read = [&](const char* key, std::size_t size) {
      const tile_content::Json* json = tile_content::find_object(json_, key, name_);
      if (json == nullptr) throw InputError(name_, std::string(key) + " is missing");
      return availability(*json, size, name_ + ": " + key);
    };
    out_.tiles = read("tileAvailability", bits);
    if (out_.tiles.count(out_.level_start[out_.levels]) > kMaxTiles) {
      throw InputError(name_, "the subtree has more than " + std::to_string(kMaxTiles) + " tiles");
    }
    out_.subtrees = read("childSubtreeAvailability", in_level);
    read_content_availability();
  }

  Availability availability(const tile_content::Json& json, std::size_t bits, const std::string& where) {
    const Availability out(json, bits, buffers_, where);
    const auto count = tile_content::find_index(json, "availableCount", where);
    if (count && *count != out.count()) warn("an availableCount differs from its bits; the bits are used");
    return out;
  }

  /// A list since 1.1; previously an object, or a list in an extension if there were several.
  void read_content_availability() {
    const tile_content::Json* extensions = tile_content::find_object(json_, "extensions", name_);
    const tile_content::Json* several =
        extensions == nullptr ? nullptr : tile_content::find_member(*extensions, "3DTILES_multiple_contents");
    const tile_content::Json* contents =
        several == nullptr ? nullptr : tile_content::find_member(*several, "contentAvailability");
    if (contents == nullptr) contents = tile_content::find_member(json_, "contentAvailability");
    if (contents == nullptr) return;
    const std::string where = name_ + ": contentAvailability";
    if (!contents->is_array()) {
      out_.contents.push_back(availability(*contents, out_.bits(), where));
      return;
    }
    for (const tile_content::Json& content : *contents)
      out_.contents.push_back(availability(content, out_.bits(), where));
    if (out_.contents.size() > tiling_.content_templates.size()) {
      throw InputError(where, "has " + std::to_string(out_.contents.size()) +
                                  " contents per tile, but the tileset has " +
                                  std::to_string(tiling_.content_templates.size()));
    }
  }

  void read_metadata() {
    const tile_content::Json* tables = tile_content::find_array(json_, "propertyTables", name_);
    if (tables == nullptr || !tiling_.schema) return;
    const auto table = [&](std::size_t index) {
      const std::string where = name_ + ": propertyTables[" + std::to_string(index) + "]";
      if (index >= tables->size()) throw InputError(where, "does not exist");
      return tile_content::PropertyTable((*tables)[index], *tiling_.schema,
                                         [&](std::size_t view) { return buffers_.view(view); }, where);
    };
    if (const auto index = tile_content::find_index(json_, "tileMetadata", name_)) {
      out_.tile_metadata = table(*index);
      out_.tile_rank = AvailabilityRank(out_.tiles, out_.bits());
      if (semantics_of(*out_.tile_metadata, 0, "TILE", name_ + ": tileMetadata").has_transform) warn(kTransformWarning);
    }
    if (const auto indices = tile_content::find_numbers(json_, "contentMetadata", 0, name_)) {
      for (const double index : *indices) {
        if (!(index >= 0 && index < 1e6))
          throw InputError(name_, "contentMetadata refers to a table that does not exist");
        out_.content_metadata.push_back(table(static_cast<std::size_t>(index)));
      }
      for (const Availability& contents : out_.contents) out_.content_ranks.emplace_back(contents, out_.bits());
    }
  }

  /// Number of tiles that can be reached from the root.
  std::size_t count_reached() const {
    std::size_t count = 1;
    std::vector<std::size_t> row = {0};  // indices within a level, ascending
    for (std::uint32_t level = 0; level + 1 < out_.levels && !row.empty(); ++level) {
      std::vector<std::size_t> below;
      for (const std::size_t parent : row) {
        for (std::uint32_t child = 0; child < tiling_.children_per_tile(); ++child) {
          const std::size_t index = parent * tiling_.children_per_tile() + child;
          if (out_.tiles.at(out_.level_start[level + 1] + index)) below.push_back(index);
        }
      }
      count += below.size();
      row = std::move(below);
    }
    return count;
  }

  const tile_content::Json& json_;
  SubtreeBuffers& buffers_;
  const ImplicitTiling& tiling_;
  const std::string& name_;
  Subtree::Parts& out_;
};

void add_contents(const Subtree::Parts& parts, std::size_t index, const std::string& where, SubtreeTile& tile) {
  for (std::size_t i = 0; i < parts.contents.size(); ++i) {
    if (!parts.contents[i].at(index)) continue;
    SubtreeContent content{i, std::nullopt, std::nullopt};
    if (i < parts.content_metadata.size()) {
      const std::size_t row = parts.content_ranks[i].of(parts.contents[i], index);
      const TileSemantics own = semantics_of(parts.content_metadata[i], row, "CONTENT", where);
      content.uri = own.uri;
      if (own.bounding_volume || own.s2_cell || own.min_height_m || own.max_height_m) {
        content.bounding_volume = apply_semantics(tile.bounding_volume, own);
      }
    }
    tile.contents.push_back(std::move(content));
  }
}

}  // namespace

const std::shared_ptr<const ImplicitTiling>& Subtree::shared_tiling() const { return parts_->tiling; }
std::size_t Subtree::tile_count() const { return parts_->tile_count; }
const std::vector<std::string>& Subtree::warnings() const { return parts_->warnings; }
bool Subtree::is_child_subtree(std::uint32_t tile) const { return tile >= parts_->bits(); }

std::vector<std::uint32_t> Subtree::children(std::uint32_t tile) const {
  const std::size_t level = parts_->level_of(tile), below = level + 1;
  const bool is_last = below == parts_->tiling->subtree_levels;
  if (is_child_subtree(tile) ||
      (is_last ? parts_->root.level + below >= parts_->tiling->available_levels : below >= parts_->levels)) {
    return {};
  }
  std::vector<std::uint32_t> found;
  for (std::uint32_t child = 0; child < parts_->tiling->children_per_tile(); ++child) {
    const std::size_t in_level = (tile - parts_->level_start[level]) * parts_->tiling->children_per_tile() + child;
    const std::size_t index = parts_->level_start[below] + in_level;
    if (is_last ? parts_->subtrees.at(in_level) : parts_->tiles.at(index))
      found.push_back(static_cast<std::uint32_t>(index));
  }
  return found;
}

TileCoordinates Subtree::coordinates(std::uint32_t tile) const {
  const std::size_t level = parts_->level_of(tile), axes = parts_->tiling->octree ? 3 : 2;
  const std::size_t morton = tile - parts_->level_start[level];
  TileCoordinates out{parts_->root.level + static_cast<std::uint32_t>(level), {}};
  for (std::size_t axis = 0; axis < axes; ++axis) {
    out.xyz[axis] = parts_->root.xyz[axis] << level;
    for (std::size_t bit = 0; bit < level; ++bit)
      out.xyz[axis] |= static_cast<std::uint32_t>(morton >> (bit * axes + axis) & 1U) << bit;
  }
  return out;
}

std::optional<Refine> Subtree::refine(std::uint32_t index) const {
  if (!parts_->tile_metadata || is_child_subtree(index)) return std::nullopt;
  try {
    return tile(index).refine;
  } catch (const InputError&) {
    return std::nullopt;  // said when the tile is visited
  }
}

SubtreeTile Subtree::tile(std::uint32_t index) const {
  const ImplicitTiling& tiling = *parts_->tiling;
  SubtreeTile tile;
  tile.coordinates = coordinates(index);
  tile.bounding_volume = implicit_volume(tiling, tile.coordinates);
  tile.geometric_error_m = implicit_geometric_error_m(tiling, tile.coordinates);
  std::string where;
  if (parts_->tile_metadata || !parts_->content_metadata.empty())
    where = parts_->name + ": tile " + coordinates_text(tile.coordinates, tiling.octree);
  if (parts_->tile_metadata) {
    const TileSemantics own =
        semantics_of(*parts_->tile_metadata, parts_->tile_rank.of(parts_->tiles, index), "TILE", where);
    tile.bounding_volume = apply_semantics(tile.bounding_volume, own);
    tile.geometric_error_m = own.geometric_error_m.value_or(tile.geometric_error_m);
    tile.refine = own.refine;
  }
  add_contents(*parts_, index, where, tile);
  return tile;
}

Subtree parse_subtree(std::vector<std::byte> bytes, const ImplicitSubtree& place, const std::string& name,
                      const ResourceReader& read_resource) {
  const auto parts = std::make_shared<Subtree::Parts>();
  parts->tiling = place.tiling;
  parts->root = place.root;
  parts->name = name;
  parts->bytes = std::move(bytes);
  const SubtreeFile file = split_subtree_file(parts->bytes, name);
  const tile_content::Json json = tile_content::parse_json(file.json, name, {.max_depth = 64});
  if (!json.is_object()) throw InputError(name, "is not a subtree: expected a JSON object");
  SubtreeBuffers buffers(json, file.binary, name, read_resource, parts->outside);
  SubtreeParser(json, buffers, *parts).parse();
  Subtree subtree(parts);
  subtree.tile(0);  // what is wrong with all tiles is said here
  return subtree;
}

}  // namespace tileflight::tileset
