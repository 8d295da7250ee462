#include "tileflight/tiles/content_records.h"

#include "tileflight/base/string_lists.h"
#include "tileflight/tile_contents/attribution.h"

namespace tileflight::tiles {

ContentRecord make_record(const LoadedContent& content) {
  ContentRecord record;
  record.failure = content.failure;
  if (!content.failure.empty()) return record;
  for (const imaging::TexturedMesh& mesh : content.meshes)
    record.triangles += static_cast<std::int64_t>(mesh.mesh.triangles.size());
  for (const geometry::PointCloud& cloud : content.clouds) record.points += static_cast<std::int64_t>(cloud.size());
  record.copyrights = content.copyrights;
  record.warnings = content.warnings;
  return record;
}

void add_records(std::span<const std::optional<ContentRecord>> records, const TilesetTree& tree,
                 const transport::TileSource& source, LoadedTiles& to) {
  tile_contents::AttributionCollector attribution;
  for (const std::optional<ContentRecord>& record : records) {
    if (!record) continue;
    if (!record->failure.empty()) {
      to.failures.push_back(record->failure);
      continue;
    }
    ++to.tiles_loaded;
    to.triangles += record->triangles;
    to.points += record->points;
    for (const std::string& copyright : record->copyrights) attribution.add(copyright);
    base::add_distinct(record->warnings, to.warnings);
  }
  to.tiles_failed = static_cast<std::int64_t>(to.failures.size());
  for (const auto& [uri, tileset] : tree.files_read()) attribution.add(tileset->copyright);
  base::add_distinct(tree.warnings(), to.warnings);
  base::add_distinct(source.warnings(), to.warnings);  // including warnings of the reads
  to.terms = source.terms();
  to.attribution = source.attribution();
  base::add_distinct(attribution.sorted_holders(), to.attribution);
  to.complete = to.tiles_failed == 0;
}

InputError incomplete_region(const std::string& what) {
  return {what, "the region is not complete (--allow-incomplete continues without this tile)"};
}

}  // namespace tileflight::tiles
