#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tileflight/tiles/cut_reader.h"
#include "tileflight/tiles/load.h"
#include "tileflight/tiles/tileset_tree.h"

namespace tileflight::tiles {

/// What a content was found to hold: what remains of it once its meshes are released.
struct ContentRecord {
  std::int64_t triangles = 0, points = 0;
  geometry::Box3 bounds;  ///< local frame; empty unless whoever keeps the record measured it
  std::vector<std::string> copyrights, warnings;
  std::string failure;  ///< empty: read
};

ContentRecord make_record(const LoadedContent& content);

/// Adds the records of all contents read to a result: counts, failures, warnings, attribution, terms, completeness.
/// `records`: in the cut's order; nullopt: not read. `tree`, `source`: those that the contents were read from.
void add_records(std::span<const std::optional<ContentRecord>> records, const TilesetTree& tree,
                 const transport::TileSource& source, LoadedTiles& to);

/// The error for a region that lacks a part (`what`) although LoadOptions::allow_incomplete is not set.
InputError incomplete_region(const std::string& what);

}  // namespace tileflight::tiles
