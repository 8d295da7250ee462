#include "tileflight/tiles/mesh_files/ply_meshes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <unordered_map>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/geometry/ply.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/tiles/mesh_files/indexed_faces.h"
#include "tileflight/tiles/mesh_files/mapped_file.h"

namespace tileflight::mesh_files {
namespace {

namespace fs = std::filesystem;
using geometry::PlyElement;
using geometry::PlyType;

/// Rows between two calls of `between`.
constexpr std::uint64_t kRowsAtOnce = 65536;

constexpr std::uintmax_t kMaxPlyBytes = std::uintmax_t{1} << 36;

/// Index of the first of these properties that exists in the element.
std::optional<std::size_t> find(const PlyElement& element, std::initializer_list<std::string_view> names) {
  for (const std::string_view name : names)
    for (std::size_t i = 0; i < element.properties.size(); ++i)
      if (element.properties[i].name == name) return i;
  return std::nullopt;
}

/// Divisor that scales a colour value to 0..1.
float color_range(PlyType type) {
  if (type == PlyType::kFloat32 || type == PlyType::kFloat64) return 1.0F;
  return type == PlyType::kUint16 ? 65535.0F : 255.0F;
}

/// Images named by "comment TextureFile NAME" lines of the header.
std::vector<std::string> texture_files(const geometry::PlyHeader& header) {
  constexpr std::string_view kStart = "TextureFile ";
  std::vector<std::string> names;
  for (const std::string& comment : header.comments)
    if (comment.starts_with(kStart)) names.emplace_back(base::trim(std::string_view(comment).substr(kStart.size())));
  return names;
}

/// Hands a file's vertices and faces over. The material of a face is the number of its image.
class PlyReader {
 public:
  /// `between` is called from time to time.
  PlyReader(std::string_view bytes, std::string file, bool textures, FaceReceiver& faces,
            std::function<void()> between = {})
      : file_(std::move(file)),
        bytes_(bytes),
        header_(geometry::parse_ply_header(bytes_, file_)),
        faces_(faces),
        between_(std::move(between)) {
    geometry::check_ply_sizes(bytes_, header_, file_);
    if (textures) pictures_ = texture_files(header_);
  }

  void read() {
    const PlyElement& vertex = element("vertex");
    const PlyElement* face = header_.find("face");
    const PlyElement* strips = header_.find("tristrips");
    const bool has_faces = face != nullptr && face->count > 0, has_strips = strips != nullptr && strips->count > 0;
    if (!has_faces && !has_strips)
      throw InputError(file_, "contains points without faces; a mesh is needed (reconstruct a surface first)");
    read_vertices(vertex);
    if (has_faces) read_faces(*face);
    if (has_strips) read_strips(*strips);
  }

  const std::vector<std::string>& pictures() const { return pictures_; }

 private:
  const PlyElement& element(std::string_view name) const {
    const PlyElement* found = header_.find(name);
    if (found == nullptr) throw InputError(file_, "has no element '" + std::string(name) + "'");
    return *found;
  }

  /// The vertex being read.
  struct Vertex {
    geometry::Vec3 position = geometry::Vec3::Zero();
    std::array<float, 3> color{};
    Eigen::Vector2f uv = Eigen::Vector2f::Zero();
  };

  void read_vertices(const PlyElement& vertex) {
    const std::array places{find(vertex, {"x"}), find(vertex, {"y"}), find(vertex, {"z"})};
    const std::array colors{find(vertex, {"red", "diffuse_red", "r"}), find(vertex, {"green", "diffuse_green", "g"}),
                            find(vertex, {"blue", "diffuse_blue", "b"})};
    const std::array uv{find(vertex, {"s", "u", "texture_u"}), find(vertex, {"t", "v", "texture_v"})};
    if (!places[0] || !places[1] || !places[2]) throw InputError(file_, "its vertices lack x, y or z");
    const bool has_colors = colors[0] && colors[1] && colors[2];
    vertices_ = vertex.count;
    vertex_uv_ = uv[0] && uv[1] && !pictures_.empty();
    Vertex next;
    geometry::visit_ply_element(bytes_, header_, "vertex", file_,
                                [&](std::uint64_t row, std::size_t property, const std::vector<double>& values) {
                                  for (std::size_t k = 0; k < 3 && values.size() == 1; ++k) {
                                    if (places[k] == property) next.position[static_cast<int>(k)] = values[0];
                                    if (has_colors && colors[k] == property)
                                      next.color[k] = unit(values[0], vertex.properties[property].type);
                                    if (k < 2 && vertex_uv_ && uv[k] == property)
                                      next.uv[static_cast<int>(k)] = finite(values[0]);
                                  }
                                  if (property + 1 != vertex.properties.size()) return;
                                  add(next, row, has_colors);
                                  next = {};
                                });
  }

