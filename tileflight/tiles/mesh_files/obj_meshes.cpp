#include "tileflight/tiles/mesh_files/obj_meshes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/srgb.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/tiles/mesh_files/mapped_file.h"

namespace tileflight::mesh_files {
namespace {

namespace fs = std::filesystem;
using geometry::Vec3;
using imaging::TexturedMesh;

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

/// Takes a number from the front of `line`.
bool take_number(std::string_view& line, float& value) {
  std::string_view rest = line;
  const auto number = base::parse_number<float>(base::take_field(rest));
  if (!number || !std::isfinite(*number)) return false;
  value = *number;
  line = rest;
  return true;
}

/// Reads up to three numbers, of which the first two are used.
void take_pair(std::string_view& line, std::array<float, 2>& pair) {
  float third = 0;
  if (take_number(line, pair[0]) && take_number(line, pair[1])) take_number(line, third);
}

/// Number of arguments of a texture map option.
int argument_count(std::string_view option) {
  if (option == "-mm") return 2;
  return 1;
}

/// Options precede the file name, which is the rest of the line.
void read_map(std::string_view line, MtlMaterial& material) {
  line = base::trim(line);
  while (line.starts_with('-')) {
    std::string_view rest = line;
    const std::string_view option = base::take_field(rest);
    if (option == "-s") {
      take_pair(rest, material.scale);
    } else if (option == "-o") {
      take_pair(rest, material.offset);
    } else if (option == "-t") {
      std::array<float, 2> turbulence{};
      take_pair(rest, turbulence);
    } else if (option == "-clamp") {
      material.clamp = base::take_field(rest) == "on";
    } else {
      for (int i = 0; i < argument_count(option); ++i) base::take_field(rest);
    }
    line = base::trim(rest);
  }
  material.texture = std::string(line);
}

/// `d` is the opacity. `Tr` is one minus it, but of some programs the opacity: what is neither 0 nor 1 is partial.
void read_opacity(std::string_view key, std::string_view line, MtlMaterial& material) {
  if (base::trim(line).starts_with("-halo")) base::take_field(line);
  float value = 1.0F;
  if (take_number(line, value) && value < 1.0F && (key == "d" || value > 0.0F)) material.is_transparent = true;
}

/// `r g b`, or one number for a grey.
void read_color(std::string_view line, const std::string& where, MtlMaterial& material) {
  auto& [r, g, b] = material.color;
  if (!take_number(line, r)) throw InputError(where, "Kd needs one or three numbers");
  if (base::trim(line).empty()) {
    g = b = r;
  } else if (!take_number(line, g) || !take_number(line, b)) {
    throw InputError(where, "Kd needs one or three numbers");
  }
  for (float& value : material.color) value = std::clamp(value, 0.0F, 1.0F);
}

}  // namespace

std::map<std::string, MtlMaterial> parse_mtl(std::string_view text, const std::string& name) {
  std::map<std::string, MtlMaterial> out;
  MtlMaterial* material = nullptr;
  std::int64_t line_number = 0;
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  while (auto line = base::take_line(text)) {
    const std::string where = name + ", line " + std::to_string(++line_number);
    const std::string_view key = base::take_field(*line);
    if (key == "newmtl") material = &out[std::string(base::trim(*line))];
    if (material == nullptr) continue;
    if (key == "Kd" && !base::trim(*line).starts_with("spectral") && !base::trim(*line).starts_with("xyz"))
      read_color(*line, where, *material);
    if (key == "map_Kd" || key == "map_kd") read_map(*line, *material);
    if (key == "d" || key == "Tr") read_opacity(key, *line, *material);
  }
  return out;
}

namespace {

/// Returns the factor that brings vertex colours into 0..1. In a file where one exceeds 1 they are out of 255.
float obj_color_scale(float highest) { return highest > 1.0F ? 1.0F / 255.0F : 1.0F; }

constexpr std::string_view kBlanks = " \t";

/// Lines between two calls of `between`.
constexpr std::int64_t kLinesAtOnce = 65536;

/// One object per file.
class ObjParser {
 public:
  ObjParser(std::string_view text, const std::string& name, FaceReceiver& faces, const std::function<void()>& between)
      : text_(text), name_(name), faces_(faces), between_(between) {}

