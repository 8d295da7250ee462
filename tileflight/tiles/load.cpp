#include "tileflight/tiles/load.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <map>
#include <mutex>
#include <utility>

#include "tileflight/geometry/input_error.h"
#include "tileflight/tiles/attribution.h"
#include "tileflight/tiles/content.h"
#include "tileflight/tiles/placed.h"
#include "tileflight/tiles/placement.h"
#include "tileflight/tiles/selection.h"
#include "tileflight/tiles/shared_images.h"
#include "tileflight/tiles/tile_source.h"
#include "tileflight/tiles/uri.h"

namespace tileflight::tiles {
namespace {

using geometry::Mat4;
using imaging::TexturedMesh;

/// One file that the cut needs, and all places where it stands: it is read and decoded once.
struct WantedFile {
  std::string uri;
  std::string name;  ///< the first tile that names it, for messages
  UpAxis up_axis = UpAxis::kY;
  std::vector<std::size_t> places;  ///< indices into the cut
};

/// What became of a content of the cut.
struct ReadContent {
  std::vector<TexturedMesh> meshes;          ///< in the local frame
  std::vector<geometry::PointCloud> clouds;  ///< likewise
  std::vector<std::string> copyrights;
  std::vector<std::string> warnings;
  std::string failure;  ///< empty: none
};

std::vector<WantedFile> distinct_files(const TilesetTree& tree, const TileCut& cut) {
  std::map<std::pair<std::string, UpAxis>, std::size_t> known;
  std::vector<WantedFile> files;
  for (std::size_t i = 0; i < cut.contents.size(); ++i) {
    const CutContent& content = cut.contents[i];
    const UpAxis up_axis = tree.tileset(content.node).gltf_up_axis;
    const auto [it, is_new] = known.try_emplace({content.uri, up_axis}, files.size());
    if (is_new) files.push_back({content.uri, content.name, up_axis, {}});
    files[it->second].places.push_back(i);
  }
  return files;
}

/// Reads the files of a cut in parallel; results stand in the cut's order whatever the threads do.
class CutReader {
 public:
  CutReader(TileSource& source, const TilesetTree& tree, const TileCut& cut, const Placement& placement,
            const LoadOptions& options, const Progress& progress)
      : source_(source), tree_(tree), cut_(cut), options_(options), progress_(progress), images_(source) {
    T_local_tileset_ = placement.T_local_tileset.matrix();
  }

  std::vector<ReadContent> run() {
    const std::vector<WantedFile> files = distinct_files(tree_, cut_);
    contents_.resize(cut_.contents.size());
    std::vector<std::string> uris;
    for (const WantedFile& file : files) uris.push_back(file.uri);
    source_.prefetch(uris);
    // Threads take the files in the order in which they were announced, so that none waits for what comes last.
    std::atomic<std::size_t> next = 0;
    tbb::parallel_for(std::size_t{0}, files.size(), [&](std::size_t) {
      const WantedFile& file = files[next++];
      read(file);
      advance(file.places.size());
    });
    return std::move(contents_);
  }

 private:
  void read(const WantedFile& file) {
    try {
      DecodedContent decoded = decode(file);
      for (std::size_t i = 0; i < file.places.size(); ++i) {
        ReadContent& content = contents_[file.places[i]];
        const bool last = i + 1 == file.places.size();
        content.meshes = last ? std::move(decoded.meshes) : decoded.meshes;
        content.clouds = last ? std::move(decoded.clouds) : decoded.clouds;
        content.copyrights = decoded.copyrights;
        content.warnings = decoded.warnings;
        const Mat4 T_local_tile = T_local_tileset_ * tree_.node(cut_.contents[file.places[i]].node).T_tileset_tile;
        for (TexturedMesh& mesh : content.meshes) place_mesh(T_local_tile, mesh);
        for (geometry::PointCloud& cloud : content.clouds) place_cloud(T_local_tile, cloud);
      }
    } catch (const InputError& error) {
      for (const std::size_t place : file.places) contents_[place].failure = error.what();
    }
  }

  DecodedContent decode(const WantedFile& file) {
    ContentOptions content_options;
    content_options.textures = options_.textures;
    content_options.up_axis = file.up_axis;
    content_options.read_resource = [&](const std::string& uri) {
      return read_uri(source_, resolve_uri(file.uri, uri));
    };
    content_options.read_image = [&](const std::string& uri) {
      return images_.read(resolve_uri(file.uri, uri), content_options.limits.max_texture_pixels);
    };
    return decode_content(read_uri(source_, file.uri), uri_for_message(file.uri), content_options);
  }

