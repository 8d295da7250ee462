#include "tileflight/tiles/tileset/tileset.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/tile_content/json_reader.h"
#include "tileflight/tiles/tileset/tile_semantics.h"

namespace tileflight::tileset {
namespace {

using geometry::Mat4;
using geometry::Vec3;
using tile_content::find_array;
using tile_content::find_member;
using tile_content::find_number;
using tile_content::find_numbers;
using tile_content::find_object;
using tile_content::find_string;
using tile_content::find_strings;
using tile_content::find_version;
using tile_content::Json;
using tile_content::require_value;

constexpr std::array kSupportedExtensions = {"3DTILES_content_gltf",          "3DTILES_multiple_contents",
                                             "3DTILES_implicit_tiling",       "3DTILES_metadata",
                                             "3DTILES_batch_table_hierarchy", "3DTILES_draco_point_compression",
                                             "3DTILES_bounding_volume_S2",    "3DTILES_bounding_volume_cylinder"};

constexpr double kEverywhere_m = 1e9;

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
  TilesetParser(const std::string& name, const TilesetLimits& limits, const TextReader& read_text)
      : name_(name), limits_(limits), read_text_(read_text) {}

  Tileset parse(const Json& json) {
    if (!json.is_object()) throw InputError(name_, "is not a tileset: expected a JSON object");
    parse_asset(json);
    tileset_.geometric_error_m = find_number(json, "geometricError", name_);
    if (!tileset_.geometric_error_m) warn("the tileset has no geometricError; its root's is used");
    if (tileset_.geometric_error_m.value_or(0) < 0) throw InputError(name_, "geometricError is negative");
    tileset_.extensions_used = find_strings(json, "extensionsUsed", name_);
    tileset_.extensions_required = find_strings(json, "extensionsRequired", name_);
    json_ = &json;
    const Json* root = find_object(json, "root", name_);
    if (root == nullptr) throw InputError(name_, "is not a tileset: root is missing");
    parse_tiles(*root);
    return std::move(tileset_);
  }

 private:
  /// A tile still to be read: depth first, in file order.
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
    parse_version(require_value(find_version(*asset, "version", where), "version", where), where);
    tileset_.copyright = find_string(*asset, "copyright", where).value_or("");
    tileset_.generator = find_string(*asset, "generator", where).value_or("");
    const std::string axis = upper(find_string(*asset, "gltfUpAxis", where).value_or("Y"));
    if (axis != "X" && axis != "Y" && axis != "Z") throw InputError(where, "gltfUpAxis must be X, Y or Z");
    tileset_.gltf_up_axis = axis == "X"   ? tile_content::UpAxis::kX
                            : axis == "Y" ? tile_content::UpAxis::kY
                                          : tile_content::UpAxis::kZ;
    // Written by Cesium ion for models that are not georeferenced; extras are free-form, so their content is not
    // validated.
    const Json* extras = find_member(*asset, "extras");
    const Json* ion = extras == nullptr ? nullptr : find_member(*extras, "ion");
    const auto flag = [&](const char* key) -> std::optional<bool> {
      const Json* value = ion == nullptr ? nullptr : find_member(*ion, key);
      return value != nullptr && value->is_boolean() ? std::optional(value->get<bool>()) : std::nullopt;
    };
    tileset_.georeferenced = flag("georeferenced");
    tileset_.movable = flag("movable").value_or(false);
  }

  /// Several writers (DJI Terra, FME) state a version below 1.0 for what is 1.0 in all else.
  void parse_version(const std::string& written, const std::string& where) {
    const bool newer = written == "1.1" || written.starts_with("1.1.");
    const bool older = written == "1" || written == "1.0" || written.starts_with("1.0.") || written == "0" ||
                       written.starts_with("0.");
    if (!newer && !older) {
      throw InputError(where, "3D Tiles version '" + written + "' is not supported; use 1.0 or 1.1");
    }
    tileset_.version = newer ? "1.1" : "1.0";
    if (written != tileset_.version) {
      warn("3D Tiles version '" + written + "' is read as " + tileset_.version);
    }
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
    tile.viewer_request_volume = parse_volume(json, where, "viewerRequestVolume");
    apply_metadata(tile, json, where);
    parse_contents(tile, json, where);
    parse_implicit(tile, json, where);
  }

  double parse_geometric_error(const Json& json, const Tile* parent, const std::string& where) {
    const std::optional<double> error_m = find_number(json, "geometricError", where);
    if (error_m && *error_m < 0) throw InputError(where, "geometricError is negative");
    if (error_m) return *error_m;
    warn("a tile has no geometricError; its parent's is used");
    return parent != nullptr ? parent->geometric_error_m : tileset_.geometric_error_m.value_or(0.0);
  }