  void add(const Vertex& vertex, std::uint64_t row, bool has_colors) {
    if (between_ && row % kRowsAtOnce == 0) between_();
    if (!vertex.position.allFinite())
      throw InputError(file_, "the position of vertex " + std::to_string(row) + " is not finite");
    faces_.add_position(vertex.position, has_colors ? std::optional(vertex.color) : std::nullopt);
    if (vertex_uv_) add_uv(vertex.uv);
  }

  static float unit(double value, PlyType type) {
    const float out = static_cast<float>(value) / color_range(type);
    return out > 0.0F ? std::min(out, 1.0F) : 0.0F;  // NaN becomes 0
  }

  static float finite(double value) { return std::isfinite(value) ? static_cast<float>(value) : 0.0F; }

  void read_faces(const PlyElement& face) {
    const auto corners = find(face, {"vertex_indices", "vertex_index"});
    if (!corners || !face.properties[*corners].is_list)
      throw InputError(file_, "its faces have no list vertex_indices");
    const auto uv = pictures_.empty() ? std::nullopt : find(face, {"texcoord"});
    const auto picture = pictures_.empty() ? std::nullopt : find(face, {"texnumber"});
    corners_.clear();
    geometry::visit_ply_element(bytes_, header_, "face", file_,
                                [&](std::uint64_t row, std::size_t property, const std::vector<double>& values) {
                                  if (property == *corners) read_corners(row, values);
                                  if (property == uv) corner_uv_ = values;
                                  if (property == picture && !values.empty()) picture_ = values[0];
                                  if (property + 1 == face.properties.size()) finish_face(row);
                                });
  }

  void read_corners(std::uint64_t row, const std::vector<double>& values) {
    for (const double value : values) corners_.push_back(corner(value, "face", row));
  }

  FaceCorner corner(double value, const char* what, std::uint64_t row) const {
    if (!(value >= 0 && value < static_cast<double>(vertices_)))
      throw InputError(file_, what + (" " + std::to_string(row)) + " refers to vertex " +
                                  std::to_string(static_cast<std::int64_t>(std::clamp(value, -1e15, 1e15))) + " of " +
                                  std::to_string(vertices_));
    const auto index = static_cast<std::uint32_t>(value);
    return {index, vertex_uv_ ? index : kInvalidIndex};
  }

  /// Strips of the Stanford scans: each vertex makes a triangle with the two before it, every other one turned round;
  /// -1 begins another strip.
  void read_strips(const PlyElement& strips) {
    const auto indices = find(strips, {"vertex_indices", "vertex_index"});
    if (!indices || !strips.properties[*indices].is_list)
      throw InputError(file_, "its tristrips have no list vertex_indices");
    if (used_picture_ != 0) faces_.use_material("0");
    geometry::visit_ply_element(bytes_, header_, "tristrips", file_,
                                [&](std::uint64_t row, std::size_t property, const std::vector<double>& values) {
                                  if (property == *indices) read_strip(row, values);
                                });
  }

  void read_strip(std::uint64_t row, const std::vector<double>& values) {
    std::vector<FaceCorner> strip, triangle(3);
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (between_ && i % kRowsAtOnce == 0) between_();
      if (values[i] == -1) {
        strip.clear();
        continue;
      }
      strip.push_back(corner(values[i], "strip", row));
      const std::size_t n = strip.size();
      if (n < 3) continue;
      const bool is_turned = n % 2 == 0;
      triangle = {strip[n - 3], strip[n - (is_turned ? 1 : 2)], strip[n - (is_turned ? 2 : 1)]};
      const bool is_stitch = triangle[0].position == triangle[1].position ||
                             triangle[1].position == triangle[2].position ||
                             triangle[2].position == triangle[0].position;
      if (!is_stitch) faces_.add_face(triangle);
    }
  }

  void finish_face(std::uint64_t row) {
    if (between_ && row % kRowsAtOnce == 0) between_();
    if (corner_uv_.size() == 2 * corners_.size() && !corner_uv_.empty())
      for (std::size_t k = 0; k < corners_.size(); ++k)
        corners_[k].uv = add_uv({finite(corner_uv_[2 * k]), finite(corner_uv_[2 * k + 1])});
    if (!(picture_ >= 0 && picture_ < std::max<double>(1.0, static_cast<double>(pictures_.size()))))
      throw InputError(file_, "face " + std::to_string(row) + " refers to a texture that is not in the header");
    if (corners_.size() >= 3) {
      if (used_picture_ != picture_) faces_.use_material(std::to_string(static_cast<std::size_t>(picture_)));
      used_picture_ = picture_;
      faces_.add_face(corners_);
    }
    corners_.clear();
    corner_uv_.clear();
    picture_ = 0;
  }

  std::uint32_t add_uv(const Eigen::Vector2f& uv) {
    faces_.add_uv(uv);
    return uvs_++;
  }

