#include "tileflight/tiling/obj_meshes.h"

#include <algorithm>
#include <map>
#include <memory>
#include <set>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/srgb.h"
#include "tileflight/base/text_fields.h"
#include "tileflight/imaging/image_files.h"
#include "tileflight/tiling/mtl_file.h"
#include "tileflight/tiling/obj_file.h"

namespace tileflight::tiling {
namespace {

namespace fs = std::filesystem;
using imaging::TexturedMesh;

/// Size limit: text of meshes of a hundred million triangles.
constexpr std::uintmax_t kMaxObjBytes = std::uintmax_t{1} << 36;

/// Path of a referenced file: relative to the referring file, with either kind of slash. If that does not exist (a path
/// of another machine), a file of the same name beside the referring file is used.
fs::path named_file(const fs::path& naming, std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  const fs::path path = naming.parent_path() / name;
  const fs::path beside = naming.parent_path() / fs::path(name).filename();
  std::error_code ignored;
  return !fs::exists(path, ignored) && fs::exists(beside, ignored) ? beside : path;
}

/// The material libraries of a file; later ones take precedence.
class Materials {
 public:
  Materials(const fs::path& obj, const std::vector<std::string>& libraries) {
    for (const std::string& line : libraries) {
      std::error_code ignored;
      if (fs::exists(named_file(obj, line), ignored)) {
        add(named_file(obj, line));
      } else {
        for (const std::string_view name : base::split_fields(line)) add(library(obj, line, std::string(name)));
      }
    }
  }

  struct Entry {
    MtlMaterial material;
    fs::path library;
  };

  /// nullptr if no library defines it.
  const Entry* find(const std::string& name) const {
    const auto at = entries_.find(name);
    return at == entries_.end() ? nullptr : &at->second;
  }

 private:
  static fs::path library(const fs::path& obj, const std::string& line, const std::string& name) {
    fs::path path = named_file(obj, name);
    std::error_code ignored;
    if (!fs::exists(path, ignored))
      throw InputError(obj.string(), "refers to the material library '" + line +
                                         "', which does not exist; put it beside the file, or give --no-textures");
    return path;
  }

  void add(const fs::path& file) {
    for (auto& [name, material] : parse_mtl(base::read_text(file), file.string()))
      entries_[name] = {std::move(material), file};
  }

  std::map<std::string, Entry> entries_;
};

/// Decodes each image once.
class TextureCache {
 public:
  std::shared_ptr<const imaging::RgbImage> read(const Materials::Entry& entry, const std::string& material) {
    const fs::path file = named_file(entry.library, entry.material.texture);
    auto& picture = pictures_[file];
    if (picture) return picture;
    std::error_code ignored;
    if (!fs::exists(file, ignored))
      throw InputError(entry.library.string(), "the texture '" + entry.material.texture + "' of the material '" +
                                                   material + "' does not exist (" + file.string() +
                                                   "); put it there, or give --no-textures");
    return picture = std::make_shared<const imaging::RgbImage>(imaging::read_rgb(file));
  }

 private:
  std::map<fs::path, std::shared_ptr<const imaging::RgbImage>> pictures_;
};

/// Texture coordinates in glTF's convention: v down.
void add_texture(const MtlMaterial& material, std::shared_ptr<const imaging::RgbImage> picture, TexturedMesh& mesh) {
  mesh.texture = std::move(picture);
  mesh.wrap_u = mesh.wrap_v = material.clamp ? imaging::Wrap::kClampToEdge : imaging::Wrap::kRepeat;
  for (Eigen::Vector2f& uv : mesh.uv)
    uv = {material.offset[0] + material.scale[0] * uv.x(), 1.0F - (material.offset[1] + material.scale[1] * uv.y())};
}

void apply_material_color(const MtlMaterial& material, TexturedMesh& mesh) {
  mesh.uv.clear();
  if (!mesh.colors.empty()) return;
  for (std::size_t c = 0; c < 3; ++c) mesh.base_color[c] = base::linear_from_srgb(material.color[c]);
}

/// One object per file.
class ObjMeshes {
 public:
  ObjMeshes(const fs::path& file, bool textures)
      : textures_(textures),
        obj_(parse_obj(base::read_text(file, kMaxObjBytes), file.string())),
        materials_(file, textures ? obj_.libraries : std::vector<std::string>{}) {}

  MeshSource take() {
    simplification::VertexDeduplicator joiner(obj_.faces);
    for (const simplification::FaceGroup& group : obj_.faces.groups) {
      const Materials::Entry* entry = entry_of(group.material);
      add(joiner.build_mesh(group, true), entry, group.material);
      add(joiner.build_mesh(group, false), entry, group.material);
    }
    warn_of_counts();
    return {std::move(meshes_), {}, {warnings_.begin(), warnings_.end()}};
  }

 private:
  const Materials::Entry* entry_of(const std::string& material) {
    const Materials::Entry* entry = materials_.find(material);
    if (entry == nullptr && textures_ && !material.empty())
      warnings_.insert("the material '" + material + "' is in no material library; its surfaces are white");
    return entry;
  }

  void add(TexturedMesh mesh, const Materials::Entry* entry, const std::string& name) {
    if (mesh.mesh.triangles.empty()) return;
    mesh.name = name;
    const bool has_picture = entry != nullptr && !entry->material.texture.empty();
    if (has_picture && !mesh.uv.empty()) {
      add_texture(entry->material, pictures_.read(*entry, name), mesh);
    } else {
      if (has_picture)
        warnings_.insert("faces of the textured material '" + name +
                         "' have no texture coordinates; they are shown in its colour");
      apply_material_color(entry != nullptr ? entry->material : MtlMaterial{}, mesh);
    }
    meshes_.push_back(std::move(mesh));
  }

  void warn_of_counts() {
    if (obj_.faces_left_out > 0)
      warnings_.insert(std::to_string(obj_.faces_left_out) + " faces with fewer than three corners are left out");
    if (obj_.uv_not_finite > 0) warnings_.insert("texture coordinates that are not finite are read as 0");
  }

  bool textures_;
  ObjFile obj_;
  Materials materials_;
  TextureCache pictures_;
  std::vector<TexturedMesh> meshes_;
  std::set<std::string> warnings_;
};

}  // namespace

MeshSource read_obj_meshes(const fs::path& file, bool textures) { return ObjMeshes(file, textures).take(); }

}  // namespace tileflight::tiling
