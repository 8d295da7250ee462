#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

namespace tileflight::tile_content {

using Json = nlohmann::json;

/// Type of a property's values (3D Metadata Specification 1.0, "Property"). Tilesets, subtrees and
/// EXT_structural_metadata share it.
struct MetadataProperty {
  enum class Kind { kNumber, kBoolean, kString, kEnum };

  std::string id;
  std::string semantic;  ///< "TILE_BOUNDING_BOX", …; empty: none
  Kind kind = Kind::kNumber;
  std::string component_type;    ///< "UINT8" … "FLOAT64" (of an enum: its value type); empty for strings and booleans
  std::size_t components = 1;    ///< numbers of one element: VEC3 has 3, MAT4 16
  bool is_array = false;         ///< a value holds several elements
  std::size_t array_length = 0;  ///< 0: variable length
  bool normalized = false;
  std::vector<double> offset, scale;               ///< one per component, or empty
  std::map<std::int64_t, std::string> enum_names;  ///< names of the values of a kEnum

  /// Returns the number of components in one value of fixed length.
  std::size_t fixed_components() const { return (is_array ? array_length : 1) * components; }
};

/// A class of a schema.
struct MetadataClass {
  std::vector<MetadataProperty> properties;

  /// Finds a property; nullptr if there is no such property.
  const MetadataProperty* find(const std::string& id) const;
};

/// Classes of a schema by name.
using MetadataSchema = std::map<std::string, MetadataClass>;

/// Parses a schema. Throws InputError (where, class, property, cause).
MetadataSchema parse_metadata_schema(const Json& schema, const std::string& where);

/// Returns the size in bytes of a component type ("FLOAT32": 4); 0 for an unknown type.
std::size_t component_size_bytes(const std::string& component_type);

/// Returns how many numbers an element of a glTF type has ("VEC3": 3). Throws InputError (where) if there is no such
/// type.
std::size_t component_count(const std::string& type, const std::string& where);

}  // namespace tileflight::tile_content
