#include "tileflight/tiles/tile_content/gltf_meshes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/srgb.h"
#include "tileflight/core/imaging/image_alpha.h"
#include "tileflight/core/imaging/ktx2.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/tile_content/alpha_cutout.h"
#include "tileflight/tiles/tile_content/content.h"
#include "tileflight/tiles/tile_content/gltf_buffers.h"
#include "tileflight/tiles/tile_content/gltf_document.h"
#include "tileflight/tiles/tile_content/gltf_features.h"
#include "tileflight/tiles/tile_content/gltf_geometry.h"
#include "tileflight/tiles/tile_content/pnts.h"
#include "tileflight/tiles/tile_content/tile_table.h"

namespace tileflight::tile_content {
namespace {

using geometry::Mat3;
using geometry::Mat4;
using geometry::Vec3;
using imaging::TexturedMesh;

/// KHR_texture_transform: uv' = offset + R S uv, with the rotation counter-clockwise in an image whose v points down.
Eigen::Vector2f transformed_uv(const gltf::TextureTransform& t, double u, double v) {
  const double c = std::cos(t.rotation_rad);
  const double s = std::sin(t.rotation_rad);
  const double su = t.scale[0] * u;
  const double sv = t.scale[1] * v;
  return Eigen::Vector2d(t.offset[0] + c * su + s * sv, t.offset[1] - s * su + c * sv).cast<float>();
}

std::vector<std::array<std::uint8_t, 4>> to_bytes(const std::vector<float>& colors, std::size_t components) {
  std::vector<std::array<std::uint8_t, 4>> out(colors.size() / components, {255, 255, 255, 255});
  for (std::size_t i = 0; i < colors.size(); ++i) {
    const float value = colors[i] > 0.0F ? std::min(colors[i], 1.0F) : 0.0F;  // NaN becomes 0
    out[i / components][i % components] = static_cast<std::uint8_t>(std::lround(value * 255.0F));
  }
  return out;
}

/// Turns one document into meshes; one object per glTF.
class MeshBuilder {
 public:
  MeshBuilder(const gltf::Document& document, std::span<const std::byte> binary_chunk, const std::string& name,
              const ContentOptions& options, const GltfContainerInfo& around, const GltfReceiver& receiver,
              DecodedContent& out)
      : document_(document),
        name_(name),
        options_(options),
        container_(around),
        receiver_(receiver),
        out_(out),
        buffers_(document, binary_chunk, options, name),
        property_tables_(document, buffers_, options, name) {}

  void build(const Mat4& T_tile_gltf) {
    std::vector<bool> visited(document_.nodes.size(), false);
    std::vector<std::pair<std::size_t, Mat4>> pending;
    for (auto it = document_.roots.rbegin(); it != document_.roots.rend(); ++it) pending.emplace_back(*it, T_tile_gltf);
    while (!pending.empty()) {
      const auto [index, T_tile_parent] = pending.back();
      pending.pop_back();
      // glTF 2.0, section 3.5.2: a node has at most one parent. A cycle would never end.
      if (visited[index])
        throw InputError(name_, "node " + std::to_string(index) + " has two parents or is its own descendant");
      visited[index] = true;
      const gltf::Node& node = document_.nodes[index];
      const Mat4 T_tile_node = T_tile_parent * node.T_parent_node;
      add_node(node, T_tile_node);
      for (auto it = node.children.rbegin(); it != node.children.rend(); ++it) pending.emplace_back(*it, T_tile_node);
    }
    if (document_.nodes.empty()) {  // meshes without any node are shown untransformed
      for (std::size_t mesh = 0; mesh < document_.meshes.size(); ++mesh) add_mesh(mesh, {{T_tile_gltf}});
    }
  }

 private:
  /// Transforms of a mesh's copies, and their features.
  struct Instances {
    std::vector<Mat4> T_tile_mesh;
    std::vector<std::uint32_t> feature_ids = {};  ///< one per copy, or empty
    std::shared_ptr<const imaging::FeatureTable> features = {};
  };

  void warn(const std::string& what) { warn_once(what, out_.warnings); }

