#include "tileflight/tiles/tileset/load.h"

#include <iterator>
#include <utility>

#include "tileflight/tiles/tileset/region_reader.h"

namespace tileflight::tileset {

LoadedTiles load_region(const std::string& source, const LoadOptions& options, const Progress& progress) {
  const std::unique_ptr<fetch::TileSource> files = fetch::open_source(source, options.source);
  return load_region(*files, fetch::redact_source(source), options, progress);
}

LoadedTiles load_region(fetch::TileSource& source, const std::string& name, const LoadOptions& options,
                        const Progress& progress) {
  RegionReader reader(source, name, options, progress);
  std::vector<LoadedContent> contents = reader.read(reader.all_contents(), progress);
  LoadedTiles out = reader.summary();
  for (LoadedContent& content : contents) {
    std::move(content.meshes.begin(), content.meshes.end(), std::back_inserter(out.meshes));
    std::move(content.clouds.begin(), content.clouds.end(), std::back_inserter(out.clouds));
  }
  return out;
}

}  // namespace tileflight::tileset
