#include "tileflight/tiles/mesh_files/mesh_source.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <tuple>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/deferred_texture.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/core/imaging/ktx2.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/mesh_files/mapped_file.h"
#include "tileflight/tiles/mesh_files/mesh_spill.h"
#include "tileflight/tiles/mesh_files/obj_meshes.h"
#include "tileflight/tiles/mesh_files/ply_meshes.h"
#include "tileflight/tiles/tile_content/content.h"
#include "tileflight/tiles/tile_content/gltf_meshes.h"

namespace tileflight::mesh_files {
namespace {

namespace fs = std::filesystem;
using geometry::Triangle;
using geometry::Vec3;
using imaging::TexturedMesh;
using tile_content::UpAxis;

constexpr std::uintmax_t kMaxGltfBytes = std::uintmax_t{1} << 32;

bool is_gltf(const fs::path& file) {
  const std::string ending = base::to_lower(file.extension().string());
  return ending == ".glb" || ending == ".gltf";
}

bool is_obj(const fs::path& file) { return base::to_lower(file.extension().string()) == ".obj"; }

bool is_mesh_file(const fs::path& file) {
  return is_gltf(file) || is_obj(file) || base::to_lower(file.extension().string()) == ".ply";
}

/// A file named by a glTF.
fs::path file_beside(const fs::path& gltf, const std::string& uri) {
  return gltf.parent_path() / fetch::uri_path(fetch::resolve_uri("", uri));
}

/// Options for decoding a glTF, but for its images.
tile_content::ContentOptions gltf_options(const fs::path& file, const MeshSourceOptions& options) {
  tile_content::ContentOptions content;
  content.textures = options.textures;
  content.opacities = false;
  content.up_axis = options.up.value_or(UpAxis::kY);
  content.read_resource = [file](const std::string& uri) { return base::read_bytes(file_beside(file, uri)); };
  content.limits.max_texture_pixels = imaging::DecodeLimits{}.max_pixels;
  return content;
}

constexpr const char* kPointsOnly = "contains points without a surface; a mesh is needed";

/// Bytes of a file from a place on. Throws InputError.
std::vector<std::byte> read_bytes_at(const fs::path& file, std::size_t begin, std::size_t count) {
  std::vector<std::byte> bytes(count);
  std::ifstream in(file, std::ios::binary);
  in.seekg(static_cast<std::streamoff>(begin));
  in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(count));
  if (!in) throw InputError(file.string(), "cannot be read any more: it was changed or removed while it was used");
  return bytes;
}

/// A JPEG within a mapped file stays there, as a deferred texture; other images are decoded.
std::shared_ptr<const imaging::RgbImage> defer_texture(const fs::path& file, const MappedFile& mapped,
                                                       std::span<const std::byte> bytes, const std::string& name,
                                                       std::int64_t max_pixels) {
  const std::byte* first = mapped.bytes().data();
  const bool is_of_file = bytes.data() >= first && bytes.data() + bytes.size() <= first + mapped.bytes().size();
  const std::optional<std::array<int, 2>> size = is_of_file ? imaging::jpeg_size(bytes) : std::nullopt;
  if (!size || std::int64_t{(*size)[0]} * (*size)[1] > max_pixels)
    return std::make_shared<const imaging::RgbImage>(imaging::decode_texture(bytes, name, max_pixels));
  const auto begin = static_cast<std::size_t>(bytes.data() - first);
  return imaging::make_deferred_texture((*size)[0], (*size)[1], [file, begin, count = bytes.size(), name, max_pixels] {
    return imaging::decode_texture(read_bytes_at(file, begin, count), name, max_pixels);
  });
}

tile_content::DecodedContent decode_with_deferred_textures(const fs::path& file,
                                                           const tile_content::ContentOptions& content) {
  const MappedFile mapped(file, kMaxGltfBytes);
  tile_content::GltfReceiver receiver;
  receiver.decode_image = [&](std::span<const std::byte> bytes, const std::string& name) {
    return defer_texture(file, mapped, bytes, name, content.limits.max_texture_pixels);
  };
  return tile_content::decode_gltf(mapped.bytes(), file.string(), content, receiver);
}

MeshSource read_gltf(const fs::path& file, const MeshSourceOptions& options) {
  tile_content::ContentOptions content = gltf_options(file, options);
  content.read_image = [&](const std::string& uri) {
    const fs::path image = file_beside(file, uri);
    return std::make_shared<const imaging::RgbImage>(
        imaging::decode_texture(base::read_bytes(image), image.string(), content.limits.max_texture_pixels));
  };
  tile_content::DecodedContent decoded =
      options.textures && options.defer_textures
          ? decode_with_deferred_textures(file, content)
          : tile_content::decode_gltf(base::read_bytes(file), file.string(), content, {});
  if (decoded.meshes.empty() && !decoded.clouds.empty()) throw InputError(file.string(), kPointsOnly);
  return {std::move(decoded.meshes), std::move(decoded.copyrights), std::move(decoded.warnings)};
}

/// Takes the meshes of a glTF into a spill, each freed when it is there.
class GltfSpiller {
 public:
  GltfSpiller(const fs::path& file, const MeshSourceOptions& options, MeshSpill& spill)
      : file_(file), options_(options), spill_(spill) {}