  void add_node(const gltf::Node& node, const Mat4& T_tile_node) {
    if (!node.mesh) return;
    if (!node.instancing) return add_mesh(*node.mesh, {{T_tile_node}});
    Instances places{instances(*node.instancing, T_tile_node)};
    add_instance_features(*node.instancing, places);
    add_mesh(*node.mesh, places);
  }

  /// EXT_instance_features.
  void add_instance_features(const gltf::Instancing& instancing, Instances& places) {
    if (!instancing.features) return;
    const std::size_t count = places.T_tile_mesh.size();
    if (instancing.feature_ids) {
      places.feature_ids = buffers_.ids(*instancing.feature_ids);
      if (places.feature_ids.size() != count)
        throw InputError(name_, "EXT_instance_features: expected one id for each instance");
    } else {
      places.feature_ids.resize(count);
      std::iota(places.feature_ids.begin(), places.feature_ids.end(), 0U);
    }
    replace_null(*instancing.features, places.feature_ids);
    places.features = table_of(*instancing.features);
  }

  static void replace_null(const gltf::FeatureIds& features, std::vector<std::uint32_t>& ids) {
    if (features.null_id) std::replace(ids.begin(), ids.end(), *features.null_id, imaging::kNoFeature);
  }

  std::shared_ptr<const imaging::FeatureTable> table_of(const gltf::FeatureIds& features) {
    if (features.property_table) return property_tables_.table(*features.property_table, out_.warnings);
    return container_.features;
  }

  /// EXT_mesh_gpu_instancing: T_tile_node * translation * rotation * scale, for each entry.
  std::vector<Mat4> instances(const gltf::Instancing& instancing, const Mat4& T_tile_node) {
    const auto read = [&](const std::optional<std::size_t>& accessor, std::size_t components) {
      return accessor ? buffers_.floats(*accessor, components) : std::vector<float>();
    };
    const std::vector<float> t = read(instancing.translation, 3);
    const std::vector<float> r = read(instancing.rotation, 4);
    const std::vector<float> s = read(instancing.scale, 3);
    const std::size_t count = std::max({t.size() / 3, r.size() / 4, s.size() / 3});
    const auto fits = [&](const std::vector<float>& values, std::size_t components) {
      return values.empty() || values.size() == count * components;
    };
    if (!fits(t, 3) || !fits(r, 4) || !fits(s, 3)) {
      throw InputError(name_, "EXT_mesh_gpu_instancing: the attributes have different counts");
    }
    std::vector<Mat4> out;
    for (std::size_t i = 0; i < count; ++i) {
      Mat4 T = Mat4::Identity();
      if (!r.empty()) {
        const Eigen::Quaterniond q(r[4 * i + 3], r[4 * i], r[4 * i + 1], r[4 * i + 2]);
        T.topLeftCorner<3, 3>() = q.normalized().toRotationMatrix();
      }
      if (!s.empty()) T.topLeftCorner<3, 3>() *= Vec3(s[3 * i], s[3 * i + 1], s[3 * i + 2]).asDiagonal();
      if (!t.empty()) T.topRightCorner<3, 1>() = Vec3(t[3 * i], t[3 * i + 1], t[3 * i + 2]);
      out.push_back(T_tile_node * T);
    }
    return out;
  }

  void add_mesh(std::size_t index, const Instances& places) {
    const gltf::Mesh& mesh = document_.meshes[index];
    for (std::size_t i = 0; i < mesh.primitives.size(); ++i) {
      const gltf::Primitive& primitive = mesh.primitives[i];
      if (!gltf::has_surface(primitive) && !gltf::has_points(primitive)) {
        warn("lines have no surface and are left out");
        continue;
      }
      const std::string where = name_ + ": meshes[" + std::to_string(index) + "]: primitive " + std::to_string(i);
      add_primitive(primitive, places, where);
    }
  }

