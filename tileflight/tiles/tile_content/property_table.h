#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tileflight/tiles/tile_content/metadata_schema.h"

namespace tileflight::tile_content {

/// A metadata table stored by columns (3D Metadata Specification 1.0, "Binary Table Format"), as in subtrees and
/// EXT_structural_metadata. All offsets are bounds-checked in the constructor.
class PropertyTable {
 public:
  /// Returns the bytes of a bufferView; they must outlive the table. May throw InputError.
  using View = std::function<std::span<const std::byte>(std::size_t)>;

  /// `json`: {class, count, properties}. Throws InputError (where, column, cause).
  PropertyTable(const Json& json, const MetadataSchema& schema, const View& view, const std::string& where);

  std::size_t rows() const { return rows_; }
  const std::vector<MetadataProperty>& columns() const { return properties_; }

  /// Returns all numbers of a value, with scale and offset applied; nullopt for strings, booleans and missing rows.
  std::optional<std::vector<double>> numbers(std::size_t column, std::size_t row) const;
  /// Returns a value as text: a string unchanged, an enum by its name, a number in the shortest form that round-trips,
  /// several separated by spaces.
  std::string text(std::size_t column, std::size_t row) const;

 private:
  struct Column {
    std::span<const std::byte> values;
    std::vector<std::size_t> array_ends;   ///< for arrays of varying length: rows + 1 offsets, in elements
    std::vector<std::size_t> string_ends;  ///< for strings: elements + 1 offsets, in bytes
  };

  Column read_column(const MetadataProperty& property, const Json& json, const View& view,
                     const std::string& where) const;
  /// Returns the first element and the number of elements of a row.
  std::pair<std::size_t, std::size_t> elements(std::size_t column, std::size_t row) const;

  std::size_t rows_ = 0;
  std::vector<MetadataProperty> properties_;
  std::vector<Column> columns_;
};

}  // namespace tileflight::tile_content
