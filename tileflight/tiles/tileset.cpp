#include "tileflight/tiles/tileset.h"

#include <algorithm>
#include <array>
#include <numbers>

#include "tileflight/geometry/input_error.h"
#include "tileflight/tiles/json_reader.h"
#include "tileflight/tiles/uri.h"

namespace tileflight::tiles {
namespace {

using geometry::Mat4;
using geometry::Vec3;

/// 3DTILES_implicit_tiling stands here so that the refusal can name the tile that needs it.
constexpr std::array kSupportedExtensions = {"3DTILES_content_gltf",          "3DTILES_multiple_contents",
                                             "3DTILES_implicit_tiling",       "3DTILES_metadata",
                                             "3DTILES_batch_table_hierarchy", "3DTILES_draco_point_compression"};

constexpr double kEverywhere_m = 1e9;

OrientedBox parse_box(const std::vector<double>& v) {
  OrientedBox box;
  box.center = Vec3(v[0], v[1], v[2]);
  box.half_axes << v[3], v[6], v[9], v[4], v[7], v[10], v[5], v[8], v[11];
  return box;
}

BoundingSphere parse_sphere(const std::vector<double>& v, const std::string& where) {
  if (v[3] < 0) throw InputError(where, "the radius of the bounding sphere is negative");
  return {Vec3(v[0], v[1], v[2]), v[3]};
}

GeographicRegion parse_region(const std::vector<double>& v, const std::string& where) {
  constexpr double kRounding_rad = 1e-6;
  constexpr double kPole_rad = std::numbers::pi / 2;
  constexpr double kMeridian_rad = std::numbers::pi;
  const auto within = [](double value, double limit) { return std::abs(value) <= limit + kRounding_rad; };
  if (!within(v[0], kMeridian_rad) || !within(v[2], kMeridian_rad) || !within(v[1], kPole_rad) ||
      !within(v[3], kPole_rad)) {
    throw InputError(where, "boundingVolume.region has an angle outside of its range (radians, west south east north)");
  }
  if (v[1] > v[3] || v[4] > v[5]) {
    throw InputError(where,
                     "boundingVolume.region has its south above its north, or its lowest height above its highest");
  }
  return {v[0], std::max(v[1], -kPole_rad), v[2], std::min(v[3], kPole_rad), v[4], v[5]};
}

/// nullopt where there is none of the three kinds.
std::optional<BoundingVolume> parse_volume(const Json& parent, const std::string& where) {
  const Json* json = find_object(parent, "boundingVolume", where);
  if (json == nullptr) return std::nullopt;
  if (const auto v = find_numbers(*json, "box", 12, where)) return parse_box(*v);
  if (const auto v = find_numbers(*json, "region", 6, where)) return parse_region(*v, where);
  if (const auto v = find_numbers(*json, "sphere", 4, where)) return parse_sphere(*v, where);
  return std::nullopt;
}

Mat4 parse_transform(const Json& tile, const std::string& where) {
  const auto v = find_numbers(tile, "transform", 16, where);
  if (!v) return Mat4::Identity();
  const Mat4 matrix = Eigen::Map<const Mat4>(v->data());  // column-major in both
  if (!matrix.row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1), 1e-9)) {
    throw InputError(where, "the transform is not affine: its last row is not 0 0 0 1");
  }
  return matrix;
}

std::string upper(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::toupper(c); });
  return text;
}

/// Builds the tile list; one object per file.
class TilesetParser {
 public:
  TilesetParser(const std::string& name, const TilesetLimits& limits) : name_(name), limits_(limits) {}

  Tileset parse(const Json& json) {
    if (!json.is_object()) throw InputError(name_, "is not a tileset: a JSON object is wanted");
    parse_asset(json);
    tileset_.geometric_error_m = find_number(json, "geometricError", name_);
    if (!tileset_.geometric_error_m) warn("a tileset without geometricError: that of its root is taken");
    if (tileset_.geometric_error_m.value_or(0) < 0) throw InputError(name_, "geometricError is negative");
    tileset_.extensions_used = find_strings(json, "extensionsUsed", name_);
    tileset_.extensions_required = find_strings(json, "extensionsRequired", name_);
    const Json* root = find_object(json, "root", name_);
    if (root == nullptr) throw InputError(name_, "is not a tileset: root is missing");
    parse_tiles(*root);
    return std::move(tileset_);
  }

