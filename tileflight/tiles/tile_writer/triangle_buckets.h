#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/mesh_files/mesh_spill.h"
#include "tileflight/tiles/mesh_files/record_file.h"

namespace tileflight::tile_writer {

/// Triangles sorted into buckets, on disk.
class BucketFile {
 public:
  BucketFile(const std::filesystem::path& file, std::size_t buckets)
      : file_(file),
        part_(std::clamp<std::size_t>(kBufferBytes / buckets / sizeof(mesh_files::SourceTriangle), 16, 4096)),
        buffers_(buckets),
        parts_(buckets) {}

  void add(std::size_t bucket, const mesh_files::SourceTriangle& triangle) {
    buffers_[bucket].push_back(triangle);
    if (buffers_[bucket].size() == part_) flush(bucket);
  }

  /// In the order in which they were added.
  std::vector<mesh_files::SourceTriangle> read(std::size_t bucket) {
    std::vector<mesh_files::SourceTriangle> out(parts_[bucket].size() * part_);
    for (std::size_t i = 0; i < parts_[bucket].size(); ++i)
      file_.read(parts_[bucket][i], out.data() + i * part_, part_ * sizeof(mesh_files::SourceTriangle));
    out.insert(out.end(), buffers_[bucket].begin(), buffers_[bucket].end());
    return out;
  }

 private:
  static constexpr std::size_t kBufferBytes = std::size_t{64} << 20;

  void flush(std::size_t bucket) {
    file_.write(end_, buffers_[bucket].data(), part_ * sizeof(mesh_files::SourceTriangle));
    parts_[bucket].push_back(end_);
    end_ += part_ * sizeof(mesh_files::SourceTriangle);
    buffers_[bucket].clear();
  }

  mesh_files::ScratchFile file_;
  std::size_t part_;  ///< triangles written together
  std::uint64_t end_ = 0;
  std::vector<std::vector<mesh_files::SourceTriangle>> buffers_;
  std::vector<std::vector<std::uint64_t>> parts_;  ///< their offsets
};

/// One mesh per material, with stand-ins for textures, in order of materials.
std::vector<imaging::TexturedMesh> meshes_of(std::vector<mesh_files::SourceTriangle> triangles,
                                             const std::vector<mesh_files::SurfaceAppearance>& materials);

}  // namespace tileflight::tile_writer
