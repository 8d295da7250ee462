#include "tileflight/tiles/tileset/subtree_buffers.h"

#include <cstdint>
#include <optional>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"

namespace tileflight::tileset {

namespace {

using Bytes = std::span<const std::byte>;
using tile_content::find_array;
using tile_content::find_index;
using tile_content::Json;
using tile_content::require_value;

}  // namespace

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

Bytes SubtreeBuffers::view(std::size_t index) {
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

Bytes SubtreeBuffers::buffer(std::size_t index) {
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

}  // namespace tileflight::tileset
