#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/imaging/feature_table.h"
#include "tileflight/tiles/gltf_buffers.h"
#include "tileflight/tiles/gltf_document.h"

namespace tileflight::tiles::gltf {

/// The property tables of a glTF (EXT_structural_metadata) as feature tables, each read when first asked for.
class PropertyTables {
 public:
  /// All must outlive this.
  PropertyTables(const Document& document, Buffers& buffers, const ContentOptions& options, const std::string& name)
      : document_(document), buffers_(buffers), options_(options), name_(name) {}

  /// Null where there is no such table or it cannot be read; then `warnings` says why, once.
  std::shared_ptr<const imaging::FeatureTable> table(std::size_t index, std::vector<std::string>& warnings);

 private:
  std::shared_ptr<const imaging::FeatureTable> read(std::size_t index);

  const Document& document_;
  Buffers& buffers_;
  const ContentOptions& options_;
  const std::string& name_;
  std::map<std::size_t, std::shared_ptr<const imaging::FeatureTable>> tables_;
};

}  // namespace tileflight::tiles::gltf