  void add_primitive(const gltf::Primitive& primitive, const Instances& places, const std::string& where) {
    const gltf::Material* material = primitive.material ? &document_.materials[*primitive.material] : nullptr;
    const gltf::TextureReference* texture = options_.textures && material != nullptr && material->base_color_texture
                                                ? &*material->base_color_texture
                                                : nullptr;
    const gltf::TextureReference* opacity = opacity_texture(material);
    const gltf::TextureReference* sampled = texture != nullptr ? texture : opacity;
    const gltf::GeometryRequest request{.tex_coords = sampled != nullptr,
                                        .tex_coord_set = sampled == nullptr ? 0 : sampled->tex_coord,
                                        .feature_attribute = primitive.features ? primitive.features->attribute : "",
                                        .feature_coord_set = feature_coord_set(primitive)};
    gltf::Geometry geometry = gltf::read_geometry(primitive, document_, buffers_, request, where);
    for (const std::string& warning : geometry.warnings) warn(warning);
    if (!geometry.points.empty()) return add_points(geometry, material, places, where);
    if (material != nullptr) {
      for (const std::string& warning : material->warnings) warn(warning);
      remove_transparent_parts(*material, opacity, geometry, where);
    }
    if (geometry.triangles.empty()) return;
    if (primitive.texture_features) read_feature_texture(*primitive.texture_features, geometry, where);
    TexturedMesh appearance = appearance_of(geometry, texture, where);
    if (material != nullptr) {
      appearance.base_color = material->base_color;
      if (options_.textures && options_.opacities && material->alpha_mode == gltf::AlphaMode::kBlend)
        add_opacity(*material, appearance);
    }
    add_features(primitive, geometry, appearance);
    for (std::size_t i = 0; i < places.T_tile_mesh.size(); ++i) {
      spend(geometry, where);
      out_.meshes.push_back(appearance);
      place(geometry, places.T_tile_mesh[i], where, out_.meshes.back().mesh);
      if (!places.feature_ids.empty()) {
        out_.meshes.back().feature_ids.assign(geometry.vertex_count(), places.feature_ids[i]);
        out_.meshes.back().features = places.features;
      }
      if (!receiver_.take_mesh) continue;
      receiver_.take_mesh(out_.meshes.back());
      out_.meshes.pop_back();
    }
  }

  /// The texture whose alpha decides which parts of a surface are there; also without textures.
  static const gltf::TextureReference* opacity_texture(const gltf::Material* material) {
    const bool decides = material != nullptr && material->alpha_mode != gltf::AlphaMode::kOpaque;
    return decides && material->base_color_texture ? &*material->base_color_texture : nullptr;
  }

  /// Removes what is not there: of MASK what lies below the cutoff, of BLEND what is wholly transparent.
  void remove_transparent_parts(const gltf::Material& material, const gltf::TextureReference* texture,
                                gltf::Geometry& geometry, const std::string& where) {
    if (material.alpha_mode == gltf::AlphaMode::kOpaque) return;
    const bool blends = material.alpha_mode == gltf::AlphaMode::kBlend;
    const double factor = material.base_color[3];
    // The least alpha of a texel that is surface, of 255; above 255: none is.
    const double least =
        blends ? (factor > 0.0 ? 1.0 : 256.0) : (factor > 0.0 ? 255.0 * material.alpha_cutoff / factor : 256.0);
    if (blends) warn_of_blending();
    if (least > 255.0 + 1e-6) {
      warn("surfaces that are wholly transparent by their material are left out");
      geometry.triangles.clear();
      return;
    }
    const imaging::GrayImage* alpha = texture == nullptr ? nullptr : alpha_of(document_.textures[texture->texture]);
    if (alpha != nullptr && !alpha->empty() && !geometry.tex_coords.empty()) {
      const gltf::Texture& sampled = document_.textures[texture->texture];
      const gltf::OpacityMask mask{*alpha, static_cast<std::uint8_t>(std::clamp(std::ceil(least - 1e-6), 0.0, 255.0)),
                                   sampled.wrap_u, sampled.wrap_v};
      const auto uv = texture_coordinates(geometry.tex_coords, texture->transform.value_or(gltf::TextureTransform{}));
      const int cell = gltf::cut_out(mask, uv, geometry);
      if (cell > 1)
        warn("parts with a fine pattern of transparency are cut out by cells of several texels, not by texels");
      if (cell < 0) warn("a texture with transparent parts is repeated too often; its surface is shown whole");
      if (geometry.vertex_count() > options_.limits.max_vertices) spend(geometry, where);
    }
  }

  /// Says what becomes of BLEND: images alone can show a surface in part.
  void warn_of_blending() {
    warn(
        options_.opacities
            ? "surfaces of alpha mode BLEND are blended in images and count as solid in depth, lidar and ground truth; "
              "their wholly transparent parts are left out"
            : "surfaces of alpha mode BLEND become opaque; their wholly transparent parts are left out");
  }

