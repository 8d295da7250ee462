#include "tileflight/tiles/subtree.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <string_view>

#include "tileflight/base/input_error.h"
#include "tileflight/base/raw_bytes.h"
#include "tileflight/tile_contents/json_reader.h"
#include "tileflight/tiles/tile_semantics.h"

namespace tileflight::tiles {
namespace {

using Bytes = std::span<const std::byte>;

/// Limit of tiles per file, because a few bytes can declare many ("constant": 1 makes all tiles available).
constexpr std::size_t kMaxTiles = std::size_t{1} << 20;

/// The two parts of a subtree file; a JSON subtree has no binary part.
struct SubtreeParts {
  std::string_view json;
  Bytes binary;
};

SubtreeParts parts_of(Bytes bytes, const std::string& name) {
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
  SubtreeBuffers(const tile_contents::Json& json, Bytes binary, const std::string& name,
                 const std::function<std::vector<std::byte>(const std::string&)>& read_resource)
      : json_(json), binary_(binary), name_(name), read_resource_(read_resource) {}

  Bytes view(std::size_t index) {
    const std::string where = name_ + ": bufferViews[" + std::to_string(index) + "]";
    const tile_contents::Json* views = tile_contents::find_array(json_, "bufferViews", name_);
    if (views == nullptr || index >= views->size()) throw InputError(where, "does not exist");
    const tile_contents::Json& json = (*views)[index];
    const Bytes bytes =
        buffer(tile_contents::require_value(tile_contents::find_index(json, "buffer", where), "buffer", where));
    const std::size_t offset = tile_contents::find_index(json, "byteOffset", where).value_or(0);
    const std::size_t length =
        tile_contents::require_value(tile_contents::find_index(json, "byteLength", where), "byteLength", where);
    if (offset > bytes.size() || length > bytes.size() - offset) {
      throw InputError(where, "lies outside its buffer of " + std::to_string(bytes.size()) + " bytes");
    }
    return bytes.subspan(offset, length);
  }

 private:
  Bytes buffer(std::size_t index) {
    const std::string where = name_ + ": buffers[" + std::to_string(index) + "]";
    const tile_contents::Json* buffers = tile_contents::find_array(json_, "buffers", name_);
    if (buffers == nullptr || index >= buffers->size()) throw InputError(where, "does not exist");
    const std::optional<std::string> uri = tile_contents::find_string((*buffers)[index], "uri", where);
    const std::size_t length = tile_contents::require_value(
        tile_contents::find_index((*buffers)[index], "byteLength", where), "byteLength", where);
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

  const tile_contents::Json& json_;
  Bytes binary_;
  std::string name_;
  const std::function<std::vector<std::byte>(const std::string&)>& read_resource_;
  std::map<std::size_t, std::vector<std::byte>> outside_;
};

/// One bit for each possible tile, or one for all of them (section "Availability").
class Availability {
 public:
  Availability() = default;
  /// `bits`: number of bits.
  Availability(const tile_contents::Json& json, std::size_t bits, SubtreeBuffers& buffers, const std::string& where)
      : bits_(bits) {
    auto stream = tile_contents::find_index(json, "bitstream", where);
    if (!stream) stream = tile_contents::find_index(json, "bufferView", where);  // before 1.1
    const auto constant = tile_contents::find_index(json, "constant", where, 1);
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
    for (std::size_t i = 0; i < bits; ++i) set += at(i) ? 1 : 0;
    return set;
  }
  std::size_t count() const { return count(bits_); }

 private:
  std::size_t bits_ = 0;
  bool constant_ = false;
  Bytes stream_;
};

/// Row of an available entry in its metadata: the number of available entries before it. Queried in increasing order.
class Rank {
 public:
  std::size_t of(const Availability& availability, std::size_t index) {
    for (; next_ < index; ++next_) rank_ += availability.at(next_) ? 1 : 0;
    return rank_;
  }

 private:
  std::size_t next_ = 0;
  std::size_t rank_ = 0;
};

/// Reads one file; one object per file.
class SubtreeParser {
 public:
  SubtreeParser(const tile_contents::Json& json, SubtreeBuffers& buffers, const ImplicitSubtree& place,
                const std::string& name)
      : json_(json), buffers_(buffers), tiling_(*place.tiling), root_(place.root), name_(name) {}

  Subtree parse() {
    read_availability();
    read_metadata();
    if (!tiles_.at(0))
      throw InputError(name_, "its root tile is marked as unavailable, but its parent lists the subtree as available");
    std::vector<std::size_t> row = {0};  // indices within a level, ascending
    add_tile(root_, 0, 0);
    for (std::uint32_t level = 0; level + 1 < levels_ && !row.empty(); ++level) row = add_level(level, row);
    if (levels_ == tiling_.subtree_levels) add_child_subtrees(row);
    if (reached_ < tiles_.count(level_start_[levels_]))
      warn("a subtree has tiles whose parents are not there; they are left out");
    return std::move(out_);
  }

 private:
  void warn(const std::string& what) {
    if (std::find(out_.warnings.begin(), out_.warnings.end(), what) == out_.warnings.end())
      out_.warnings.push_back(what);
  }

  void read_availability() {
    levels_ = std::min(tiling_.subtree_levels, tiling_.available_levels - root_.level);
    std::size_t in_level = 1;
    for (std::uint32_t level = 0; level < tiling_.subtree_levels; ++level) {
      level_start_.push_back(bits_);
      bits_ += in_level;
      in_level *= tiling_.children_per_tile();
    }
    level_start_.push_back(bits_);
    const auto read = [&](const char* key, std::size_t bits) {
      const tile_contents::Json* json = tile_contents::find_object(json_, key, name_);
      if (json == nullptr) throw InputError(name_, std::string(key) + " is missing");
      return availability(*json, bits, name_ + ": " + key);
    };
    tiles_ = read("tileAvailability", bits_);
    if (tiles_.count(level_start_[levels_]) > kMaxTiles) {
      throw InputError(name_, "the subtree has more than " + std::to_string(kMaxTiles) + " tiles");
    }
    subtrees_ = read("childSubtreeAvailability", in_level);
    read_content_availability();
  }

  Availability availability(const tile_contents::Json& json, std::size_t bits, const std::string& where) {
    const Availability out(json, bits, buffers_, where);
    const auto count = tile_contents::find_index(json, "availableCount", where);
    if (count && *count != out.count()) warn("an availableCount differs from its bits; the bits are used");
    return out;
  }

  /// A list since 1.1; previously an object, or a list in an extension if there were several.
  void read_content_availability() {
    const tile_contents::Json* extensions = tile_contents::find_object(json_, "extensions", name_);
    const tile_contents::Json* several =
        extensions == nullptr ? nullptr : tile_contents::find_member(*extensions, "3DTILES_multiple_contents");
    const tile_contents::Json* contents =
        several == nullptr ? nullptr : tile_contents::find_member(*several, "contentAvailability");
    if (contents == nullptr) contents = tile_contents::find_member(json_, "contentAvailability");
    if (contents == nullptr) return;
    const std::string where = name_ + ": contentAvailability";
    if (!contents->is_array()) {
      contents_.push_back(availability(*contents, bits_, where));
      return;
    }
    for (const tile_contents::Json& content : *contents) contents_.push_back(availability(content, bits_, where));
    if (contents_.size() > tiling_.content_templates.size()) {
      throw InputError(where, "has " + std::to_string(contents_.size()) + " contents per tile, but the tileset has " +
                                  std::to_string(tiling_.content_templates.size()));
    }
  }

  void read_metadata() {
    const tile_contents::Json* tables = tile_contents::find_array(json_, "propertyTables", name_);
    if (tables == nullptr || !tiling_.schema) return;
    const auto table = [&](std::size_t index) {
      const std::string where = name_ + ": propertyTables[" + std::to_string(index) + "]";
      if (index >= tables->size()) throw InputError(where, "does not exist");
      return tile_contents::PropertyTable((*tables)[index], *tiling_.schema,
                                          [&](std::size_t view) { return buffers_.view(view); }, where);
    };
    if (const auto index = tile_contents::find_index(json_, "tileMetadata", name_)) tile_metadata_ = table(*index);
    if (const auto indices = tile_contents::find_numbers(json_, "contentMetadata", 0, name_)) {
      for (const double index : *indices) {
        if (!(index >= 0 && index < 1e6))
          throw InputError(name_, "contentMetadata refers to a table that does not exist");
        content_metadata_.push_back(table(static_cast<std::size_t>(index)));
      }
    }
    content_ranks_.resize(contents_.size());
  }

  static TileSemantics semantics(const tile_contents::PropertyTable& table, std::size_t row, const std::string& prefix,
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

  /// Adds the available children of a level's tiles, in order; returns their indices within their level.
  std::vector<std::size_t> add_level(std::uint32_t level, const std::vector<std::size_t>& parents) {
    std::vector<std::size_t> row;
    const std::size_t first_parent = out_.tiles.size() - parents.size();
    for (std::size_t i = 0; i < parents.size(); ++i) {
      for (std::uint32_t child = 0; child < tiling_.children_per_tile(); ++child) {
        const std::size_t index = parents[i] * tiling_.children_per_tile() + child;
        if (!tiles_.at(level_start_[level + 1] + index)) continue;
        out_.tiles[first_parent + i].children.push_back(static_cast<std::uint32_t>(out_.tiles.size()));
        add_tile(child_coordinates(out_.tiles[first_parent + i].coordinates, child), level + 1, index);
        row.push_back(index);
      }
    }
    return row;
  }

  void add_child_subtrees(const std::vector<std::size_t>& parents) {
    if (root_.level + levels_ >= tiling_.available_levels) return;
    const std::size_t first_parent = out_.tiles.size() - parents.size();
    for (std::size_t i = 0; i < parents.size(); ++i) {
      SubtreeTile& tile = out_.tiles[first_parent + i];
      for (std::uint32_t child = 0; child < tiling_.children_per_tile(); ++child) {
        if (!subtrees_.at(parents[i] * tiling_.children_per_tile() + child)) continue;
        tile.subtrees.push_back(child_coordinates(tile.coordinates, child));
      }
    }
  }

  void add_tile(const TileCoordinates& coordinates, std::uint32_t level, std::size_t index_in_level) {
    ++reached_;
    const std::size_t index = level_start_[level] + index_in_level;
    SubtreeTile tile;
    tile.coordinates = coordinates;
    tile.bounding_volume = implicit_volume(tiling_, coordinates);
    tile.geometric_error_m = implicit_geometric_error_m(tiling_, coordinates);
    const std::string where = name_ + ": tile " + coordinates_text(coordinates, tiling_.octree);
    if (tile_metadata_) {
      const TileSemantics own = semantics(*tile_metadata_, tile_rank_.of(tiles_, index), "TILE", where);
      if (own.has_transform) warn(kTransformWarning);
      tile.bounding_volume = apply_semantics(tile.bounding_volume, own);
      tile.geometric_error_m = own.geometric_error_m.value_or(tile.geometric_error_m);
      tile.refine = own.refine;
    }
    add_contents(tile, index, where);
    out_.tiles.push_back(std::move(tile));
  }

  void add_contents(SubtreeTile& tile, std::size_t index, const std::string& where) {
    for (std::size_t i = 0; i < contents_.size(); ++i) {
      if (!contents_[i].at(index)) continue;
      SubtreeContent content{i, std::nullopt, std::nullopt};
      if (i < content_metadata_.size()) {
        const std::size_t row = content_ranks_[i].of(contents_[i], index);
        const TileSemantics own = semantics(content_metadata_[i], row, "CONTENT", where);
        content.uri = own.uri;
        if (own.bounding_volume || own.s2_cell || own.min_height_m || own.max_height_m) {
          content.bounding_volume = apply_semantics(tile.bounding_volume, own);
        }
      }
      tile.contents.push_back(std::move(content));
    }
  }

  const tile_contents::Json& json_;
  SubtreeBuffers& buffers_;
  const ImplicitTiling& tiling_;
  TileCoordinates root_;
  std::string name_;
  Subtree out_;
  std::uint32_t levels_ = 0;  ///< levels of this subtree that lie inside the tree
  std::size_t bits_ = 0;
  std::vector<std::size_t> level_start_;
  Availability tiles_, subtrees_;
  std::vector<Availability> contents_;
  std::optional<tile_contents::PropertyTable> tile_metadata_;
  std::vector<tile_contents::PropertyTable> content_metadata_;
  Rank tile_rank_;
  std::vector<Rank> content_ranks_;
  std::size_t reached_ = 0;
};

}  // namespace

Subtree parse_subtree(Bytes bytes, const ImplicitSubtree& place, const std::string& name,
                      const std::function<std::vector<std::byte>(const std::string&)>& read_resource) {
  const SubtreeParts parts = parts_of(bytes, name);
  const tile_contents::Json json = tile_contents::parse_json(parts.json, name, {.max_depth = 64});
  if (!json.is_object()) throw InputError(name, "is not a subtree: expected a JSON object");
  SubtreeBuffers buffers(json, parts.binary, name, read_resource);
  return SubtreeParser(json, buffers, place, name).parse();
}

}  // namespace tileflight::tiles
