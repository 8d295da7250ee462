#include "tileflight/tiles/tile_content/gltf_accessors.h"

#include <map>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/tile_content/metadata_schema.h"

namespace tileflight::tile_content::gltf {
namespace {

ComponentType component_type(std::size_t code, const std::string& where) {
  switch (code) {
    case 5120:
      return ComponentType::kInt8;
    case 5121:
      return ComponentType::kUint8;
    case 5122:
      return ComponentType::kInt16;
    case 5123:
      return ComponentType::kUint16;
    case 5125:
      return ComponentType::kUint32;
    case 5126:
      return ComponentType::kFloat;
    default:
      throw InputError(where, "componentType " + std::to_string(code) + " is not defined by glTF");
  }
}

MeshoptView read_meshopt(const Json& json, const Document& document, const std::string& where) {
  MeshoptView view;
  view.buffer = require_value(find_reference(json, "buffer", document.buffers.size(), where), "buffer", where);
  view.byte_offset = find_index(json, "byteOffset", where).value_or(0);
  view.byte_length = require_value(find_index(json, "byteLength", where), "byteLength", where);
  view.byte_stride = require_value(find_index(json, "byteStride", where, 256), "byteStride", where);
  view.count = require_value(find_index(json, "count", where), "count", where);
  view.mode = require_value(find_string(json, "mode", where), "mode", where);
  view.filter = find_string(json, "filter", where).value_or("NONE");
  return view;
}

SparseAccessor read_sparse(const Json& json, const Document& document, const std::string& where) {
  const Json* indices = find_object(json, "indices", where);
  const Json* values = find_object(json, "values", where);
  if (indices == nullptr || values == nullptr) throw InputError(where, "indices or values are missing");
  SparseAccessor sparse;
  sparse.count = require_value(find_index(json, "count", where), "count", where);
  sparse.indices_view =
      require_value(find_reference(*indices, "bufferView", document.views.size(), where), "bufferView", where);
  sparse.indices_offset = find_index(*indices, "byteOffset", where).value_or(0);
  sparse.indices_type =
      component_type(require_value(find_index(*indices, "componentType", where), "componentType", where), where);
  sparse.values_view =
      require_value(find_reference(*values, "bufferView", document.views.size(), where), "bufferView", where);
  sparse.values_offset = find_index(*values, "byteOffset", where).value_or(0);
  return sparse;
}

}  // namespace

std::optional<std::size_t> find_reference(const Json& object, const char* key, std::size_t size,
                                          const std::string& where) {
  const auto index = find_index(object, key, where);
  if (index && *index >= size) {
    throw InputError(where, std::string(key) + " " + std::to_string(*index) + " does not exist; the file has " +
                                std::to_string(size));
  }
  return index;
}

const Json* find_extension(const Json& object, const char* name, const std::string& where) {
  const Json* extensions = find_object(object, "extensions", where);
  return extensions == nullptr ? nullptr : find_object(*extensions, name, where);
}

Buffer read_buffer(const Json& json, const std::string& where) {
  return {find_string(json, "uri", where), require_value(find_index(json, "byteLength", where), "byteLength", where)};
}

BufferView read_view(const Json& json, const Document& document, const std::string& where) {
  BufferView view;
  view.buffer = require_value(find_reference(json, "buffer", document.buffers.size(), where), "buffer", where);
  view.byte_offset = find_index(json, "byteOffset", where).value_or(0);
  view.byte_length = require_value(find_index(json, "byteLength", where), "byteLength", where);
  view.byte_stride = find_index(json, "byteStride", where, 252).value_or(0);
  if (const Json* ext = find_extension(json, "EXT_meshopt_compression", where))
    view.meshopt = read_meshopt(*ext, document, where);
  return view;
}

Accessor read_accessor(const Json& json, const Document& document, const std::string& where) {
  Accessor accessor;
  accessor.view = find_reference(json, "bufferView", document.views.size(), where);
  accessor.byte_offset = find_index(json, "byteOffset", where).value_or(0);
  accessor.type =
      component_type(require_value(find_index(json, "componentType", where), "componentType", where), where);
  accessor.components = component_count(require_value(find_string(json, "type", where), "type", where), where);
  accessor.count = require_value(find_index(json, "count", where), "count", where);
  accessor.normalized = find_bool(json, "normalized", where).value_or(false);
  if (const Json* s = find_object(json, "sparse", where))
    accessor.sparse = read_sparse(*s, document, where + ": sparse");
  return accessor;
}

}  // namespace tileflight::tile_content::gltf