  static bool is_partial(std::uint8_t alpha) { return alpha > 0 && alpha < 255; }

  /// Marks a surface that blends, if any of it is partly transparent.
  void add_opacity(const gltf::Material& material, TexturedMesh& mesh) {
    const gltf::TextureReference* texture = opacity_texture(&material);
    const bool is_sampled = texture != nullptr && mesh.texture && !mesh.uv.empty();
    const imaging::GrayImage* alpha = is_sampled ? alpha_of(document_.textures[texture->texture]) : nullptr;
    if (alpha != nullptr && std::ranges::any_of(alpha->pixels, is_partial)) {
      std::shared_ptr<const imaging::RgbImage>& image = opacities_[*document_.textures[texture->texture].image];
      if (!image) image = encoded_opacity(*alpha);
      mesh.opacity = image;
    }
    const bool in_colors = std::ranges::any_of(mesh.colors, [](const auto& color) { return color[3] < 255; });
    mesh.blends = mesh.opacity != nullptr || in_colors || mesh.base_color[3] < 1.0F;
  }

  /// An image whose linear light is the opacity.
  static std::shared_ptr<const imaging::RgbImage> encoded_opacity(const imaging::GrayImage& alpha) {
    imaging::RgbImage image(alpha.width, alpha.height);
    std::ranges::transform(alpha.pixels, image.pixels.begin(), [](std::uint8_t a) {
      const auto value = static_cast<std::uint8_t>(std::lround(255.0 * base::srgb_from_linear(a / 255.0)));
      return imaging::Rgb8{value, value, value};
    });
    return std::make_shared<const imaging::RgbImage>(std::move(image));
  }

  /// The opacity of a texture; nullptr if its image cannot be read here (with a warning).
  const imaging::GrayImage* alpha_of(const gltf::Texture& texture) {
    if (!texture.image) return nullptr;
    const auto known = alphas_.find(*texture.image);
    if (known != alphas_.end()) return known->second ? &*known->second : nullptr;
    const gltf::Image& image = document_.images[*texture.image];
    const std::string where = name_ + ": images[" + std::to_string(*texture.image) + "]";
    const imaging::DecodeLimits limits{.max_pixels = options_.limits.max_texture_pixels};
    std::optional<imaging::GrayImage>& alpha = alphas_[*texture.image];
    if (image.view) {
      alpha = imaging::decode_alpha(buffers_.view(*image.view), where, limits);
    } else if (fetch::is_data_uri(*image.uri)) {
      alpha = imaging::decode_alpha(fetch::decode_data_uri(*image.uri, where), where, limits);
    } else if (options_.read_resource) {
      alpha = imaging::decode_alpha(options_.read_resource(*image.uri), where, limits);
    }
    if (!alpha) warn("the transparency of a texture cannot be read; its surfaces are shown opaque");
    return alpha ? &*alpha : nullptr;
  }

  /// Feature ids in textures are used only if textures are read.
  std::optional<std::size_t> feature_coord_set(const gltf::Primitive& primitive) const {
    if (!options_.textures || !primitive.texture_features || !gltf::has_surface(primitive)) return std::nullopt;
    return primitive.texture_features->texture.tex_coord;
  }

  void read_feature_texture(const gltf::TextureFeatureIds& features, gltf::Geometry& geometry,
                            const std::string& where) {
    if (geometry.feature_coords.empty()) return;
    if (std::count(features.channels.begin(), features.channels.end(), 3U) > 0) {
      return warn("feature ids in a texture's fourth channel are ignored");
    }
    const gltf::Texture& sampled = document_.textures[features.texture.texture];
    gltf::FeatureTexture texture{image_of(sampled, where), sampled.wrap_u, sampled.wrap_v, features.channels};
    if (!texture.image) return;
    if (texture.image->empty()) texture.image = read_image(document_.images[*sampled.image], *sampled.image, true);
    const auto transform = features.texture.transform.value_or(gltf::TextureTransform{});
    gltf::assign_features_from_texture(texture, texture_coordinates(geometry.feature_coords, transform), geometry);
  }

