#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/tiles/tile_content/json_reader.h"

namespace tileflight::tileset {

/// Reads a file that a buffer refers to, by its URI as written.
using ResourceReader = std::function<std::vector<std::byte>(const std::string& uri)>;

/// The two parts of a subtree file (3D Tiles 1.1, section "Subtree JSON Format"); a JSON subtree has no binary part.
struct SubtreeFile {
  std::string_view json;
  std::span<const std::byte> binary;
};

/// Throws InputError (name, cause) for a version or a size that cannot be.
SubtreeFile split_subtree_file(std::span<const std::byte> bytes, const std::string& name);

/// The buffers of a subtree and the views into them.
class SubtreeBuffers {
 public:
  /// `outside`: takes the files that buffers refer to, which the views need. All must outlive this object.
  SubtreeBuffers(const tile_content::Json& json, std::span<const std::byte> binary, const std::string& name,
                 const ResourceReader& read_resource, std::map<std::size_t, std::vector<std::byte>>& outside)
      : json_(json), binary_(binary), name_(name), read_resource_(read_resource), outside_(outside) {}

  /// The bytes of a buffer view. Throws InputError (view, cause) if there is none, or it lies outside its buffer.
  std::span<const std::byte> view(std::size_t index);

 private:
  std::span<const std::byte> buffer(std::size_t index);

  const tile_content::Json& json_;
  std::span<const std::byte> binary_;
  std::string name_;
  const ResourceReader& read_resource_;
  std::map<std::size_t, std::vector<std::byte>>& outside_;
};

}  // namespace tileflight::tileset