 private:
  /// A tile that still has to be read: depth first, in the file's order.
  struct Pending {
    const Json* json;
    std::optional<std::uint32_t> parent;
    std::size_t ordinal;
  };

  void warn(const std::string& what) {
    if (std::find(tileset_.warnings.begin(), tileset_.warnings.end(), what) == tileset_.warnings.end()) {
      tileset_.warnings.push_back(what);
    }
  }

  void parse_asset(const Json& json) {
    const std::string where = name_ + ": asset";
    const Json* asset = find_object(json, "asset", name_);
    if (asset == nullptr) throw InputError(name_, "is not a tileset: asset is missing");
    tileset_.version = required(find_string(*asset, "version", where), "version", where);
    if (tileset_.version != "1.0" && tileset_.version != "1.1") {
      throw InputError(where, "3D Tiles version '" + tileset_.version + "' is not known; 1.0 and 1.1 are read");
    }
    tileset_.copyright = find_string(*asset, "copyright", where).value_or("");
    tileset_.generator = find_string(*asset, "generator", where).value_or("");
    const std::string axis = upper(find_string(*asset, "gltfUpAxis", where).value_or("Y"));
    if (axis != "X" && axis != "Y" && axis != "Z") throw InputError(where, "gltfUpAxis is none of X, Y and Z");
    tileset_.gltf_up_axis = axis == "X" ? UpAxis::kX : axis == "Y" ? UpAxis::kY : UpAxis::kZ;
    // Written by Cesium ion for models without a place on Earth; extras are free, so nothing else is asked of them.
    const Json* extras = find_member(*asset, "extras");
    const Json* ion = extras == nullptr ? nullptr : find_member(*extras, "ion");
    const auto flag = [&](const char* key) -> std::optional<bool> {
      const Json* value = ion == nullptr ? nullptr : find_member(*ion, key);
      return value != nullptr && value->is_boolean() ? std::optional(value->get<bool>()) : std::nullopt;
    };
    tileset_.georeferenced = flag("georeferenced");
    tileset_.movable = flag("movable").value_or(false);
  }

  void parse_tiles(const Json& root) {
    std::vector<Pending> pending = {{&root, std::nullopt, 0}};
    while (!pending.empty()) {
      const Pending next = pending.back();
      pending.pop_back();
      const std::uint32_t index = parse_tile(next);
      const Json* children = find_array(*next.json, "children", where_of(tileset_.tiles[index]));
      if (children == nullptr) continue;
      for (std::size_t i = children->size(); i-- > 0;) pending.push_back({&(*children)[i], index, i});
    }
  }

  std::string where_of(const Tile& tile) const { return name_ + ": tile " + tile.path; }

  std::uint32_t parse_tile(const Pending& pending) {
    const auto index = static_cast<std::uint32_t>(tileset_.tiles.size());
    Tile tile;
    tile.path = "root";
    if (pending.parent) {
      Tile& parent = tileset_.tiles[*pending.parent];
      parent.children.push_back(index);
      tile.path = parent.path + "/" + std::to_string(pending.ordinal);
      tile.level = parent.level + 1;
    }
    check_limits(tile, index);
    fill_tile(tile, *pending.json, pending.parent ? &tileset_.tiles[*pending.parent] : nullptr);
    tileset_.tiles.push_back(std::move(tile));
    return index;
  }

  void check_limits(const Tile& tile, std::size_t index) const {
    if (tile.level > limits_.max_levels) {
      throw InputError(name_, "the tree has more than " + std::to_string(limits_.max_levels) + " levels");
    }
    if (index >= limits_.max_tiles) {
      throw InputError(name_, "the tree has more than " + std::to_string(limits_.max_tiles) + " tiles");
    }
  }

  void fill_tile(Tile& tile, const Json& json, const Tile* parent) {
    const std::string where = where_of(tile);
    if (!json.is_object()) throw InputError(where, "is not an object");
    tile.T_parent_tile = parse_transform(json, where);
    tile.geometric_error_m = parse_geometric_error(json, parent, where);
    tile.refine = parse_refine(json, where);
    if (!tile.refine && parent != nullptr) tile.refine = parent->refine;
    parse_bounding_volume(tile, json, where);
    parse_contents(tile, json, where);
    parse_implicit_tiling(tile, json, where);
  }

