#include "tileflight/tiles/tile_content/gltf_features.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/tile_content/json_reader.h"
#include "tileflight/tiles/tile_content/property_table.h"
#include "tileflight/tiles/tile_content/tile_table.h"

namespace tileflight::tile_content::gltf {
namespace {

int texel_of(float coordinate, int count, imaging::Wrap wrap) {
  double place = std::isfinite(coordinate) ? coordinate : 0.0;
  if (wrap == imaging::Wrap::kRepeat) place -= std::floor(place);
  if (wrap == imaging::Wrap::kMirroredRepeat) {
    place = std::abs(std::remainder(place, 2.0));  // 0 at even integers, 1 at odd ones
  }
  return static_cast<int>(std::clamp(std::floor(place * count), 0.0, count - 1.0));
}

template <class T>
void append_copy(std::vector<T>& values, std::size_t components, std::size_t vertex) {
  if (values.empty()) return;
  for (std::size_t c = 0; c < components; ++c) values.push_back(T(values[vertex * components + c]));
}

std::uint32_t copy_of(std::uint32_t vertex, Geometry& geometry) {
  const auto copy = static_cast<std::uint32_t>(geometry.vertex_count());
  append_copy(geometry.positions, 3, vertex);
  append_copy(geometry.tex_coords, 2, vertex);
  append_copy(geometry.colors, geometry.color_components, vertex);
  return copy;
}

}  // namespace

std::uint32_t FeatureTexture::at(const Eigen::Vector2f& uv) const {
  const imaging::Rgb8& texel =
      (*image)(texel_of(uv.x(), image->width, wrap_u), texel_of(uv.y(), image->height, wrap_v));
  std::uint32_t id = 0;
  for (std::size_t i = 0; i < channels.size(); ++i) id |= std::uint32_t{texel[channels[i]]} << (8 * i);
  return id;
}

void assign_features_from_texture(const FeatureTexture& texture, const std::vector<Eigen::Vector2f>& uv,
                                  Geometry& geometry) {
  std::vector<std::uint32_t> ids(geometry.vertex_count(), imaging::kNoFeature);
  std::vector<bool> taken(geometry.vertex_count(), false);
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> copies;  // by vertex and feature
  for (geometry::Triangle& triangle : geometry.triangles) {
    const std::uint32_t id = texture.at((uv[triangle[0]] + uv[triangle[1]] + uv[triangle[2]]) / 3.0F);
    for (std::uint32_t& corner : triangle) {
      if (!taken[corner]) {
        taken[corner] = true;
        ids[corner] = id;
      } else if (ids[corner] != id) {
        const auto [known, is_new] = copies.try_emplace({corner, id}, 0);
        if (is_new) {
          known->second = copy_of(corner, geometry);
          ids.push_back(id);
        }
        corner = known->second;
      }
    }
  }
  geometry.feature_ids = std::move(ids);
}

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
