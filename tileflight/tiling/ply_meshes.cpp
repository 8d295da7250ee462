#include "tileflight/tiling/ply_meshes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <optional>
#include <unordered_map>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/text_fields.h"
#include "tileflight/geometry/ply.h"
#include "tileflight/imaging/image_files.h"
#include "tileflight/simplification/indexed_faces.h"

namespace tileflight::tiling {
namespace {

namespace fs = std::filesystem;
using geometry::PlyElement;
using geometry::PlyProperty;
using geometry::PlyType;

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
std::vector<std::string> texture_files(std::string_view header) {
  constexpr std::string_view kStart = "comment TextureFile ";
  std::vector<std::string> names;
  while (const auto line = base::take_line(header))
    if (line->starts_with(kStart)) names.emplace_back(line->substr(kStart.size()));
  return names;
}

/// One object per file.
class PlyMeshes {
 public:
  PlyMeshes(const fs::path& file, bool textures)
      : file_(file.string()),
        bytes_(base::read_text(file, kMaxPlyBytes)),
        header_(geometry::parse_ply_header(bytes_, file_)) {
    geometry::check_ply_sizes(bytes_, header_, file_);
    if (textures) pictures_ = texture_files(std::string_view(bytes_).substr(0, header_.size_bytes));
    folder_ = file.parent_path();
  }

  MeshSource take() {
    const PlyElement& vertex = element("vertex");
    const PlyElement* face = header_.find("face");
    if (face == nullptr || face->count == 0)
      throw InputError(file_, "contains points without faces; a mesh is needed (reconstruct a surface first)");
    read_vertices(vertex);
    read_faces(*face);
    bytes_ = {};
    simplification::VertexDeduplicator joiner(faces_);
    MeshSource source;
    for (std::size_t i = 0; i < faces_.groups.size(); ++i) {
      for (const bool with_uv : {true, false}) {
        imaging::TexturedMesh mesh = joiner.build_mesh(faces_.groups[i], with_uv);
        if (mesh.mesh.triangles.empty()) continue;
        if (with_uv) add_texture(std::stoul(faces_.groups[i].material), mesh);
        source.meshes.push_back(std::move(mesh));
      }
    }
    return source;
  }

 private:
  const PlyElement& element(std::string_view name) const {
    const PlyElement* found = header_.find(name);
    if (found == nullptr) throw InputError(file_, "has no element '" + std::string(name) + "'");
    return *found;
  }

  void read_vertices(const PlyElement& vertex) {
    const std::array places{find(vertex, {"x"}), find(vertex, {"y"}), find(vertex, {"z"})};
    const std::array colors{find(vertex, {"red", "diffuse_red", "r"}), find(vertex, {"green", "diffuse_green", "g"}),
                            find(vertex, {"blue", "diffuse_blue", "b"})};
    const std::array uv{find(vertex, {"s", "u", "texture_u"}), find(vertex, {"t", "v", "texture_v"})};
    if (!places[0] || !places[1] || !places[2]) throw InputError(file_, "its vertices lack x, y or z");
    faces_.positions.resize(vertex.count);
    const bool has_colors = colors[0] && colors[1] && colors[2];
    if (has_colors) faces_.colors.resize(vertex.count);
    vertex_uv_ = uv[0] && uv[1] && !pictures_.empty();
    if (vertex_uv_) faces_.uv.resize(vertex.count);
    geometry::visit_ply_element(bytes_, header_, "vertex", file_,
                                [&](std::uint64_t row, std::size_t property, const std::vector<double>& values) {
                                  if (values.size() != 1) return;
                                  for (std::size_t k = 0; k < 3; ++k) {
                                    if (places[k] == property) faces_.positions[row][static_cast<int>(k)] = values[0];
                                    if (has_colors && colors[k] == property)
                                      faces_.colors[row][k] = unit(values[0], vertex.properties[property].type);
                                    if (k < 2 && vertex_uv_ && uv[k] == property)
                                      faces_.uv[row][static_cast<int>(k)] = finite(values[0]);
                                  }
                                });
    for (std::size_t i = 0; i < faces_.positions.size(); ++i)
      if (!faces_.positions[i].allFinite())
        throw InputError(file_, "the position of vertex " + std::to_string(i) + " is not finite");
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
    for (const double value : values) {
      if (!(value >= 0 && value < static_cast<double>(faces_.positions.size())))
        throw InputError(file_, "face " + std::to_string(row) + " refers to vertex " +
                                    std::to_string(static_cast<std::int64_t>(std::clamp(value, -1e15, 1e15))) + " of " +
                                    std::to_string(faces_.positions.size()));
      const auto index = static_cast<std::uint32_t>(value);
      corners_.push_back({index, vertex_uv_ ? index : simplification::kInvalidIndex});
    }
  }