  void run() {
    tile_content::ContentOptions content = gltf_options(file_, options_);
    tile_content::GltfReceiver receiver;
    const std::int64_t max_pixels = content.limits.max_texture_pixels;
    receiver.decode_image = [this, max_pixels](std::span<const std::byte> bytes, const std::string& name) {
      return spill_.texels.add(imaging::decode_texture(bytes, name, max_pixels));
    };
    content.read_image = [&](const std::string& uri) {
      const fs::path image = file_beside(file_, uri);
      auto& known = images_[image];
      if (!known) known = receiver.decode_image(base::read_bytes(image), image.string());
      return known;
    };
    receiver.take_mesh = [this](const TexturedMesh& mesh) { take(mesh); };
    const MappedFile mapped(file_, kMaxGltfBytes);
    const tile_content::DecodedContent decoded =
        tile_content::decode_gltf(mapped.bytes(), file_.string(), content, receiver);
    if (!has_mesh_ && !decoded.clouds.empty()) throw InputError(file_.string(), kPointsOnly);
    for (const std::string& warning : decoded.warnings) spill_.warn(warning);
    spill_.copyrights.insert(spill_.copyrights.end(), decoded.copyrights.begin(), decoded.copyrights.end());
  }

 private:
  void take(const TexturedMesh& mesh) {
    has_mesh_ = true;
    if (spill_.vertices.size() + mesh.mesh.vertices.size() >= kInvalidIndex)
      throw InputError(file_.string(), "too many vertices: more than 4 billion in all");
    const auto first = static_cast<std::uint32_t>(spill_.vertices.size());
    const auto first_uv = static_cast<std::uint32_t>(spill_.uv.size());
    for (std::size_t i = 0; i < mesh.mesh.vertices.size(); ++i) {
      const Vec3& p = mesh.mesh.vertices[i];
      SpilledVertex vertex{.position = {p.x(), p.y(), p.z()}};
      if (!mesh.colors.empty()) vertex.color = mesh.colors[i];
      spill_.vertices.push_back(vertex);
    }
    const bool is_textured = mesh.texture && !mesh.uv.empty();
    for (std::size_t i = 0; is_textured && i < mesh.uv.size(); ++i)
      spill_.uv.push_back({mesh.uv[i].x(), mesh.uv[i].y()});
    const std::uint32_t material = material_of(mesh, is_textured);
    for (const Triangle& t : mesh.mesh.triangles) {
      SpilledFace face{.material = material};
      for (std::size_t k = 0; k < 3; ++k) {
        face.position[k] = first + t[k];
        face.uv[k] = is_textured ? first_uv + t[k] : kInvalidIndex;
      }
      spill_.faces.push_back(face);
    }
  }

  /// Primitives that look alike share a material.
  std::uint32_t material_of(const TexturedMesh& mesh, bool is_textured) {
    const SurfaceAppearance look{.texture = is_textured ? mesh.texture : nullptr,
                                 .wrap_u = mesh.wrap_u,
                                 .wrap_v = mesh.wrap_v,
                                 .base_color = mesh.base_color,
                                 .has_colors = !mesh.colors.empty()};
    const auto key = std::tuple(look.texture.get(), look.wrap_u, look.wrap_v, look.base_color, look.has_colors);
    const auto [at, is_new] = materials_.try_emplace(key, static_cast<std::uint32_t>(spill_.materials.size()));
    if (is_new) spill_.materials.push_back(look);
    return at->second;
  }