  void add_features(const gltf::Primitive& primitive, const gltf::Geometry& geometry, TexturedMesh& mesh) {
    if (primitive.texture_features && !geometry.feature_ids.empty()) {
      mesh.feature_ids = geometry.feature_ids;
      replace_null(primitive.texture_features->ids, mesh.feature_ids);
      mesh.features = table_of(primitive.texture_features->ids);
    }
    if (!primitive.features) return;
    mesh.feature_ids = geometry.feature_ids;
    if (primitive.features->attribute.empty()) {  // each vertex is its own feature
      mesh.feature_ids.resize(geometry.vertex_count());
      std::iota(mesh.feature_ids.begin(), mesh.feature_ids.end(), 0U);
    }
    replace_null(*primitive.features, mesh.feature_ids);
    if (!mesh.feature_ids.empty()) mesh.features = table_of(*primitive.features);
  }

  /// Adds a primitive of points, with the material's colour if the vertices have none.
  void add_points(const gltf::Geometry& geometry, const gltf::Material* material, const Instances& places,
                  const std::string& where) {
    geometry::PointCloud cloud;
    std::vector<std::array<std::uint8_t, 4>> colors;
    if (!geometry.colors.empty()) colors = to_bytes(geometry.colors, geometry.color_components);
    const std::vector<float> plain = material == nullptr
                                         ? std::vector<float>{1, 1, 1, 1}
                                         : std::vector<float>(material->base_color.begin(), material->base_color.end());
    const std::array<std::uint8_t, 4> own = to_bytes(plain, 4)[0];
    for (const std::uint32_t point : geometry.points) {
      const float* p = &geometry.positions[3 * std::size_t{point}];
      cloud.positions.emplace_back(p[0], p[1], p[2]);
      if (!cloud.positions.back().allFinite()) throw InputError(where, "the position of a point is not finite");
      const std::array<std::uint8_t, 4>& color = colors.empty() ? own : colors[point];
      cloud.colors.push_back({color[0], color[1], color[2]});
      if (!geometry.feature_ids.empty()) {
        cloud.scalars[kFeatureIdScalar].push_back(static_cast<float>(geometry.feature_ids[point]));
      }
    }
    for (const Mat4& T_tile_mesh : places.T_tile_mesh) {
      points_ += cloud.size();
      if (points_ > options_.limits.max_points) {
        throw InputError(where, "the tile has more than " + std::to_string(options_.limits.max_points) + " points");
      }
      out_.clouds.push_back(cloud);
      transform_cloud(T_tile_mesh, out_.clouds.back());
    }
  }

  /// All properties of a mesh except its geometry.
  TexturedMesh appearance_of(const gltf::Geometry& geometry, const gltf::TextureReference* texture,
                             const std::string& where) {
    TexturedMesh out;
    out.name = name_;
    if (!geometry.colors.empty()) out.colors = to_bytes(geometry.colors, geometry.color_components);
    if (texture == nullptr) return out;
    if (geometry.tex_coords.empty()) {
      warn("a textured surface without texture coordinates is shown in its base colour");
      return out;
    }
    const gltf::Texture& sampled = document_.textures[texture->texture];
    out.texture = image_of(sampled, where);
    out.wrap_u = sampled.wrap_u;
    out.wrap_v = sampled.wrap_v;
    out.uv = texture_coordinates(geometry.tex_coords, texture->transform.value_or(gltf::TextureTransform{}));
    return out;
  }

  std::vector<Eigen::Vector2f> texture_coordinates(const std::vector<float>& values,
                                                   const gltf::TextureTransform& transform) {
    std::vector<Eigen::Vector2f> out(values.size() / 2);
    for (std::size_t i = 0; i < out.size(); ++i) {
      out[i] = transformed_uv(transform, values[2 * i], values[2 * i + 1]);
      if (out[i].allFinite()) continue;
      warn("texture coordinates that are not finite are read as 0");
      out[i].setZero();
    }
    return out;
  }

  std::shared_ptr<const imaging::RgbImage> image_of(const gltf::Texture& texture, const std::string& where) {
    if (!texture.image) {
      if (texture.unsupported.empty()) return nullptr;
      throw InputError(where, "its texture is in a format that is not supported (" + texture.unsupported + ")");
    }
    const auto known = images_.find(*texture.image);
    if (known != images_.end()) return known->second;
    return images_[*texture.image] = read_image(document_.images[*texture.image], *texture.image);
  }

