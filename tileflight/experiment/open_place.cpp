#include "tileflight/experiment/open_place.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "tileflight/tiles/bounding_volume.h"
#include "tileflight/tiles/cut_reader.h"
#include "tileflight/tiles/open_source.h"

namespace tileflight::experiment {
namespace {

void add_distinct(const std::vector<std::string>& from, std::vector<std::string>& to) {
  for (const std::string& text : from) {
    if (std::find(to.begin(), to.end(), text) == to.end()) to.push_back(text);
  }
}

std::uintmax_t memory_of(const PlacePart& part) {
  std::uintmax_t bytes = 0;
  std::set<const void*> textures;
  for (const imaging::TexturedMesh& mesh : part.meshes) {
    bytes += tiles::memory_bytes(mesh);
    if (mesh.texture && textures.insert(mesh.texture.get()).second)
      bytes += mesh.texture->pixels.size() * sizeof(mesh.texture->pixels[0]);
  }
  for (const geometry::PointCloud& cloud : part.clouds) bytes += cloud.size() * sizeof(cloud.positions[0]);
  return bytes;
}

/// Refused before anything is read where the source's terms forbid the use.
std::unique_ptr<tiles::TileSource> permitted(std::unique_ptr<tiles::TileSource> source, tiles::Use use,
                                             const tiles::LoadOptions& load, const std::string& name) {
  tiles::require_permitted(source->terms(), use, load.source.terms_accepted, name);
  return source;
}

}  // namespace

OpenPlace::OpenPlace(const std::string& source, const tiles::LoadOptions& load, tiles::Use use)
    : name_(tiles::shown_source(source)),
      source_(permitted(tiles::open_source(source, load.source), use, load, name_)),
      tree_(*source_) {
  tiles::require_supported_extensions(tree_.tileset(tree_.root()), name_);
  placement_ = tiles::place(tree_, load, name_);
  is_georeferenced_ = tiles::is_georeferenced(tree_);
}

std::optional<PlacePart> OpenPlace::read(const tiles::TileCut& cut, bool textures, std::uintmax_t max_memory_bytes,
                                         const Progress& progress) {
  std::vector<tiles::ReadContent> contents =
      tiles::read_cut(*source_, tree_, cut, placement_.T_local_tileset, textures, progress, max_memory_bytes);
  if (contents.size() < cut.contents.size()) return std::nullopt;
  PlacePart part;
  for (const std::string& failure : cut.failures) part.missing.push_back({failure, std::nullopt});
  for (std::size_t i = 0; i < contents.size(); ++i) {
    tiles::ReadContent& content = contents[i];
    if (!content.failure.empty()) {
      const tiles::BoundingVolume volume = tree_.volume(cut.contents[i].node);
      part.missing.push_back({content.failure, tiles::bounds_local(volume, placement_.T_local_tileset)});
      continue;
    }
    ++part.tiles;
    part.file_bytes += static_cast<std::uintmax_t>(content.bytes);
    for (imaging::TexturedMesh& mesh : content.meshes) {
      if (!mesh.mesh.triangles.empty()) part.meshes.push_back(std::move(mesh));
    }
    std::move(content.clouds.begin(), content.clouds.end(), std::back_inserter(part.clouds));
    for (const std::string& copyright : content.copyrights) copyrights_.add(copyright);
    add_distinct(content.warnings, warnings_);
  }
  part.memory_bytes = memory_of(part);
  return part;
}

std::vector<std::string> OpenPlace::attribution() const {
  tiles::Attribution all = copyrights_;
  for (const auto& [uri, tileset] : tree_.files_read()) all.add(tileset->copyright);
  std::vector<std::string> names = source_->attribution();
  add_distinct(all.sorted(), names);
  return names;
}

std::vector<std::string> OpenPlace::warnings() const {
  std::vector<std::string> all = placement_.warnings;
  add_distinct(source_->warnings(), all);
  add_distinct(tree_.warnings(), all);
  add_distinct(warnings_, all);
  return all;
}

tiles::Wanted wanted_within(tiles::Wanted wanted, const geometry::Box3& box, const geometry::SE3& T_local_tileset) {
  wanted.meets = [inner = std::move(wanted.meets), box, T_local_tileset](const tiles::BoundingVolume& volume) {
    return tiles::meets(volume, T_local_tileset, box) && inner(volume);
  };
  return wanted;
}

std::string short_name(const std::string& source) {
  const std::string shown = tiles::shown_source(source);
  std::filesystem::path path(shown.substr(0, shown.find('?')));  // a URL's parameters are no name
  if (!tiles::is_network_source(source)) path = std::filesystem::absolute(path).lexically_normal();
  const auto go_up_from = [&path](const std::string& last) {
    if (path.filename() == last && path.parent_path().has_filename()) path = path.parent_path();
  };
  go_up_from("");
  go_up_from("tileset.json");
  const std::string name = path.filename().string();
  return name.empty() ? shown : name;
}

}  // namespace tileflight::experiment