  fs::path file_;
  const MeshSourceOptions& options_;
  MeshSpill& spill_;
  bool has_mesh_ = false;
  std::map<fs::path, std::shared_ptr<const imaging::RgbImage>> images_;
  std::map<std::tuple<const imaging::RgbImage*, imaging::Wrap, imaging::Wrap, std::array<float, 4>, bool>,
           std::uint32_t>
      materials_;
};

/// Whether the triangle's area is distinguishable from zero in float precision.
bool has_area(const geometry::TriangleMesh& mesh, const Triangle& t) {
  const Vec3 ab = mesh.vertices[t[1]] - mesh.vertices[t[0]], ac = mesh.vertices[t[2]] - mesh.vertices[t[0]];
  return ab.cross(ac).squaredNorm() > 0;
}

/// Removes degenerate triangles, then meshes without triangles; returns the number of removed triangles.
std::int64_t drop_flat_triangles(std::vector<TexturedMesh>& meshes) {
  std::int64_t dropped = 0;
  for (TexturedMesh& m : meshes) {
    dropped += std::erase_if(m.mesh.triangles, [&](const Triangle& t) { return !has_area(m.mesh, t); });
  }
  std::erase_if(meshes, [](const TexturedMesh& m) { return m.mesh.triangles.empty(); });
  return dropped;
}

/// Rotates and scales; positions stay bit-identical if there is nothing to do.
void place(std::vector<TexturedMesh>& meshes, const geometry::Mat3& turn) {
  if (turn.isIdentity(0)) return;
  for (TexturedMesh& m : meshes)
    for (Vec3& vertex : m.mesh.vertices) vertex = turn * vertex;
}

/// Sets texture coordinates that became infinite by a scale or an offset to 0.
void hold_texture_coordinates(std::vector<TexturedMesh>& meshes) {
  for (TexturedMesh& m : meshes)
    for (Eigen::Vector2f& uv : m.uv)
      if (!uv.allFinite()) uv.setZero();
}

constexpr double kFarthest_m = 1e8;  ///< coordinates beyond are too large for boxes or floats

[[noreturn]] void refuse_extent(const fs::path& file) {
  throw InputError(file.string(), "has a vertex farther than 100 000 km from its origin; check --scale");
}

void check_extent(const std::vector<TexturedMesh>& meshes, const fs::path& file) {
  for (const TexturedMesh& m : meshes)
    for (const Vec3& vertex : m.mesh.vertices)
      if (!(vertex.cwiseAbs().maxCoeff() <= kFarthest_m)) refuse_extent(file);
}

void check_format(const fs::path& file) {
  if (!is_mesh_file(file)) throw InputError(file.string(), "unknown mesh format (.obj, .glb, .gltf or .ply expected)");
}

/// From the file's frame, or that of a decoded glTF, to metres with z up.
geometry::Mat3 turn_of(const fs::path& file, const MeshSourceOptions& options) {
  const UpAxis up = is_gltf(file) ? UpAxis::kZ : options.up.value_or(UpAxis::kZ);
  return options.metres_per_unit * tile_content::R_tile_gltf(up);
}

/// Without a check that anything is in it.
MeshSource read_one(const fs::path& file, const MeshSourceOptions& options) {
  check_format(file);
  MeshSource source = is_gltf(file)  ? read_gltf(file, options)
                      : is_obj(file) ? read_obj_meshes(file, options.textures)
                                     : read_ply_meshes(file, options.textures);
  place(source.meshes, turn_of(file, options));
  check_extent(source.meshes, file);
  hold_texture_coordinates(source.meshes);
  if (const std::int64_t dropped = drop_flat_triangles(source.meshes); dropped > 0)
    source.warnings.push_back(std::to_string(dropped) + " triangles without area are left out");
  return source;
}

/// Size of a file; 0 if there is none.
std::uintmax_t bytes_of(const fs::path& file) {
  std::error_code error;
  const std::uintmax_t bytes = fs::file_size(file, error);
  return error ? 0 : bytes;
}

/// Bytes of the files that a .gltf names, whatever they hold.
std::uintmax_t bytes_named_by(const fs::path& gltf) {
  const nlohmann::json json = nlohmann::json::parse(base::read_text(gltf), nullptr, false);
  std::uintmax_t bytes = 0;
  for (const char* list : {"buffers", "images"}) {
    if (!json.is_object() || !json.contains(list) || !json[list].is_array()) continue;
    for (const nlohmann::json& entry : json[list])
      if (entry.is_object() && entry.contains("uri") && entry["uri"].is_string() &&
          !fetch::is_data_uri(entry["uri"].get<std::string>()))
        bytes += bytes_of(file_beside(gltf, entry["uri"].get<std::string>()));
  }
  return bytes;
}

}  // namespace

