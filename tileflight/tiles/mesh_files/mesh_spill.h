#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/tiles/mesh_files/indexed_faces.h"
#include "tileflight/tiles/mesh_files/mesh_source.h"
#include "tileflight/tiles/mesh_files/record_file.h"
#include "tileflight/tiles/mesh_files/texel_store.h"

namespace tileflight::mesh_files {

/// Appearance of a material.
struct SurfaceAppearance {
  std::shared_ptr<const imaging::RgbImage> texture = nullptr;  ///< null: plain, or coloured by vertex
  imaging::Wrap wrap_u = imaging::Wrap::kRepeat, wrap_v = imaging::Wrap::kRepeat;
  std::array<float, 4> base_color{1.0F, 1.0F, 1.0F, 1.0F};  ///< linear
  bool has_colors = false;                                  ///< of vertices
  bool v_up = false;                                        ///< the file's v points up
  std::array<float, 2> uv_scale{1.0F, 1.0F}, uv_offset{0.0F, 0.0F};

  /// Texture coordinates as TexturedMesh has them (v down) from the file's.
  Eigen::Vector2f uv(const Eigen::Vector2f& file_uv) const;
  friend bool operator==(const SurfaceAppearance&, const SurfaceAppearance&) = default;
};

/// A vertex on disk.
struct SpilledVertex {
  std::array<double, 3> position{};
  std::array<float, 3> file_color{1.0F, 1.0F, 1.0F};  ///< as in the file, until the file is read to its end
  std::array<std::uint8_t, 4> color{};                ///< linear RGBA
};

/// A triangle on disk; the indices count vertices and texture coordinates of all files (kInvalidIndex: none).
struct SpilledFace {
  std::array<std::uint32_t, 3> position{}, uv{};
  std::uint32_t material = 0;
};

/// A triangle of a source with all that belongs to it.
struct SourceTriangle {
  std::array<std::array<double, 3>, 3> position{};  ///< metres, z up
  std::array<std::array<float, 2>, 3> uv{};         ///< v down; 0 without texture
  std::array<std::array<std::uint8_t, 4>, 3> color{};
  std::uint32_t material = 0;

  geometry::Vec3 corner(std::size_t k) const { return geometry::Vec3(position[k].data()); }
};

/// A mesh of any number of files on disk: what is in memory does not depend on its size.
class MeshSpill {
 public:
  /// Writes into this folder, which it makes.
  explicit MeshSpill(const std::filesystem::path& folder);

  RecordFile<SpilledVertex> vertices;
  RecordFile<std::array<float, 2>> uv;
  RecordFile<SpilledFace> faces;
  TexelStore texels;
  std::vector<SurfaceAppearance> materials;  ///< with stand-ins for textures
  std::vector<std::string> copyrights, warnings;

  /// Calls `visit` for each triangle with an area, in the files' order. Returns the number of those without.
  std::int64_t for_each_triangle(const std::function<void(const SourceTriangle&)>& visit);

  /// The stand-in of an image file, which is decoded and stored when it is first asked for.
  std::shared_ptr<const imaging::RgbImage> image(const std::filesystem::path& file);

  /// Adds warnings, each once.
  void warn(const std::string& warning);

 private:
  std::map<std::filesystem::path, std::shared_ptr<const imaging::RgbImage>> images_;
};

/// Takes one OBJ or PLY file into a spill. Polygons are triangulated as in memory.
class SpillReceiver : public FaceReceiver {
 public:
  /// `file`: for messages.
  SpillReceiver(MeshSpill& spill, std::string file);

  void add_position(const geometry::Vec3& position, const std::optional<std::array<float, 3>>& color) override;
  void add_uv(const Eigen::Vector2f& uv) override;
  void use_material(const std::string& material) override;
  void add_face(const std::vector<FaceCorner>& corners) override;

  /// Ends the file: colours become linear after `color_scale(largest value)`, and `look` says how the triangles of a
  /// material look that have texture coordinates or have none.
  void finish(const std::function<float(float)>& color_scale,
              const std::function<SurfaceAppearance(const std::string& material, bool with_uv)>& look);

  bool has_colors() const { return has_colors_; }

 private:
  void add_triangle(const std::array<FaceCorner, 3>& corners);

  MeshSpill& spill_;
  std::string file_;
  std::uint32_t first_vertex_, first_uv_, first_material_;
  bool has_colors_ = false;
  float highest_color_ = 0.0F;
  std::map<std::string, std::uint32_t> group_of_;  ///< by material
  std::vector<std::string> groups_;
  std::vector<bool> is_used_;  ///< two for each group: with texture coordinates, without
  std::uint32_t group_ = 0;
};

/// The mesh files that are meant: the files themselves and, of a folder, all mesh files in it and in its folders, in
/// order of their paths. Throws InputError: a folder without any.
std::vector<std::filesystem::path> list_mesh_files(const std::vector<std::filesystem::path>& given);

/// All files as one mesh; warnings name the file if there are several. Throws as the function for one file; files
/// without a triangle are allowed if another has one.
MeshSource read_mesh_source(const std::vector<std::filesystem::path>& files, const MeshSourceOptions& options);

/// The same on disk for a mesh that does not fit into memory. Triangles without area are kept. Throws as in memory.
void spill_mesh_source(const std::vector<std::filesystem::path>& files, const MeshSourceOptions& options,
                       MeshSpill& spill, const Progress& progress = {});

/// Bytes on disk of mesh files and of the images that they refer to.
struct MeshFileSizes {
  std::uintmax_t meshes = 0, images = 0;
};
MeshFileSizes mesh_file_sizes(const std::vector<std::filesystem::path>& files, bool textures);

/// Memory that reading the files and writing them with write_mesh_tileset() would take, bytes, estimated from the
/// files' sizes: text and binary formats take some 100 and 20 bytes a triangle, images an eighth to a tenth of their
/// pixels.
std::uintmax_t estimated_memory_bytes(const std::vector<std::filesystem::path>& files, bool textures);

}  // namespace tileflight::mesh_files
