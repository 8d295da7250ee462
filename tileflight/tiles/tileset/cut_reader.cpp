#include "tileflight/tiles/tileset/cut_reader.h"

#include <tbb/parallel_for.h>

#include <atomic>
#include <map>
#include <mutex>
#include <set>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/tile_content/content.h"
#include "tileflight/tiles/tile_content/shared_image_cache.h"
#include "tileflight/tiles/tileset/content_sample.h"

namespace tileflight::tileset {
namespace {

using geometry::Mat4;
using imaging::TexturedMesh;

/// A file that the cut needs, and all contents that refer to it: it is read and decoded once.
struct ContentFile {
  std::string uri;
  tile_content::UpAxis up_axis = tile_content::UpAxis::kY;
  std::vector<std::size_t> cut_indices;  ///< indices into the cut
};

std::vector<ContentFile> distinct_files(const TilesetTree& tree, const TileCut& cut) {
  std::map<std::pair<std::string, tile_content::UpAxis>, std::size_t> known;
  std::vector<ContentFile> files;
  for (std::size_t i = 0; i < cut.contents.size(); ++i) {
    const CutContent& content = cut.contents[i];
    const tile_content::UpAxis up_axis = tree.tileset(content.node).gltf_up_axis;
    const auto [it, is_new] = known.try_emplace({content.uri, up_axis}, files.size());
    if (is_new) files.push_back({content.uri, up_axis, {}});
    files[it->second].cut_indices.push_back(i);
  }
  return files;
}

/// Reads the files of a cut in parallel; results are in the cut's order.
class CutReader {
 public:
  CutReader(fetch::TileSource& source, const TilesetTree& tree, const TileCut& cut,
            const geometry::SE3& T_local_tileset, bool textures, const Progress& progress,
            std::uintmax_t max_memory_bytes)
      : source_(source),
        tree_(tree),
        cut_(cut),
        T_local_tileset_(T_local_tileset.matrix()),
        textures_(textures),
        progress_(progress),
        max_memory_bytes_(max_memory_bytes),
        images_(source) {}

  std::vector<LoadedContent> run() {
    const std::vector<ContentFile> files = distinct_files(tree_, cut_);
    contents_.resize(cut_.contents.size());
    std::vector<std::string> uris;
    for (const ContentFile& file : files) uris.push_back(file.uri);
    source_.prefetch(uris);
    // Threads take the files in the announced order, so that none waits for the last ones.
    std::atomic<std::size_t> next = 0;
    tbb::parallel_for(std::size_t{0}, files.size(), [&](std::size_t) {
      const ContentFile& file = files[next++];
      if (memory_bytes_ > max_memory_bytes_) return;
      read(file);
      advance(file.cut_indices.size());
    });
    if (memory_bytes_ <= max_memory_bytes_) return std::move(contents_);
    source_.prefetch({});
    return {};
  }

 private:
  void read(const ContentFile& file) {
    try {
      const std::vector<std::byte> bytes = fetch::read_uri(source_, file.uri);
      tile_content::DecodedContent decoded = decode(file, bytes);
      for (std::size_t i = 0; i < file.cut_indices.size(); ++i) {
        LoadedContent& content = contents_[file.cut_indices[i]];
        content.bytes = static_cast<std::int64_t>(bytes.size());
        const bool last = i + 1 == file.cut_indices.size();
        content.meshes = last ? std::move(decoded.meshes) : decoded.meshes;
        content.clouds = last ? std::move(decoded.clouds) : decoded.clouds;
        content.copyrights = decoded.copyrights;
        content.warnings = decoded.warnings;
        const Mat4 T_local_tile = T_local_tileset_ * tree_.T_tileset_tile(cut_.contents[file.cut_indices[i]].node);
        count(content);
        for (TexturedMesh& mesh : content.meshes) tile_content::transform_mesh(T_local_tile, mesh);
        for (geometry::PointCloud& cloud : content.clouds) tile_content::transform_cloud(T_local_tile, cloud);
      }
    } catch (const InputError& error) {
      for (const std::size_t place : file.cut_indices) contents_[place].failure = error.what();
    }
  }