  std::optional<Refine> parse_refine(const Json& json, const std::string& where) {
    const std::optional<std::string> written = find_string(json, "refine", where);
    if (!written) return std::nullopt;
    const std::string value = upper(*written);
    if (value != "ADD" && value != "REPLACE") {
      throw InputError(where, "refine is '" + *written + "'; expected ADD or REPLACE");
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
      throw InputError(where, "boundingVolume has no box, region or sphere");
    }
    // An unknown volume must not be treated as missing: it intersects everything, and using it reports what is
    // unsupported.
    tile.bounding_volume = BoundingSphere{Vec3::Zero(), kEverywhere_m};
    tile.unsupported = "the bounding volume " + extensions->begin().key();
  }

  void parse_contents(Tile& tile, const Json& json, const std::string& where) {
    if (const Json* content = find_object(json, "content", where)) add_content(tile, *content, where + ": content");
    if (const Json* contents = find_array(json, "contents", where)) add_contents(tile, *contents, where + ": contents");
    // Before 1.1 several contents were an extension, in which either name occurs.
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

  /// The volume stated in a content's metadata, if any.
  std::optional<BoundingVolume> content_volume(const Tile& tile, const Json& json, const std::string& where) {
    const std::optional<BoundingVolume> written = parse_volume(json, where);
    const Json* metadata = member_or_extension(json, "metadata", "3DTILES_metadata", where);
    const auto id = metadata == nullptr ? std::nullopt : find_string(*metadata, "class", where);
    const std::shared_ptr<const tile_content::MetadataSchema> known = id ? schema() : nullptr;
    if (!known || !known->contains(*id)) return written;
    const TileSemantics own = semantics(*metadata, known->at(*id), "CONTENT", where + ": metadata");
    if (!own.bounding_volume && !own.s2_cell && !own.min_height_m && !own.max_height_m) return written;
    return apply_semantics(written.value_or(tile.bounding_volume), own);
  }

  void add_content(Tile& tile, const Json& json, const std::string& where) {
    if (!json.is_object()) throw InputError(where, "is not an object");
    std::optional<std::string> uri = find_string(json, "uri", where);
    if (!uri) uri = find_string(json, "url", where);  // before 1.0
    if (!uri || uri->empty()) return warn("a tile's content has no uri; it is read as a tile without content");
    tile.contents.push_back({*std::move(uri), content_volume(tile, json, where)});
  }

  /// An object that is a member in 1.1 and was an extension in 1.0.
  static const Json* member_or_extension(const Json& json, const char* member, const char* extension,
                                         const std::string& where) {
    if (const Json* found = find_object(json, member, where)) return found;
    const Json* extensions = find_object(json, "extensions", where);
    return extensions == nullptr ? nullptr : find_object(*extensions, extension, where);
  }

  void parse_implicit(Tile& tile, const Json& json, const std::string& where) {
    const Json* implicit = member_or_extension(json, "implicitTiling", "3DTILES_implicit_tiling", where);
    if (implicit == nullptr || !tile.unsupported.empty()) return;
    if (const Json* children = find_array(json, "children", where); children != nullptr && !children->empty()) {
      throw InputError(where, "has both implicitTiling and children");
    }
    if (std::holds_alternative<BoundingSphere>(tile.bounding_volume)) {
      throw InputError(where, "implicitTiling divides a box or a region; its bounding volume is a sphere");
    }
    if (is_cylinder(json, where)) {
      tile.unsupported = "implicit tiling of a cylinder";
      return;
    }
    auto tiling = std::make_shared<ImplicitTiling>(parse_implicit_tiling(*implicit, where + ": implicitTiling"));
    tiling->root_volume = tile.bounding_volume;
    tiling->root_geometric_error_m = tile.geometric_error_m;
    for (const Content& content : tile.contents) tiling->content_templates.push_back(content.uri);
    tiling->schema = schema();
    tile.contents.clear();
    check_templates(*tiling, where);
    tile.implicit_subtree = ImplicitSubtree{std::move(tiling), {}};
  }

  static bool is_cylinder(const Json& json, const std::string& where) {
    const Json* volume = find_object(json, "boundingVolume", where);
    const Json* extensions = volume == nullptr ? nullptr : find_object(*volume, "extensions", where);
    return extensions != nullptr && find_member(*extensions, "3DTILES_bounding_volume_cylinder") != nullptr;
  }

  static void check_templates(const ImplicitTiling& tiling, const std::string& where) {
    if (const auto* s2 = std::get_if<S2Volume>(&tiling.root_volume);
        s2 != nullptr && s2->cell.level + tiling.available_levels > kMaxS2Level + 1) {
      throw InputError(where, "subdivides an S2 cell beyond the deepest S2 level");
    }
    expand_template(tiling.subtree_template, tiling, {}, where + ": subtrees");
    for (const std::string& content : tiling.content_templates) {
      expand_template(content, tiling, {}, where + ": content");
    }
  }

  /// Applies volumes, error and refinement stated in a tile's metadata instead of its JSON.
  void apply_metadata(Tile& tile, const Json& json, const std::string& where) {
    const Json* metadata = member_or_extension(json, "metadata", "3DTILES_metadata", where);
    if (metadata == nullptr) return;
    const auto id = find_string(*metadata, "class", where);
    const std::shared_ptr<const tile_content::MetadataSchema> known = schema();
    if (!id || !known || !known->contains(*id)) return;
    const TileSemantics own = semantics(*metadata, known->at(*id), "TILE", where + ": metadata");
    if (own.has_transform) warn(kTransformWarning);
    tile.bounding_volume = apply_semantics(tile.bounding_volume, own);
    tile.geometric_error_m = own.geometric_error_m.value_or(tile.geometric_error_m);
    if (own.refine) tile.refine = own.refine;
  }

  static TileSemantics semantics(const Json& metadata, const tile_content::MetadataClass& metadata_class,
                                 const std::string& prefix, const std::string& where) {
    const Json* properties = find_object(metadata, "properties", where);
    if (properties == nullptr) return {};
    SemanticValues values;
    values.numbers = [&](const std::string& semantic) -> std::optional<std::vector<double>> {
      for (const tile_content::MetadataProperty& property : metadata_class.properties) {
        if (property.semantic != semantic) continue;
        const Json* value = find_member(*properties, property.id.c_str());
        if (value == nullptr) continue;
        if (!value->is_array()) return std::vector{*find_number(*properties, property.id.c_str(), where)};
        return find_numbers(*properties, property.id.c_str(), 0, where);
      }
      return std::nullopt;
    };
    values.text = [&](const std::string& semantic) -> std::optional<std::string> {
      for (const tile_content::MetadataProperty& property : metadata_class.properties) {
        const Json* value = property.semantic == semantic ? find_member(*properties, property.id.c_str()) : nullptr;
        if (value != nullptr) return value->is_string() ? value->get<std::string>() : value->dump();
      }
      return std::nullopt;
    };
    return read_semantics(prefix, values, where);
  }

  /// Read on first use; null if there is none or it cannot be read (then metadata is ignored).
  std::shared_ptr<const tile_content::MetadataSchema> schema() {
    if (schema_known_) return schema_;
    schema_known_ = true;
    const std::string where = name_ + ": schema";
    try {
      if (const Json* own = member_or_extension(*json_, "schema", "3DTILES_metadata", name_)) {
        const Json* inner = find_object(*own, "schema", where);  // nested one level deeper in the extension
        schema_ = std::make_shared<const tile_content::MetadataSchema>(
            tile_content::parse_metadata_schema(inner != nullptr ? *inner : *own, where));
      } else if (const auto uri = find_string(*json_, "schemaUri", name_); uri && read_text_) {
        schema_ = std::make_shared<const tile_content::MetadataSchema>(tile_content::parse_metadata_schema(
            tile_content::parse_json(read_text_(*uri), fetch::uri_for_message(*uri)), fetch::uri_for_message(*uri)));
      }
    } catch (const InputError& error) {
      warn(std::string("metadata are ignored because their schema cannot be read: ") + error.what());
    }
    return schema_;
  }

  std::string name_;
  TilesetLimits limits_;
  const TextReader& read_text_;
  const Json* json_ = nullptr;
  bool schema_known_ = false;
  std::shared_ptr<const tile_content::MetadataSchema> schema_;
  Tileset tileset_;
};

}  // namespace

Tileset parse_tileset_json(std::string_view text, const std::string& name, const TilesetLimits& limits,
                           const TextReader& read_text) {
  // Each level takes two brackets: the children's array and the tile's object.
  const tile_content::JsonLimits json_limits{.max_bytes = limits.max_bytes, .max_depth = 2 * limits.max_levels + 64};
  return TilesetParser(name, limits, read_text).parse(tile_content::parse_json(text, name, json_limits));
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

}  // namespace tileflight::tileset
