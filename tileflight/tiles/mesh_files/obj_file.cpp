#include "tileflight/tiles/mesh_files/obj_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_fields.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::mesh_files {

namespace {

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
  while (auto line = base::take_line(text)) {
    const std::string where = name + ", line " + std::to_string(++line_number);
    const std::string_view key = base::take_field(*line);
    if (key == "newmtl") material = &out[std::string(base::trim(*line))];
    if (material == nullptr) continue;
    if (key == "Kd" && !base::trim(*line).starts_with("spectral") && !base::trim(*line).starts_with("xyz"))
      read_color(*line, where, *material);
    if (key == "map_Kd" || key == "map_kd") read_map(*line, *material);
  }
  return out;
}

namespace {

using geometry::Vec3;

constexpr std::string_view kBlanks = " \t";

/// Lines between two calls of `between`.
constexpr std::int64_t kLinesAtOnce = 65536;

/// One object per file.
class ObjParser {
 public:
  ObjParser(std::string_view text, const std::string& name, FaceReceiver& faces, const std::function<void()>& between)
      : text_(text), name_(name), faces_(faces), between_(between) {}

  ObjNotes parse() {
    if (text_.starts_with("\xEF\xBB\xBF")) text_.remove_prefix(3);  // a byte order mark
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
    add_face(corners, faces_.positions, faces_.groups[group_]);
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

}  // namespace

float obj_color_scale(float highest) { return highest > 1.0F ? 1.0F / 255.0F : 1.0F; }

ObjNotes visit_obj(std::string_view text, const std::string& name, FaceReceiver& faces,
                   const std::function<void()>& between) {
  return ObjParser(text, name, faces, between).parse();
}

ObjFile parse_obj(std::string_view text, const std::string& name) {
  KeptFaces faces;
  ObjNotes notes = visit_obj(text, name, faces);
  return {faces.take(), std::move(notes)};
}

}  // namespace tileflight::mesh_files