  void finish_face(std::uint64_t row) {
    if (corner_uv_.size() == 2 * corners_.size() && !corner_uv_.empty())
      for (std::size_t k = 0; k < corners_.size(); ++k)
        corners_[k].uv = uv_index(finite(corner_uv_[2 * k]), finite(corner_uv_[2 * k + 1]));
    if (!(picture_ >= 0 && picture_ < std::max<double>(1.0, static_cast<double>(pictures_.size()))))
      throw InputError(file_, "face " + std::to_string(row) + " refers to a texture that is not in the header");
    if (corners_.size() >= 3)
      simplification::add_face(corners_, faces_.positions, group_of(static_cast<std::size_t>(picture_)));
    corners_.clear();
    corner_uv_.clear();
    picture_ = 0;
  }

  simplification::FaceGroup& group_of(std::size_t picture) {
    const auto [at, is_new] = group_of_.try_emplace(picture, faces_.groups.size());
    if (is_new) faces_.groups.push_back({std::to_string(picture), {}});
    return faces_.groups[at->second];
  }

  /// Equal coordinates share an entry, so that triangles adjacent in the image also share vertices.
  std::uint32_t uv_index(float u, float v) {
    const std::uint64_t key =
        std::uint64_t{std::bit_cast<std::uint32_t>(u)} << 32U | std::uint64_t{std::bit_cast<std::uint32_t>(v)};
    const auto [at, is_new] = uv_of_.try_emplace(key, static_cast<std::uint32_t>(faces_.uv.size()));
    if (is_new) faces_.uv.emplace_back(u, v);
    return at->second;
  }

  void add_texture(std::size_t picture, imaging::TexturedMesh& mesh) {
    for (Eigen::Vector2f& uv : mesh.uv) uv.y() = 1.0F - uv.y();
    auto& image = decoded_[picture];
    if (!image) {
      const fs::path path = folder_ / pictures_[picture];
      std::error_code ignored;
      if (!fs::exists(path, ignored))
        throw InputError(file_, "the texture '" + pictures_[picture] +
                                    "' does not exist; put it beside the file, or give --no-textures");
      image = std::make_shared<const imaging::RgbImage>(imaging::read_rgb(path));
    }
    mesh.texture = image;
  }

  std::string file_;
  std::string bytes_;
  geometry::PlyHeader header_;
  fs::path folder_;
  std::vector<std::string> pictures_;
  std::map<std::size_t, std::shared_ptr<const imaging::RgbImage>> decoded_;
  bool vertex_uv_ = false;
  simplification::IndexedFaces faces_;
  std::map<std::size_t, std::size_t> group_of_;  ///< by image
  std::unordered_map<std::uint64_t, std::uint32_t> uv_of_;
  std::vector<simplification::FaceCorner> corners_;  ///< of the face being read
  std::vector<double> corner_uv_;                    ///< likewise
  double picture_ = 0;                               ///< likewise
};

}  // namespace

MeshSource read_ply_meshes(const fs::path& file, bool textures) { return PlyMeshes(file, textures).take(); }

}  // namespace tileflight::tiling
