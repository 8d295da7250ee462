#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tileflight/tiles/tileset/cut_reader.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/tiles/tileset/placement.h"
#include "tileflight/tiles/tileset/selection.h"
#include "tileflight/tiles/tileset/tileset_tree.h"

namespace tileflight::tileset {

/// Summary of a content that was read. It is kept when the meshes are released.
struct ContentRecord {
  std::int64_t triangles = 0, points = 0;
  geometry::Box3 bounds;  ///< local frame
  std::vector<std::string> copyrights, warnings;
  std::string failure;  ///< empty: the content was read
};

/// Summarizes a content.
ContentRecord make_record(const LoadedContent& content);

/// Converts a record to JSON.
nlohmann::json to_json(const ContentRecord& record);
/// Converts JSON to a record. Throws nlohmann::json::exception.
ContentRecord content_record_from_json(const nlohmann::json& record);

/// Returns the result of load_region() without meshes and clouds. `records`: one for each content of the cut, in its
/// order; nullopt: it was not read. `first_warnings`: warnings of the source before any content was read. `tree`,
/// `source`: those that the contents were read from.
LoadedTiles summarize(const Placement& placement, const TileCut& cut,
                      std::span<const std::optional<ContentRecord>> records,
                      const std::vector<std::string>& first_warnings, const TilesetTree& tree,
                      const fetch::TileSource& source);

/// Returns the error for a region that lacks a part (`what`) although LoadOptions::allow_incomplete is not set.
InputError incomplete_region(const std::string& what);

}  // namespace tileflight::tileset