  tile_content::DecodedContent decode(const ContentFile& file, const std::vector<std::byte>& bytes) {
    tile_content::ContentOptions content_options;
    content_options.textures = textures_;
    content_options.up_axis = file.up_axis;
    content_options.read_resource = [&](const std::string& uri) {
      return fetch::read_uri(source_, fetch::resolve_reference(source_, file.uri, uri));
    };
    content_options.read_image = [&](const std::string& uri) {
      return images_.read(fetch::resolve_reference(source_, file.uri, uri), content_options.limits.max_texture_pixels);
    };
    return tile_content::decode_content(bytes, fetch::uri_for_message(file.uri), content_options);
  }

  /// Adds to the memory in use; an image shared by meshes counts once.
  void count(const LoadedContent& content) {
    std::uintmax_t bytes = 0;
    for (const geometry::PointCloud& cloud : content.clouds) bytes += cloud.size() * sizeof(geometry::Vec3);
    for (const TexturedMesh& mesh : content.meshes) bytes += memory_bytes(mesh);
    const std::lock_guard lock(textures_mutex_);
    for (const TexturedMesh& mesh : content.meshes) {
      if (!mesh.texture || !counted_textures_.insert(mesh.texture.get()).second) continue;
      bytes += mesh.texture->pixels.size() * sizeof(imaging::Rgb8);
    }
    memory_bytes_ += bytes;
  }

  void advance(std::size_t count) {
    const std::lock_guard lock(progress_mutex_);
    done_ += static_cast<std::int64_t>(count);
    report_progress(progress_, done_, static_cast<std::int64_t>(cut_.contents.size()), "reading tiles");
  }

  fetch::TileSource& source_;
  const TilesetTree& tree_;
  const TileCut& cut_;
  Mat4 T_local_tileset_;
  bool textures_;
  const Progress& progress_;
  std::uintmax_t max_memory_bytes_;
  tile_content::SharedImageCache images_;
  std::vector<LoadedContent> contents_;
  std::atomic<std::uintmax_t> memory_bytes_ = 0;
  std::mutex textures_mutex_;
  std::set<const imaging::RgbImage*> counted_textures_;
  std::mutex progress_mutex_;
  std::int64_t done_ = 0;
};

}  // namespace

std::uintmax_t memory_bytes(const TexturedMesh& mesh) {
  constexpr std::uintmax_t kTreeBytes = 180;  // per triangle, both trees of a scene, with copies of its corners
  return imaging::vertex_bytes(mesh) + mesh.mesh.triangles.size() * (sizeof(mesh.mesh.triangles[0]) + kTreeBytes);
}

std::vector<LoadedContent> read_cut(fetch::TileSource& source, const TilesetTree& tree, const TileCut& cut,
                                    const geometry::SE3& T_local_tileset, bool textures, const Progress& progress,
                                    std::uintmax_t max_memory_bytes) {
  return CutReader(source, tree, cut, T_local_tileset, textures, progress, max_memory_bytes).run();
}

bool lacks_textures(fetch::TileSource& source, const TilesetTree& tree, const std::vector<CutContent>& contents,
                    const geometry::SE3& T_local_tileset) {
  constexpr std::size_t kMostRead = 24;
  bool has_surface = false;
  for (const std::size_t index : spread_sample(contents.size(), kMostRead)) {
    TileCut one;
    one.contents = {contents[index]};
    for (const LoadedContent& loaded : read_cut(source, tree, one, T_local_tileset, true)) {
      for (const imaging::TexturedMesh& mesh : loaded.meshes) {
        if (mesh.texture || !mesh.colors.empty()) return false;
        has_surface = has_surface || !mesh.mesh.triangles.empty();
      }
    }
  }
  return has_surface;
}

}  // namespace tileflight::tileset