  /// `with_pixels`: no stand-in of the receiver's.
  std::shared_ptr<const imaging::RgbImage> read_image(const gltf::Image& image, std::size_t index,
                                                      bool with_pixels = false) {
    const std::string where = name_ + ": images[" + std::to_string(index) + "]";
    const auto decode = [&](std::span<const std::byte> bytes) {
      if (receiver_.decode_image && !with_pixels) return receiver_.decode_image(bytes, where);
      return std::make_shared<const imaging::RgbImage>(
          imaging::decode_texture(bytes, where, options_.limits.max_texture_pixels));
    };
    if (image.view) return decode(buffers_.view(*image.view));
    if (fetch::is_data_uri(*image.uri)) return decode(fetch::decode_data_uri(*image.uri, where));
    if (!options_.read_image) throw InputError(where, "refers to another file, which is not available here");
    return options_.read_image(*image.uri);
  }

  void spend(const gltf::Geometry& geometry, const std::string& where) {
    vertices_ += geometry.vertex_count();
    triangles_ += geometry.triangles.size();
    if (vertices_ > options_.limits.max_vertices || triangles_ > options_.limits.max_triangles) {
      throw InputError(where, "the tile has more than " + std::to_string(options_.limits.max_vertices) +
                                  " vertices or " + std::to_string(options_.limits.max_triangles) + " triangles");
    }
  }

  static void place(const gltf::Geometry& geometry, const Mat4& T_tile_mesh, const std::string& where,
                    geometry::TriangleMesh& mesh) {
    const Mat3 linear = T_tile_mesh.topLeftCorner<3, 3>();
    const Vec3 translation = T_tile_mesh.topRightCorner<3, 1>();
    mesh.vertices.resize(geometry.vertex_count());
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
      const float* p = &geometry.positions[3 * i];
      mesh.vertices[i] = linear * Vec3(p[0], p[1], p[2]) + translation;
      if (!mesh.vertices[i].allFinite())
        throw InputError(where, "the position of vertex " + std::to_string(i) + " is not finite");
    }
    mesh.triangles = geometry.triangles;
    // glTF 2.0, section 3.7.4: a reflection reverses the winding.
    if (linear.determinant() < 0) {
      for (geometry::Triangle& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
    }
  }

  const gltf::Document& document_;
  const std::string& name_;
  const ContentOptions& options_;
  const GltfContainerInfo& container_;
  const GltfReceiver& receiver_;
  DecodedContent& out_;
  gltf::Buffers buffers_;
  gltf::PropertyTables property_tables_;
  std::map<std::size_t, std::shared_ptr<const imaging::RgbImage>> images_;
  std::map<std::size_t, std::optional<imaging::GrayImage>> alphas_;
  std::map<std::size_t, std::shared_ptr<const imaging::RgbImage>> opacities_;  ///< encoded_opacity() of alphas_
  std::size_t vertices_ = 0;
  std::size_t triangles_ = 0;
  std::size_t points_ = 0;
};

}  // namespace

Mat3 R_tile_gltf(UpAxis up_axis) {
  Mat3 R = Mat3::Identity();
  if (up_axis == UpAxis::kY) R << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  if (up_axis == UpAxis::kX) R << 0, 0, -1, 0, 1, 0, 1, 0, 0;
  return R;
}

void append_gltf(std::string_view json, std::span<const std::byte> binary_chunk, const GltfContainerInfo& around,
                 const std::string& name, const ContentOptions& options, DecodedContent& out,
                 const GltfReceiver& receiver) {
  const gltf::Document document = gltf::parse_document(json, name);
  require_supported(document, name, options.textures);
  Mat4 T_tile_gltf = Mat4::Identity();
  T_tile_gltf.topLeftCorner<3, 3>() = R_tile_gltf(options.up_axis);
  T_tile_gltf.topRightCorner<3, 1>() = around.rtc_center + document.rtc_center;
  MeshBuilder(document, binary_chunk, name, options, around, receiver, out).build(T_tile_gltf);
  if (!document.copyright.empty()) out.copyrights.push_back(document.copyright);
}

}  // namespace tileflight::tile_content
