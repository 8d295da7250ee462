#include "tileflight/tiles/mesh_files/obj_meshes.h"

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <set>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/srgb.h"
#include "tileflight/core/base/text_fields.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/tiles/mesh_files/mapped_file.h"
#include "tileflight/tiles/mesh_files/obj_file.h"

namespace tileflight::mesh_files {
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

/// Reads an image file, or finds it read.
using ImageReader = std::function<std::shared_ptr<const imaging::RgbImage>(const fs::path&)>;

/// Decodes each image once.
class ImagesInMemory {
 public:
  std::shared_ptr<const imaging::RgbImage> read(const fs::path& file) {
    auto& picture = pictures_[file];
    if (!picture) picture = std::make_shared<const imaging::RgbImage>(imaging::read_rgb(file));
    return picture;
  }

 private:
  std::map<fs::path, std::shared_ptr<const imaging::RgbImage>> pictures_;
};

/// How the materials of a file look, and what is to be warned of.
class ObjLooks {
 public:
  ObjLooks(const fs::path& file, const ObjNotes& notes, bool textures, ImageReader read_image)
      : textures_(textures),
        materials_(file, textures ? notes.libraries : std::vector<std::string>{}),
        read_image_(std::move(read_image)) {
    if (notes.faces_left_out > 0)
      warnings_.insert(std::to_string(notes.faces_left_out) + " faces with fewer than three corners are left out");
    if (notes.uv_not_finite > 0) warnings_.insert("texture coordinates that are not finite are read as 0");
  }

  /// Of the triangles of a material with texture coordinates, or of those without.
  SurfaceAppearance look(const std::string& name, bool with_uv, bool has_colors) {
    const Materials::Entry* entry = materials_.find(name);
    if (entry == nullptr && textures_ && !name.empty())
      warnings_.insert("the material '" + name + "' is in no material library; its surfaces are white");
    const MtlMaterial material = entry != nullptr ? entry->material : MtlMaterial{};
    SurfaceAppearance out;
    out.has_colors = has_colors;
    out.v_up = true;
    if (!material.texture.empty() && with_uv) {
      out.texture = texture(*entry, name);
      out.wrap_u = out.wrap_v = material.clamp ? imaging::Wrap::kClampToEdge : imaging::Wrap::kRepeat;
      out.uv_scale = material.scale;
      out.uv_offset = material.offset;
      return out;
    }
    if (!material.texture.empty())
      warnings_.insert("faces of the textured material '" + name +
                       "' have no texture coordinates; they are shown in its colour");
    for (std::size_t c = 0; c < 3 && !has_colors; ++c) out.base_color[c] = base::linear_from_srgb(material.color[c]);
    return out;
  }

  const std::set<std::string>& warnings() const { return warnings_; }

 private:
  std::shared_ptr<const imaging::RgbImage> texture(const Materials::Entry& entry, const std::string& name) const {
    const fs::path file = named_file(entry.library, entry.material.texture);
    std::error_code ignored;
    if (!fs::exists(file, ignored))
      throw InputError(entry.library.string(), "the texture '" + entry.material.texture + "' of the material '" + name +
                                                   "' does not exist (" + file.string() +
                                                   "); put it there, or give --no-textures");
    return read_image_(file);
  }

  bool textures_;
  Materials materials_;
  ImageReader read_image_;
  std::set<std::string> warnings_;
};

/// Gives a mesh, whose texture coordinates are the file's, its appearance.
void apply(const SurfaceAppearance& look, TexturedMesh& mesh) {
  mesh.texture = look.texture;
  mesh.wrap_u = look.wrap_u;
  mesh.wrap_v = look.wrap_v;
  mesh.base_color = look.base_color;
  if (!look.texture) mesh.uv.clear();
  for (Eigen::Vector2f& uv : mesh.uv) uv = look.uv(uv);
}

/// Adds the images that a library refers to, as far as both exist.
void add_images_of(const fs::path& library, std::set<fs::path>& images) {
  std::error_code ignored;
  if (!fs::is_regular_file(library, ignored)) return;
  for (const auto& [name, material] : parse_mtl(base::read_text(library), library.string()))
    if (const fs::path image = named_file(library, material.texture); fs::is_regular_file(image, ignored))
      images.insert(image);
}

}  // namespace

MeshSource read_obj_meshes(const fs::path& file, bool textures) {
  const ObjFile obj = parse_obj(base::read_text(file, kMaxObjBytes), file.string());
  ImagesInMemory images;
  ObjLooks looks(file, obj.notes, textures, [&](const fs::path& image) { return images.read(image); });
  VertexDeduplicator joiner(obj.faces);
  MeshSource out;
  for (const FaceGroup& group : obj.faces.groups)
    for (const bool with_uv : {true, false}) {
      TexturedMesh mesh = joiner.build_mesh(group, with_uv);
      if (mesh.mesh.triangles.empty()) continue;
      mesh.name = group.material;
      apply(looks.look(group.material, with_uv, !obj.faces.colors.empty()), mesh);
      out.meshes.push_back(std::move(mesh));
    }
  out.warnings.assign(looks.warnings().begin(), looks.warnings().end());
  return out;
}

void spill_obj_meshes(const fs::path& file, bool textures, MeshSpill& spill) {
  const MappedFile mapped(file, kMaxObjBytes);
  SpillReceiver faces(spill, file.string());
  const ObjNotes notes = visit_obj(mapped.text(), file.string(), faces, [&] { mapped.release(); });
  ObjLooks looks(file, notes, textures, [&](const fs::path& image) { return spill.image(image); });
  faces.finish(obj_color_scale, [&](const std::string& material, bool with_uv) {
    return looks.look(material, with_uv, faces.has_colors());
  });
  for (const std::string& warning : looks.warnings()) spill.warn(warning);
}

std::vector<fs::path> obj_image_files(const fs::path& file) {
  constexpr std::string_view kLibrary = "mtllib";
  constexpr std::size_t kPart = std::size_t{16} << 20, kLongestLine = std::size_t{1} << 16;
  const MappedFile mapped(file, kMaxObjBytes);
  std::set<fs::path> images;
  for (std::size_t begin = 0; begin < mapped.text().size(); begin += kPart) {
    const std::string_view part = mapped.text().substr(begin, kPart + kLongestLine);
    for (std::size_t at = part.find(kLibrary); at < kPart; at = part.find(kLibrary, at + 1)) {
      std::string_view rest = part.substr(at + kLibrary.size());
      add_images_of(named_file(file, std::string(base::trim(base::take_line(rest).value_or("")))), images);
    }
    mapped.release();
  }
  return {images.begin(), images.end()};
}

}  // namespace tileflight::mesh_files
