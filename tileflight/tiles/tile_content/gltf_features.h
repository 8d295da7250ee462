#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/tile_content/gltf_buffers.h"
#include "tileflight/tiles/tile_content/gltf_document.h"

namespace tileflight::tile_content::gltf {

/// The property tables of a glTF (EXT_structural_metadata) as feature tables, read on first use.
class PropertyTables {
 public:
  /// All arguments must outlive this object.
  PropertyTables(const Document& document, Buffers& buffers, const ContentOptions& options, const std::string& name)
      : document_(document), buffers_(buffers), options_(options), name_(name) {}

  /// nullptr if the table does not exist or cannot be read; then one warning is added to `warnings`.
  std::shared_ptr<const imaging::FeatureTable> table(std::size_t index, std::vector<std::string>& warnings);

 private:
  std::shared_ptr<const imaging::FeatureTable> read(std::size_t index);

  const Document& document_;
  Buffers& buffers_;
  const ContentOptions& options_;
  const std::string& name_;
  std::map<std::size_t, std::shared_ptr<const imaging::FeatureTable>> tables_;
};

}  // namespace tileflight::tile_content::gltf
