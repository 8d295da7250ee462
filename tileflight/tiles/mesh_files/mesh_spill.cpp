#include "tileflight/tiles/mesh_files/mesh_spill.h"

#include <algorithm>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/srgb.h"
#include "tileflight/core/geometry/polygon.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::mesh_files {
namespace {

using geometry::Vec3;

std::filesystem::path made(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  return folder;
}

/// Whether the triangle's area is distinguishable from zero.
bool has_extent(const SourceTriangle& t) {
  const Vec3 a = t.corner(0);
  return (t.corner(1) - a).cross(t.corner(2) - a).squaredNorm() > 0;
}

}  // namespace

Eigen::Vector2f SurfaceAppearance::uv(const Eigen::Vector2f& file_uv) const {
  const float u = uv_offset[0] + uv_scale[0] * file_uv.x(), v = uv_offset[1] + uv_scale[1] * file_uv.y();
  const Eigen::Vector2f out(u, v_up ? 1.0F - v : v);
  return out.allFinite() ? out : Eigen::Vector2f(0.0F, 0.0F);
}

MeshSpill::MeshSpill(const std::filesystem::path& folder)
    : vertices(made(folder) / "vertices"), uv(folder / "uv"), faces(folder / "faces"), texels(folder / "texels") {}

std::int64_t MeshSpill::for_each_triangle(const std::function<void(const SourceTriangle&)>& visit) {
  std::int64_t flat = 0;
  faces.for_each([&](const SpilledFace& face) {
    const SurfaceAppearance& look = materials[face.material];
    SourceTriangle out;
    out.material = face.material;
    for (std::size_t k = 0; k < 3; ++k) {
      const SpilledVertex vertex = vertices.at(face.position[k]);
      out.position[k] = vertex.position;
      if (look.has_colors) out.color[k] = vertex.color;
      if (!look.texture) continue;
      const std::array<float, 2> file_uv = uv.at(face.uv[k]);
      const Eigen::Vector2f at = look.uv({file_uv[0], file_uv[1]});
      out.uv[k] = {at.x(), at.y()};
    }
    if (has_extent(out)) {
      visit(out);
    } else {
      ++flat;
    }
  });
  return flat;
}

std::shared_ptr<const imaging::RgbImage> MeshSpill::image(const std::filesystem::path& file) {
  auto& known = images_[file];
  if (!known) known = texels.add(imaging::read_rgb(file));
  return known;
}

void MeshSpill::warn(const std::string& warning) {
  if (std::find(warnings.begin(), warnings.end(), warning) == warnings.end()) warnings.push_back(warning);
}

SpillReceiver::SpillReceiver(MeshSpill& spill, std::string file)
    : spill_(spill),
      file_(std::move(file)),
      first_vertex_(static_cast<std::uint32_t>(spill.vertices.size())),
      first_uv_(static_cast<std::uint32_t>(spill.uv.size())),
      first_material_(static_cast<std::uint32_t>(spill.materials.size())) {}

void SpillReceiver::add_position(const Vec3& position, const std::optional<std::array<float, 3>>& color) {
  if (spill_.vertices.size() >= kInvalidIndex) throw InputError(file_, "too many vertices: more than 4 billion in all");
  SpilledVertex vertex{.position = {position.x(), position.y(), position.z()}};
  if (color) {
    has_colors_ = true;
    vertex.file_color = *color;
    highest_color_ = std::max({highest_color_, (*color)[0], (*color)[1], (*color)[2]});
  }
  spill_.vertices.push_back(vertex);
}

void SpillReceiver::add_uv(const Eigen::Vector2f& uv) {
  if (spill_.uv.size() >= kInvalidIndex)
    throw InputError(file_, "too many texture coordinates: more than 4 billion in all");
  spill_.uv.push_back({uv.x(), uv.y()});
}

void SpillReceiver::use_material(const std::string& material) {
  const auto [at, is_new] = group_of_.try_emplace(material, static_cast<std::uint32_t>(groups_.size()));
  if (is_new) {
    groups_.push_back(material);
    is_used_.resize(2 * groups_.size());
  }
  group_ = at->second;
}

void SpillReceiver::add_face(const std::vector<FaceCorner>& corners) {
  if (corners.size() == 3) return add_triangle({corners[0], corners[1], corners[2]});
  std::vector<Vec3> places;
  for (const FaceCorner& c : corners)
    places.emplace_back(spill_.vertices.at(first_vertex_ + c.position).position.data());
  for (const auto& t : geometry::triangulate(places)) add_triangle({corners[t[0]], corners[t[1]], corners[t[2]]});
}

void SpillReceiver::add_triangle(const std::array<FaceCorner, 3>& corners) {
  const bool with_uv =
      std::all_of(corners.begin(), corners.end(), [](const FaceCorner& c) { return c.uv != kInvalidIndex; });
  const std::uint32_t variant = 2 * group_ + (with_uv ? 0 : 1);
  is_used_[variant] = true;
  SpilledFace face{.material = first_material_ + variant};
  for (std::size_t k = 0; k < 3; ++k) {
    face.position[k] = first_vertex_ + corners[k].position;
    face.uv[k] = with_uv ? first_uv_ + corners[k].uv : kInvalidIndex;
  }
  spill_.faces.push_back(face);
}

void SpillReceiver::finish(const std::function<float(float)>& color_scale,
                           const std::function<SurfaceAppearance(const std::string&, bool)>& look) {
  const float scale = color_scale(highest_color_);
  if (has_colors_)
    spill_.vertices.change(first_vertex_, [&](SpilledVertex& vertex) {
      for (float& value : vertex.file_color) value = value * scale > 0 ? std::min(value * scale, 1.0F) : 0.0F;
      vertex.color = base::linear_rgba_from_srgb(vertex.file_color);
    });
  for (std::size_t i = 0; i < is_used_.size(); ++i)
    spill_.materials.push_back(is_used_[i] ? look(groups_[i / 2], i % 2 == 0) : SurfaceAppearance{});
}

}  // namespace tileflight::mesh_files