  ObjNotes parse() {
    if (text_.starts_with(kByteOrderMark)) text_.remove_prefix(kByteOrderMark.size());
    while (const auto line = next_line()) {
      read_line(*line);
      if (between_ && line_number_ % kLinesAtOnce == 0) between_();
    }
    return std::move(out_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(name_ + ", line " + std::to_string(line_number_), what);
  }

  /// Reads a line, joined with its continuation lines.
  std::optional<std::string_view> next_line() {
    auto line = base::take_line(text_);
    ++line_number_;
    if (!line || !line->ends_with('\\')) return line;
    joined_.clear();
    while (line && line->ends_with('\\')) {
      joined_.append(line->substr(0, line->size() - 1)).push_back(' ');
      line = base::take_line(text_);
      ++line_number_;
    }
    if (line) joined_.append(*line);
    return joined_;
  }

  void read_line(std::string_view line) {
    const std::string_view key = base::take_field(line);
    if (key == "v") return read_position(line);
    if (key == "vt") return read_uv(line);
    if (key == "f") return read_face(line);
    if (key == "usemtl") return use_material(std::string(base::trim(line)));
    if (key == "mtllib") out_.libraries.emplace_back(base::trim(line));
  }

  double number(std::string_view field) const {
    const auto value = base::parse_number<double>(field);
    if (!value) fail("'" + std::string(field.substr(0, 40)) + "' is not a number");
    return *value;
  }

  /// `v x y z`, `v x y z w` (w, the weight of rational curves, is ignored), `v x y z r g b`, with or without alpha.
  void read_position(std::string_view line) {
    if (positions_ >= kInvalidIndex) fail("too many vertices");
    std::array<double, 7> values{};
    std::size_t count = 0;
    while (count < values.size()) {
      const std::string_view field = base::take_field(line);
      if (field.empty() || field.starts_with('#')) break;
      values[count++] = number(field);
    }
    if (count < 3) fail("a vertex needs three coordinates");
    const Vec3 position(values[0], values[1], values[2]);
    if (!position.allFinite()) fail("a coordinate is not finite");
    ++positions_;
    if (count < 6) return faces_.add_position(position, std::nullopt);
    faces_.add_position(position, std::array{static_cast<float>(values[3]), static_cast<float>(values[4]),
                                             static_cast<float>(values[5])});
  }

  void read_uv(std::string_view line) {
    if (uvs_ >= kInvalidIndex) fail("too many texture coordinates");
    const std::string_view u = base::take_field(line), v = base::take_field(line);
    if (u.empty()) fail("a texture coordinate needs a number");
    Eigen::Vector2f uv(static_cast<float>(number(u)), v.empty() ? 0.0F : static_cast<float>(number(v)));
    if (!uv.allFinite()) {
      ++out_.uv_not_finite;
      uv.setZero();
    }
    ++uvs_;
    faces_.add_uv(uv);
  }

  /// Converts an index as written: from 1, or backwards from the last one if negative.
  std::uint32_t index(std::string_view field, std::size_t count, const char* what) const {
    const auto value = base::parse_number<std::int64_t>(field);
    if (!value) fail("'" + std::string(field.substr(0, 40)) + "' is not an index");
    const auto size = static_cast<std::int64_t>(count);
    const std::int64_t at = *value < 0 ? size + *value : *value - 1;
    if (*value == 0 || at < 0 || at >= size)
      fail("a face refers to " + std::string(what) + " " + std::to_string(*value) + ", but there are " +
           std::to_string(count) + " so far");
    return static_cast<std::uint32_t>(at);
  }

  /// `v`, `v/vt`, `v/vt/vn` or `v//vn`.
  FaceCorner corner(std::string_view field) const {
    const std::size_t slash = field.find('/');
    FaceCorner out{index(field.substr(0, slash), positions_, "vertex"), kInvalidIndex};
    if (slash == std::string_view::npos) return out;
    field.remove_prefix(slash + 1);
    field = field.substr(0, field.find('/'));
    if (!field.empty()) out.uv = index(field, uvs_, "texture coordinate");
    return out;
  }

  void read_face(std::string_view line) {
    corners_.clear();
    for (std::string_view field = base::take_field(line); !field.empty() && !field.starts_with('#');
         field = base::take_field(line))
      corners_.push_back(corner(field));
    if (corners_.size() < 3) {
      ++out_.faces_left_out;
      return;
    }
    if (!has_material_) use_material("");
    faces_.add_face(corners_);
  }

  void use_material(const std::string& material) {
    has_material_ = true;
    faces_.use_material(material);
  }

  std::string_view text_;
  const std::string& name_;
  std::int64_t line_number_ = 0;
  std::string joined_;
  std::vector<FaceCorner> corners_;
  bool has_material_ = false;
  std::size_t positions_ = 0, uvs_ = 0;
  ObjNotes out_;
  FaceReceiver& faces_;
  const std::function<void()>& between_;
};

/// Keeps a file's surface.
class KeptFaces : public FaceReceiver {
 public:
  void add_position(const Vec3& position, const std::optional<std::array<float, 3>>& color) override {
    faces_.positions.push_back(position);
    if (!color) return;
    faces_.colors.resize(faces_.positions.size(), {1.0F, 1.0F, 1.0F});
    faces_.colors.back() = *color;
  }
  void add_uv(const Eigen::Vector2f& uv) override { faces_.uv.push_back(uv); }
  void use_material(const std::string& material) override { group_ = find_or_add_group(material, group_of_, faces_); }
  void add_face(const std::vector<FaceCorner>& corners) override {
    mesh_files::add_face(corners, faces_.positions, faces_.groups[group_]);
  }