  double parse_geometric_error(const Json& json, const Tile* parent, const std::string& where) {
    const std::optional<double> error_m = find_number(json, "geometricError", where);
    if (error_m && *error_m < 0) throw InputError(where, "geometricError is negative");
    if (error_m) return *error_m;
    warn("a tile without geometricError: that of its parent is taken");
    return parent != nullptr ? parent->geometric_error_m : tileset_.geometric_error_m.value_or(0.0);
  }

  std::optional<Refine> parse_refine(const Json& json, const std::string& where) {
    const std::optional<std::string> written = find_string(json, "refine", where);
    if (!written) return std::nullopt;
    const std::string value = upper(*written);
    if (value != "ADD" && value != "REPLACE") {
      throw InputError(where, "refine is '" + *written + "'; ADD or REPLACE wanted");
    }
    if (value != *written) warn("refine in lower case is read as " + value);
    return value == "ADD" ? Refine::kAdd : Refine::kReplace;
  }

  void parse_bounding_volume(Tile& tile, const Json& json, const std::string& where) {
    if (const std::optional<BoundingVolume> volume = parse_volume(json, where)) {
      tile.bounding_volume = *volume;
      return;
    }
    const Json* volume = find_member(json, "boundingVolume");
    const Json* extensions = volume == nullptr ? nullptr : find_object(*volume, "extensions", where);
    if (extensions == nullptr || extensions->empty()) {
      throw InputError(where, "boundingVolume has none of box, region and sphere");
    }
    // Not understood must not mean not there: it meets everything, and whoever meets it learns what is lacking.
    tile.bounding_volume = BoundingSphere{Vec3::Zero(), kEverywhere_m};
    tile.unsupported = "the bounding volume " + extensions->begin().key();
  }

  void parse_contents(Tile& tile, const Json& json, const std::string& where) {
    if (const Json* content = find_object(json, "content", where)) add_content(tile, *content, where + ": content");
    if (const Json* contents = find_array(json, "contents", where)) add_contents(tile, *contents, where + ": contents");
    // Before 1.1 several contents were an extension, with either name inside.
    const Json* extensions = find_object(json, "extensions", where);
    const Json* several =
        extensions == nullptr ? nullptr : find_object(*extensions, "3DTILES_multiple_contents", where);
    if (several == nullptr) return;
    for (const char* key : {"content", "contents"}) {
      if (const Json* contents = find_array(*several, key, where)) add_contents(tile, *contents, where + ": contents");
    }
  }

  void add_contents(Tile& tile, const Json& contents, const std::string& where) {
    for (const Json& content : contents) {
      if (!content.is_null()) add_content(tile, content, where);
    }
  }

  void add_content(Tile& tile, const Json& json, const std::string& where) {
    if (!json.is_object()) throw InputError(where, "is not an object");
    std::optional<std::string> uri = find_string(json, "uri", where);
    if (!uri) uri = find_string(json, "url", where);  // before 1.0
    if (!uri || uri->empty()) throw InputError(where, "uri is missing");
    tile.contents.push_back({*std::move(uri), parse_volume(json, where)});
  }

  static void parse_implicit_tiling(Tile& tile, const Json& json, const std::string& where) {
    const Json* extensions = find_object(json, "extensions", where);
    const Json* implicit = find_object(json, "implicitTiling", where);
    if (implicit == nullptr && extensions != nullptr)
      implicit = find_object(*extensions, "3DTILES_implicit_tiling", where);
    if (implicit == nullptr) return;
    const std::string scheme = find_string(*implicit, "subdivisionScheme", where).value_or("no scheme");
    tile.unsupported = "implicit tiling (" + scheme + ")";
  }

  std::string name_;
  TilesetLimits limits_;
  Tileset tileset_;
};

}  // namespace

Tileset parse_tileset_json(std::string_view text, const std::string& name, const TilesetLimits& limits) {
  // A level costs two brackets: the children's array and the tile's object.
  const JsonLimits json_limits{.max_bytes = limits.max_bytes, .max_depth = 2 * limits.max_levels + 64};
  return TilesetParser(name, limits).parse(parse_json(text, name, json_limits));
}

std::vector<std::string> unsupported_extensions(const Tileset& tileset) {
  std::vector<std::string> lacking;
  for (const std::string& extension : tileset.extensions_required) {
    const bool known =
        std::find(kSupportedExtensions.begin(), kSupportedExtensions.end(), extension) != kSupportedExtensions.end();
    if (!known && std::find(lacking.begin(), lacking.end(), extension) == lacking.end()) lacking.push_back(extension);
  }
  return lacking;
}

}  // namespace tileflight::tiles
