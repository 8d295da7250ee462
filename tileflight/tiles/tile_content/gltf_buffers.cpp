#include "tileflight/tiles/tile_content/gltf_buffers.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <type_traits>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/uri.h"

namespace tileflight::tile_content::gltf {
namespace {

template <class T>
T load(const std::byte* at) {
  T value;
  std::memcpy(&value, at, sizeof(T));  // glTF is little-endian, as are all supported machines
  return value;
}

/// glTF 2.0, section 3.6.2.2: signed values below -1 are clamped.
template <class T>
float to_float(T value, bool normalized) {
  if constexpr (!std::is_integral_v<T>) {
    return value;
  } else {
    if (!normalized) return static_cast<float>(value);
    const float scaled = static_cast<float>(value) / static_cast<float>(std::numeric_limits<T>::max());
    return std::max(scaled, -1.0F);
  }
}

/// Calls `function` with a value of the component's type.
template <class Function>
void with_type(ComponentType type, const Function& function) {
  switch (type) {
    case ComponentType::kInt8:
      return function(std::int8_t{});
    case ComponentType::kUint8:
      return function(std::uint8_t{});
    case ComponentType::kInt16:
      return function(std::int16_t{});
    case ComponentType::kUint16:
      return function(std::uint16_t{});
    case ComponentType::kUint32:
      return function(std::uint32_t{});
    case ComponentType::kFloat:
      return function(float{});
  }
}

bool is_unsigned(ComponentType type) {
  return type == ComponentType::kUint8 || type == ComponentType::kUint16 || type == ComponentType::kUint32;
}

std::string part(const char* kind, std::size_t index) { return std::string(kind) + "[" + std::to_string(index) + "]"; }

}  // namespace

/// Location of an accessor's values; `data` is null if they are all zero.
struct Buffers::Elements {
  const std::byte* data = nullptr;
  std::size_t stride = 0;
};

Buffers::Buffers(const Document& document, std::span<const std::byte> binary_chunk, const ContentOptions& options,
                 const std::string& name)
    : document_(document), binary_chunk_(binary_chunk), options_(options), name_(name) {}

void Buffers::spend(std::size_t bytes, const std::string& where) {
  const std::size_t limit = options_.limits.max_decompressed_bytes;
  if (bytes > limit - spent_bytes_) {
    throw InputError(where, "exceeds the limit of " + std::to_string(limit) + " decompressed bytes per tile");
  }
  spent_bytes_ += bytes;
}

std::span<const std::byte> Buffers::buffer(std::size_t index) {
  const Buffer& declared = document_.buffers[index];
  const std::string where = name_ + ": " + part("buffers", index);
  std::span<const std::byte> bytes = binary_chunk_;
  if (declared.uri) {
    auto it = outside_buffers_.find(index);
    if (it == outside_buffers_.end()) {
      if (!fetch::is_data_uri(*declared.uri) && !options_.read_resource) {
        throw InputError(where, "refers to another file, which is not available here");
      }
      std::vector<std::byte> read = fetch::is_data_uri(*declared.uri) ? fetch::decode_data_uri(*declared.uri, where)
                                                                      : options_.read_resource(*declared.uri);
      it = outside_buffers_.emplace(index, std::move(read)).first;
    }
    bytes = it->second;
  } else if (index != 0) {
    throw InputError(where, "has no uri, but only the first buffer can be the binary chunk");
  }
  if (bytes.size() < declared.byte_length) {
    throw InputError(where,
                     "has " + std::to_string(bytes.size()) + " bytes of " + std::to_string(declared.byte_length));
  }
  return bytes;
}

std::span<const std::byte> Buffers::slice(std::size_t buffer_index, std::size_t offset, std::size_t length,
                                          const std::string& where) {
  const std::span<const std::byte> bytes = buffer(buffer_index);
  if (offset > bytes.size() || length > bytes.size() - offset) {
    throw InputError(where, "bytes " + std::to_string(offset) + " to " + std::to_string(offset + length) +
                                " lie outside its buffer of " + std::to_string(bytes.size()));
  }
  return bytes.subspan(offset, length);
}

std::span<const std::byte> Buffers::view(std::size_t index) {
  const BufferView& view = document_.views[index];
  const std::string where = name_ + ": " + part("bufferViews", index);
  if (!view.meshopt) return slice(view.buffer, view.byte_offset, view.byte_length, where);
  const auto it = decompressed_views_.find(index);
  if (it != decompressed_views_.end()) return it->second;
  return decompressed_views_.emplace(index, decompress(*view.meshopt, where)).first->second;
}

/// EXT_meshopt_compression, "Compressed data". The library only asserts its preconditions, so they are all checked
/// here.
std::vector<std::byte> Buffers::decompress(const MeshoptView& view, const std::string& where) {
  const std::span<const std::byte> packed = slice(view.buffer, view.byte_offset, view.byte_length, where);
  const bool attributes = view.mode == "ATTRIBUTES";
  const bool indices = view.mode == "TRIANGLES" || view.mode == "INDICES";
  const bool attribute_stride = view.byte_stride > 0 && view.byte_stride % 4 == 0 && view.byte_stride <= 256;
  const bool index_stride = view.byte_stride == 2 || view.byte_stride == 4;
  const bool valid =
      (attributes && attribute_stride) || (indices && index_stride && (view.mode == "INDICES" || view.count % 3 == 0));
  if (!valid) throw InputError(where, "EXT_meshopt_compression: mode, stride and count do not match");
  if (view.count > options_.limits.max_decompressed_bytes / view.byte_stride) {
    throw InputError(where, "EXT_meshopt_compression: more elements than the limit on decompressed bytes allows");
  }
  spend(view.count * view.byte_stride, where);
  std::vector<std::byte> out(view.count * view.byte_stride);
  const auto* source = reinterpret_cast<const unsigned char*>(packed.data());
  int failed = 0;
  if (attributes) {
    failed = meshopt_decodeVertexBuffer(out.data(), view.count, view.byte_stride, source, packed.size());
  } else if (view.mode == "TRIANGLES") {
    failed = meshopt_decodeIndexBuffer(out.data(), view.count, view.byte_stride, source, packed.size());
  } else {
    failed = meshopt_decodeIndexSequence(out.data(), view.count, view.byte_stride, source, packed.size());
  }
  if (failed != 0) throw InputError(where, "EXT_meshopt_compression: malformed data");
  if (attributes && view.filter == "OCTAHEDRAL" && (view.byte_stride == 4 || view.byte_stride == 8)) {
    meshopt_decodeFilterOct(out.data(), view.count, view.byte_stride);
  } else if (attributes && view.filter == "QUATERNION" && view.byte_stride == 8) {
    meshopt_decodeFilterQuat(out.data(), view.count, view.byte_stride);
  } else if (attributes && view.filter == "EXPONENTIAL") {
    meshopt_decodeFilterExp(out.data(), view.count, view.byte_stride);
  } else if (view.filter != "NONE") {
    throw InputError(where, "EXT_meshopt_compression: the filter does not match mode and stride");
  }
  return out;
}

Buffers::Elements Buffers::elements(const Accessor& accessor, const std::string& where) {
  const std::size_t element_size = component_size(accessor.type) * accessor.components;
  if (!accessor.view) {
    if (accessor.count > options_.limits.max_decompressed_bytes / element_size) {
      throw InputError(where, "declares more zeros than the limit on decompressed bytes allows");
    }
    spend(accessor.count * element_size, where);
    return {};
  }
  const std::span<const std::byte> bytes = view(*accessor.view);
  const BufferView& v = document_.views[*accessor.view];
  const std::size_t declared_stride = v.meshopt ? v.meshopt->byte_stride : v.byte_stride;
  const std::size_t stride = declared_stride == 0 ? element_size : declared_stride;
  if (stride < element_size) throw InputError(where, "its elements overlap: the stride is smaller than one of them");
  // Counts and offsets are below 2^53 and strides below 2^9, so this does not overflow.
  const std::size_t needed =
      accessor.count == 0 ? 0 : accessor.byte_offset + (accessor.count - 1) * stride + element_size;
  if (needed > bytes.size()) {
    throw InputError(where,
                     "needs " + std::to_string(needed) + " bytes, its bufferView has " + std::to_string(bytes.size()));
  }
  return {bytes.data() + accessor.byte_offset, stride};
}

std::vector<float> Buffers::floats(std::size_t index, std::size_t components) {
  const Accessor& accessor = document_.accessors[index];
  const std::string where = name_ + ": " + part("accessors", index);
  if (accessor.components != components) {
    throw InputError(
        where, "has " + std::to_string(accessor.components) + " components, expected " + std::to_string(components));
  }
  const Elements from = elements(accessor, where);
  std::vector<float> out(accessor.count * components, 0.0F);
  if (from.data != nullptr) {
    with_type(accessor.type, [&]<class T>(T) {
      for (std::size_t i = 0; i < accessor.count; ++i) {
        for (std::size_t c = 0; c < components; ++c) {
          out[i * components + c] = to_float(load<T>(from.data + i * from.stride + c * sizeof(T)), accessor.normalized);
        }
      }
    });
  }
  const auto convert = [&](auto value) { return to_float(value, accessor.normalized); };
  if (accessor.sparse) apply_sparse(accessor, out, convert, where);
  return out;
}

template <class Out, class Convert>
void Buffers::apply_sparse(const Accessor& accessor, std::vector<Out>& values, const Convert& convert,
                           const std::string& where) {
  const SparseAccessor& sparse = *accessor.sparse;
  if (!is_unsigned(sparse.indices_type)) throw InputError(where, "sparse indices are not unsigned integers");
  const Accessor at{.view = sparse.indices_view,
                    .byte_offset = sparse.indices_offset,
                    .type = sparse.indices_type,
                    .components = 1,
                    .count = sparse.count,
                    .normalized = false,
                    .sparse = std::nullopt};
  const Accessor what{.view = sparse.values_view,
                      .byte_offset = sparse.values_offset,
                      .type = accessor.type,
                      .components = accessor.components,
                      .count = sparse.count,
                      .normalized = false,
                      .sparse = std::nullopt};
  const Elements places = elements(at, where + ": sparse indices");
  const Elements news = elements(what, where + ": sparse values");
  for (std::size_t i = 0; i < sparse.count; ++i) {
    std::size_t place = 0;
    with_type(at.type, [&]<class T>(T) { place = static_cast<std::size_t>(load<T>(places.data + i * places.stride)); });
    if (place >= accessor.count) throw InputError(where, "a sparse index lies outside the accessor");
    with_type(accessor.type, [&]<class T>(T) {
      for (std::size_t c = 0; c < accessor.components; ++c) {
        values[place * accessor.components + c] = convert(load<T>(news.data + i * news.stride + c * sizeof(T)));
      }
    });
  }
}

std::vector<std::uint32_t> Buffers::indices(std::size_t index) {
  const Accessor& accessor = document_.accessors[index];
  const std::string where = name_ + ": " + part("accessors", index);
  if (accessor.components != 1 || !is_unsigned(accessor.type)) {
    throw InputError(where, "must be a list of unsigned integers, since it holds indices");
  }
  const Elements from = elements(accessor, where);
  std::vector<std::uint32_t> out(accessor.count, 0);
  if (from.data != nullptr) {
    with_type(accessor.type, [&]<class T>(T) {
      for (std::size_t i = 0; i < accessor.count; ++i) {
        out[i] = static_cast<std::uint32_t>(load<T>(from.data + i * from.stride));
      }
    });
  }
  const auto convert = [](auto value) { return static_cast<std::uint32_t>(value); };
  if (accessor.sparse) apply_sparse(accessor, out, convert, where);
  return out;
}

std::vector<std::uint32_t> Buffers::ids(std::size_t index) {
  const Accessor& accessor = document_.accessors[index];
  if (is_unsigned(accessor.type) && accessor.components == 1) return indices(index);
  const std::vector<float> values = floats(index, 1);
  std::vector<std::uint32_t> out(values.size());
  std::transform(values.begin(), values.end(), out.begin(), id_from_float);
  return out;
}

std::uint32_t id_from_float(float value) {
  const bool is_id = value >= 0.0F && value < 4294967040.0F;
  return is_id ? static_cast<std::uint32_t>(value + 0.5F) : imaging::kNoFeature;
}

}  // namespace tileflight::tile_content::gltf
