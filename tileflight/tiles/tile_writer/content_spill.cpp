#include "tileflight/tiles/tile_writer/content_spill.h"

#include <cassert>
#include <cstring>
#include <memory>

#include "tileflight/core/base/files.h"
#include "tileflight/tiles/mesh_files/record_file.h"

namespace tileflight::tile_writer {
namespace {

using imaging::RgbImage;
using imaging::TexturedMesh;

/// Sizes and looks of a mesh, before its arrays.
struct MeshHeader {
  std::uint64_t vertices = 0, uv = 0, colors = 0, triangles = 0;
  std::array<float, 4> base_color{};
  imaging::Wrap wrap_u{}, wrap_v{};
  bool has_texture = false;
};

/// Appends arrays to a scratch file.
class ArrayWriter {
 public:
  explicit ArrayWriter(const std::filesystem::path& file) : file_(file) {}

  template <class T>
  void add(const T* values, std::size_t count) {
    file_.write(end_, values, count * sizeof(T));
    end_ += count * sizeof(T);
  }

 private:
  mesh_files::ScratchFile file_;
  std::uint64_t end_ = 0;
};

/// Takes arrays from the front of bytes that this program wrote.
class ArrayReader {
 public:
  explicit ArrayReader(const std::filesystem::path& file) : bytes_(base::read_bytes(file, std::uintmax_t{1} << 40)) {}

  bool at_end() const { return at_ == bytes_.size(); }

  template <class T>
  std::vector<T> take(std::size_t count) {
    assert(count * sizeof(T) <= bytes_.size() - at_);
    std::vector<T> values(count);
    if (count > 0) std::memcpy(static_cast<void*>(values.data()), bytes_.data() + at_, count * sizeof(T));
    at_ += count * sizeof(T);
    return values;
  }

 private:
  std::vector<std::byte> bytes_;
  std::size_t at_ = 0;
};

TexturedMesh read_mesh(ArrayReader& in, const std::shared_ptr<const RgbImage>& texture) {
  const MeshHeader header = in.take<MeshHeader>(1)[0];
  TexturedMesh mesh;
  mesh.mesh.vertices = in.take<geometry::Vec3>(header.vertices);
  mesh.uv = in.take<Eigen::Vector2f>(header.uv);
  mesh.colors = in.take<std::array<std::uint8_t, 4>>(header.colors);
  mesh.mesh.triangles = in.take<geometry::Triangle>(header.triangles);
  mesh.base_color = header.base_color;
  mesh.wrap_u = header.wrap_u;
  mesh.wrap_v = header.wrap_v;
  if (header.has_texture) mesh.texture = texture;
  return mesh;
}

std::shared_ptr<const RgbImage> read_texture(const std::filesystem::path& file) {
  ArrayReader in(file);
  const std::vector<std::int32_t> size = in.take<std::int32_t>(2);
  auto image = std::make_shared<RgbImage>();
  image->width = size[0];
  image->height = size[1];
  image->pixels = in.take<imaging::Rgb8>(static_cast<std::size_t>(size[0]) * static_cast<std::size_t>(size[1]));
  return image;
}

}  // namespace

ContentSpill::ContentSpill(std::filesystem::path folder) : folder_(std::move(folder)) {
  std::filesystem::create_directories(folder_);
}

std::filesystem::path ContentSpill::file_of(int level, std::size_t cell, const char* what) const {
  return folder_ / (std::to_string(level) + "-" + std::to_string(cell) + what);
}

void ContentSpill::write(int level, std::size_t cell, const std::vector<TexturedMesh>& content) const {
  ArrayWriter out(file_of(level, cell, ".meshes"));
  const RgbImage* texture = nullptr;
  for (const TexturedMesh& m : content) {
    const MeshHeader header{m.mesh.vertices.size(), m.uv.size(), m.colors.size(), m.mesh.triangles.size(),
                            m.base_color,           m.wrap_u,    m.wrap_v,        m.texture != nullptr};
    out.add(&header, 1);
    out.add(m.mesh.vertices.data(), m.mesh.vertices.size());
    out.add(m.uv.data(), m.uv.size());
    out.add(m.colors.data(), m.colors.size());
    out.add(m.mesh.triangles.data(), m.mesh.triangles.size());
    assert(!m.texture || texture == nullptr || texture == m.texture.get());
    if (m.texture) texture = m.texture.get();
  }
  if (texture == nullptr) return;
  ArrayWriter texels(file_of(level, cell, ".texels"));
  const std::array<std::int32_t, 2> size{texture->width, texture->height};
  texels.add(size.data(), 2);
  texels.add(texture->pixels.data(), texture->pixels.size());
}

std::vector<TexturedMesh> ContentSpill::read(int level, std::size_t cell, bool textures) const {
  std::vector<TexturedMesh> out;
  if (!std::filesystem::exists(file_of(level, cell, ".meshes"))) return out;
  const std::filesystem::path texels = file_of(level, cell, ".texels");
  const auto texture = textures && std::filesystem::exists(texels) ? read_texture(texels) : nullptr;
  for (ArrayReader in(file_of(level, cell, ".meshes")); !in.at_end();) out.push_back(read_mesh(in, texture));
  return out;
}

void ContentSpill::remove(int level, std::size_t cell) const {
  for (const char* what : {".meshes", ".texels"}) std::filesystem::remove(file_of(level, cell, what));
}

}  // namespace tileflight::tile_writer
