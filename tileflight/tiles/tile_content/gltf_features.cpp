#include "tileflight/tiles/tile_content/gltf_features.h"

#include <algorithm>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/tiles/tile_content/json_reader.h"
#include "tileflight/tiles/tile_content/property_table.h"
#include "tileflight/tiles/tile_content/tile_table.h"
#include "tileflight/tiles/fetch/uri.h"

namespace tileflight::tile_content::gltf {
namespace {

/// Maximum number of cells of a table as text; each takes some tens of bytes, whatever its encoded size.
constexpr std::size_t kMaxTableCells = std::size_t{1} << 22;

MetadataSchema schema_of(const Json& metadata, const ContentOptions& options, const std::string& where) {
  if (const Json* schema = find_object(metadata, "schema", where)) return parse_metadata_schema(*schema, where);
  const auto uri = require_value(find_string(metadata, "schemaUri", where), "schema", where);
  if (!fetch::is_data_uri(uri) && !options.read_resource)
    throw InputError(where, "its schema is in another file, which is not supported");
  const std::vector<std::byte> text =
      fetch::is_data_uri(uri) ? fetch::decode_data_uri(uri, where) : options.read_resource(uri);
  return parse_metadata_schema(parse_json(base::as_text(text), where), where);
}

}  // namespace

std::shared_ptr<const imaging::FeatureTable> PropertyTables::table(std::size_t index,
                                                                   std::vector<std::string>& warnings) {
  const auto known = tables_.find(index);
  if (known != tables_.end()) return known->second;
  try {
    return tables_[index] = read(index);
  } catch (const InputError& error) {
    warn_once(std::string("features have no names: ") + error.what(), warnings);
    return tables_[index] = nullptr;
  }
}

std::shared_ptr<const imaging::FeatureTable> PropertyTables::read(std::size_t index) {
  const std::string where = name_ + ": EXT_structural_metadata";
  if (!document_.structural_metadata) throw InputError(where, "is missing");
  const Json& metadata = *document_.structural_metadata;
  const Json* tables = find_array(metadata, "propertyTables", where);
  if (tables == nullptr || index >= tables->size()) throw InputError(where, "the property table does not exist");
  const auto view = [&](std::size_t i) {
    if (i >= document_.views.size()) throw InputError(where, "refers to a bufferView that does not exist");
    return buffers_.view(i);
  };
  const PropertyTable rows((*tables)[index], schema_of(metadata, options_, where), view, where);
  if (rows.rows() > kMaxTableCells / std::max<std::size_t>(rows.columns().size(), 1)) {
    throw InputError(where, "has more than " + std::to_string(kMaxTableCells) + " values, which is the limit");
  }
  auto out = std::make_shared<imaging::FeatureTable>();
  out->count = rows.rows();
  for (std::size_t column = 0; column < rows.columns().size(); ++column) {
    std::vector<std::string>& texts = out->properties[rows.columns()[column].id];
    for (std::size_t row = 0; row < rows.rows(); ++row) texts.push_back(rows.text(column, row));
  }
  return out;
}

}  // namespace tileflight::tile_content::gltf