MeshSource read_mesh_source(const fs::path& file, const MeshSourceOptions& options) {
  MeshSource source = read_one(file, options);
  if (source.meshes.empty()) throw InputError(file.string(), "contains no triangle with an area");
  return source;
}

MeshSource read_mesh_source(const std::vector<fs::path>& files, const MeshSourceOptions& options) {
  if (files.size() == 1) return read_mesh_source(files.front(), options);
  MeshSource all;
  for (const fs::path& file : files) {
    MeshSource one = read_one(file, options);
    all.meshes.insert(all.meshes.end(), std::make_move_iterator(one.meshes.begin()),
                      std::make_move_iterator(one.meshes.end()));
    all.copyrights.insert(all.copyrights.end(), one.copyrights.begin(), one.copyrights.end());
    for (const std::string& warning : one.warnings) all.warnings.push_back(file.string() + ": " + warning);
  }
  if (all.meshes.empty())
    throw InputError(files.front().string(), "contains no triangle with an area, nor do the others");
  return all;
}

void spill_mesh_source(const std::vector<fs::path>& files, const MeshSourceOptions& options, MeshSpill& spill,
                       const Progress& progress) {
  for (std::size_t i = 0; i < files.size(); ++i) {
    report_progress(progress, static_cast<std::int64_t>(i), static_cast<std::int64_t>(files.size()),
                    "reading the mesh");
    const fs::path& file = files[i];
    check_format(file);
    const std::uint64_t first = spill.vertices.size();
    if (is_gltf(file)) {
      GltfSpiller(file, options, spill).run();
    } else {
      is_obj(file) ? spill_obj_meshes(file, options.textures, spill) : spill_ply_meshes(file, options.textures, spill);
    }
    const geometry::Mat3 turn = turn_of(file, options);
    const bool turns = !turn.isIdentity(0);
    spill.vertices.change(first, [&](SpilledVertex& vertex) {
      Eigen::Map<Vec3> position(vertex.position.data());
      if (turns) position = (turn * position).eval();
      if (!(position.cwiseAbs().maxCoeff() <= kFarthest_m)) refuse_extent(file);
    });
  }
}

std::vector<fs::path> list_mesh_files(const std::vector<fs::path>& given) {
  std::vector<fs::path> out;
  for (const fs::path& path : given) {
    std::error_code error;
    if (!fs::is_directory(path, error)) {
      out.push_back(path);
      continue;
    }
    std::vector<fs::path> found;
    for (fs::recursive_directory_iterator it(path, error), end; !error && it != end; it.increment(error))
      if (is_mesh_file(it->path()) && it->is_regular_file(error)) found.push_back(it->path());
    if (error) throw InputError(path.string(), "cannot be listed: " + error.message());
    if (found.empty()) throw InputError(path.string(), "contains no mesh file (.obj, .glb, .gltf or .ply)");
    std::sort(found.begin(), found.end());
    out.insert(out.end(), found.begin(), found.end());
  }
  return out;
}

MeshFileSizes mesh_file_sizes(const std::vector<fs::path>& files, bool textures) {
  MeshFileSizes out;
  std::set<fs::path> images;
  for (const fs::path& file : files) {
    out.meshes += bytes_of(file);
    if (base::to_lower(file.extension().string()) == ".gltf") out.meshes += bytes_named_by(file);
    if (!textures || is_gltf(file) || !is_mesh_file(file)) continue;
    const std::vector<fs::path> own = is_obj(file) ? obj_image_files(file) : ply_image_files(file);
    images.insert(own.begin(), own.end());
  }
  for (const fs::path& image : images) out.images += bytes_of(image);
  return out;
}

std::uintmax_t estimated_memory_bytes(const std::vector<fs::path>& files, bool textures) {
  constexpr std::uintmax_t kTimesText = 6, kTimesBinary = 22, kTimesImage = 15;
  std::uintmax_t text = 0;
  for (const fs::path& file : files) text += is_obj(file) ? bytes_of(file) : 0;
  const MeshFileSizes sizes = mesh_file_sizes(files, textures);
  return kTimesText * text + kTimesBinary * (sizes.meshes - text) + kTimesImage * sizes.images;
}

}  // namespace tileflight::mesh_files