  std::string file_;
  std::string_view bytes_;
  geometry::PlyHeader header_;
  FaceReceiver& faces_;
  std::function<void()> between_;
  std::vector<std::string> pictures_;
  std::uint64_t vertices_ = 0;
  std::uint32_t uvs_ = 0;
  bool vertex_uv_ = false;
  std::vector<FaceCorner> corners_;  ///< corners of the face being read
  std::vector<double> corner_uv_;    ///< texture coordinates of these corners
  double picture_ = 0;               ///< image of the face being read
  double used_picture_ = -1;         ///< image of the face before
};

/// Keeps a file's surface. Equal coordinates share an entry, so that triangles adjacent in the image also share
/// vertices.
class KeptPlyFaces : public FaceReceiver {
 public:
  void add_position(const geometry::Vec3& position, const std::optional<std::array<float, 3>>& color) override {
    faces_.positions.push_back(position);
    if (color) faces_.colors.push_back(*color);
  }
  void add_uv(const Eigen::Vector2f& uv) override {
    const std::uint64_t key = std::uint64_t{std::bit_cast<std::uint32_t>(uv.x())} << 32U |
                              std::uint64_t{std::bit_cast<std::uint32_t>(uv.y())};
    const auto [at, is_new] = entry_of_.try_emplace(key, static_cast<std::uint32_t>(faces_.uv.size()));
    if (is_new) faces_.uv.push_back(uv);
    entries_.push_back(at->second);
  }
  void use_material(const std::string& material) override { group_ = find_or_add_group(material, group_of_, faces_); }
  void add_face(const std::vector<FaceCorner>& corners) override {
    shared_ = corners;
    for (FaceCorner& corner : shared_)
      if (corner.uv != kInvalidIndex) corner.uv = entries_[corner.uv];
    mesh_files::add_face(shared_, faces_.positions, faces_.groups[group_]);
  }

  const IndexedFaces& faces() const { return faces_; }

 private:
  IndexedFaces faces_;
  std::unordered_map<std::uint64_t, std::uint32_t> entry_of_;  ///< by coordinates
  std::vector<std::uint32_t> entries_;                         ///< entry of each of the file's coordinates
  std::map<std::string, std::size_t> group_of_;
  std::size_t group_ = 0;
  std::vector<FaceCorner> shared_;
};

/// Path of an image of a PLY file.
fs::path picture_file(const fs::path& file, const std::string& picture) {
  const fs::path path = file.parent_path() / picture;
  std::error_code ignored;
  if (!fs::exists(path, ignored))
    throw InputError(file.string(),
                     "the texture '" + picture + "' does not exist; put it beside the file, or give --no-textures");
  return path;
}

SurfaceAppearance ply_look(bool with_uv, bool has_colors,
                           const std::function<std::shared_ptr<const imaging::RgbImage>()>& texture) {
  SurfaceAppearance out;
  out.has_colors = has_colors;
  out.v_up = true;
  if (with_uv) out.texture = texture();
  return out;
}

}  // namespace

MeshSource read_ply_meshes(const fs::path& file, bool textures) {
  std::string bytes = base::read_raw(file, kMaxPlyBytes);
  KeptPlyFaces kept;
  PlyReader reader(base::strip_byte_order_mark(bytes), file.string(), textures, kept);
  reader.read();
  const std::vector<std::string> pictures = reader.pictures();
  bytes = {};
  std::map<std::size_t, std::shared_ptr<const imaging::RgbImage>> images;
  VertexDeduplicator joiner(kept.faces());
  MeshSource source;
  for (const FaceGroup& group : kept.faces().groups)
    for (const bool with_uv : {true, false}) {
      imaging::TexturedMesh mesh = joiner.build_mesh(group, with_uv);
      if (mesh.mesh.triangles.empty()) continue;
      const std::size_t picture = std::stoul(group.material);
      if (with_uv && !images[picture])
        images[picture] =
            std::make_shared<const imaging::RgbImage>(imaging::read_rgb(picture_file(file, pictures[picture])));
      mesh.texture = with_uv ? images[picture] : nullptr;
      for (Eigen::Vector2f& uv : mesh.uv) uv.y() = 1.0F - uv.y();
      source.meshes.push_back(std::move(mesh));
    }
  return source;
}

void spill_ply_meshes(const fs::path& file, bool textures, MeshSpill& spill) {
  const MappedFile mapped(file, kMaxPlyBytes);
  SpillReceiver faces(spill, file.string());
  PlyReader reader(mapped.text(), file.string(), textures, faces, [&] { mapped.release(); });
  reader.read();
  faces.finish([](float) { return 1.0F; },
               [&](const std::string& material, bool with_uv) {
                 return ply_look(with_uv, faces.has_colors(), [&] {
                   return spill.image(picture_file(file, reader.pictures()[std::stoul(material)]));
                 });
               });
}

std::vector<fs::path> ply_image_files(const fs::path& file) {
  const MappedFile mapped(file, kMaxPlyBytes);
  const geometry::PlyHeader header = geometry::parse_ply_header(mapped.text(), file.string());
  std::vector<fs::path> out;
  for (const std::string& name : texture_files(header)) {
    std::error_code ignored;
    if (fs::is_regular_file(file.parent_path() / name, ignored)) out.push_back(file.parent_path() / name);
  }
  return out;
}

}  // namespace tileflight::mesh_files
