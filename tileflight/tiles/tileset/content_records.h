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

/// What a content was found to hold: what remains of it once its meshes are released.
struct ContentRecord {
  std::int64_t triangles = 0, points = 0;
  geometry::Box3 bounds;  ///< local frame
  std::vector<std::string> copyrights, warnings;
  std::string failure;  ///< empty: read
};

ContentRecord make_record(const LoadedContent& content);

nlohmann::json to_json(const ContentRecord& record);
/// Throws nlohmann::json::exception.
ContentRecord content_record_from_json(const nlohmann::json& record);

/// What load_region() says about its result, without meshes and clouds. `records`: of the cut's contents, in its order;
/// nullopt: not read. `first_warnings`: of the source before any content was read. `tree`, `source`: those that the
/// contents were read from.
LoadedTiles summarize(const Placement& placement, const TileCut& cut,
                      std::span<const std::optional<ContentRecord>> records,
                      const std::vector<std::string>& first_warnings, const TilesetTree& tree,
                      const fetch::TileSource& source);

/// The error for a region that lacks a part (`what`) although LoadOptions::allow_incomplete is not set.
InputError incomplete_region(const std::string& what);

}  // namespace tileflight::tileset