  IndexedFaces take() {
    if (!faces_.colors.empty()) finish_colors();
    return std::move(faces_);
  }

 private:
  void finish_colors() {
    faces_.colors.resize(faces_.positions.size(), {1.0F, 1.0F, 1.0F});
    float highest = 0;
    for (const auto& color : faces_.colors) highest = std::max({highest, color[0], color[1], color[2]});
    const float scale = obj_color_scale(highest);
    for (auto& color : faces_.colors)
      for (float& value : color) value = value * scale > 0 ? std::min(value * scale, 1.0F) : 0.0F;
  }

  IndexedFaces faces_;
  std::map<std::string, std::size_t> group_of_;
  std::size_t group_ = 0;
};

/// Reads an OBJ like parse_obj(), and hands its surface over instead of keeping it. `between` is called from time to
/// time, between two lines.
ObjNotes visit_obj(std::string_view text, const std::string& name, FaceReceiver& faces,
                   const std::function<void()>& between = {}) {
  return ObjParser(text, name, faces, between).parse();
}

}  // namespace

ObjFile parse_obj(std::string_view text, const std::string& name) {
  KeptFaces faces;
  ObjNotes notes = visit_obj(text, name, faces);
  return {faces.take(), std::move(notes)};
}

namespace {

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

/// Appearance of the materials of a file, and warnings about them.
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

  /// Returns the appearance of a material's triangles, with texture coordinates or without.
  SurfaceAppearance look(const std::string& name, bool with_uv, bool has_colors) {
    const Materials::Entry* entry = materials_.find(name);
    if (entry == nullptr && textures_ && !name.empty())
      warnings_.insert("the material '" + name + "' is in no material library; its surfaces are white");
    const MtlMaterial material = entry != nullptr ? entry->material : MtlMaterial{};
    SurfaceAppearance out;
    out.has_colors = has_colors;
    out.v_up = true;
    if (material.is_transparent)
      warnings_.insert("the material '" + name + "' is partly transparent (d, Tr); its surfaces become opaque");
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