  void advance(std::size_t count) {
    const std::lock_guard lock(progress_mutex_);
    done_ += static_cast<std::int64_t>(count);
    report_progress(progress_, done_, static_cast<std::int64_t>(cut_.contents.size()), "reading tiles");
  }

  TileSource& source_;
  const TilesetTree& tree_;
  const TileCut& cut_;
  const LoadOptions& options_;
  const Progress& progress_;
  Mat4 T_local_tileset_;
  SharedImages images_;
  std::vector<ReadContent> contents_;
  std::mutex progress_mutex_;
  std::int64_t done_ = 0;
};

void add_distinct(const std::vector<std::string>& from, std::vector<std::string>& to) {
  for (const std::string& text : from) {
    if (std::find(to.begin(), to.end(), text) == to.end()) to.push_back(text);
  }
}

/// Appends a content that was read to the result.
void collect(ReadContent&& content, LoadedTiles& out, Attribution& attribution) {
  ++out.tiles_loaded;
  for (TexturedMesh& mesh : content.meshes) {
    out.triangles += static_cast<std::int64_t>(mesh.mesh.triangles.size());
    out.meshes.push_back(std::move(mesh));
  }
  for (geometry::PointCloud& cloud : content.clouds) {
    out.points += static_cast<std::int64_t>(cloud.size());
    out.clouds.push_back(std::move(cloud));
  }
  for (const std::string& copyright : content.copyrights) attribution.add(copyright);
  add_distinct(content.warnings, out.warnings);
}

void fail(const std::string& what, const LoadOptions& options, LoadedTiles& out) {
  if (!options.allow_incomplete)
    throw InputError(what, "the region is not complete (--allow-incomplete goes on without)");
  ++out.tiles_failed;
  out.failures.push_back(what);
}

}  // namespace

LoadedTiles load_region(const std::string& source, const LoadOptions& options, const Progress& progress) {
  const std::unique_ptr<TileSource> files = open_source(source, options.source);
  return load_region(*files, shown_source(source), options, progress);
}

LoadedTiles load_region(TileSource& source, const std::string& name, const LoadOptions& options,
                        const Progress& progress) {
  for (const Use use : options.uses) require_permitted(source.terms(), use, options.source.terms_accepted, name);
  CountingSource counted(source);
  report_progress(progress, 0, 0, "reading the tileset");
  TilesetTree tree(counted);
  require_supported_extensions(tree.tileset(tree.root()), name);
  const Placement placement = place(tree, options, name);
  const TileCut cut = select_cut(tree, wanted_region(placement.region, placement.T_local_tileset, options.error_m));
  if (cut.contents.empty() && cut.failures.empty()) {
    throw InputError(name, "no tile with content meets the region " + extent_text(placement.region.box()) +
                               "; the tileset spans " + extent_text(tree));
  }

  LoadedTiles out;
  out.local_frame = placement.local_frame;
  out.region = placement.region;
  out.tiles_wanted = static_cast<std::int64_t>(cut.contents.size() + cut.failures.size());
  out.geometric_error_max_m = cut.geometric_error_max_m;
  out.cut_hash = cut.hash;
  out.warnings = placement.warnings;
  add_distinct(source.warnings(), out.warnings);
  for (const std::string& failure : cut.failures) fail(failure, options, out);

  Attribution attribution;
  std::vector<ReadContent> contents = CutReader(counted, tree, cut, placement, options, progress).run();
  for (ReadContent& content : contents) {
    if (content.failure.empty()) {
      collect(std::move(content), out, attribution);
    } else {
      fail(content.failure, options, out);
    }
  }
  for (const auto& [uri, tileset] : tree.files_read()) attribution.add(tileset->copyright);
  add_distinct(tree.warnings(), out.warnings);
  add_distinct(source.warnings(), out.warnings);  // of reading, too
  out.terms = source.terms();
  out.attribution = source.attribution();
  add_distinct(attribution.sorted(), out.attribution);
  out.complete = out.tiles_failed == 0;
  out.bytes_read = counted.bytes();
  return out;
}

}  // namespace tileflight::tiles
