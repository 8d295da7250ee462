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
  bool has_colors = false;                                  ///< vertices have colours
  bool v_up = false;                                        ///< the file's v points up
  std::array<float, 2> uv_scale{1.0F, 1.0F}, uv_offset{0.0F, 0.0F};

  /// Converts texture coordinates of the file to those of TexturedMesh (v down).
  Eigen::Vector2f uv(const Eigen::Vector2f& file_uv) const;
  friend bool operator==(const SurfaceAppearance&, const SurfaceAppearance&) = default;
};

/// A vertex on disk.
struct SpilledVertex {
  std::array<double, 3> position{};
  std::array<float, 3> file_color{1.0F, 1.0F, 1.0F};  ///< colour of the file, until the file is read to its end
  std::array<std::uint8_t, 4> color{};                ///< linear RGBA
};

/// A triangle on disk. Its indices count the vertices and texture coordinates of all files (kInvalidIndex: none).
struct SpilledFace {
  std::array<std::uint32_t, 3> position{}, uv{};
  std::uint32_t material = 0;
};

/// A triangle of a source with the attributes of its corners.
struct SourceTriangle {
  std::array<std::array<double, 3>, 3> position{};  ///< metres, z up
  std::array<std::array<float, 2>, 3> uv{};         ///< v down; 0 without texture
  std::array<std::array<std::uint8_t, 4>, 3> color{};
  std::uint32_t material = 0;

  geometry::Vec3 corner(std::size_t k) const { return geometry::Vec3(position[k].data()); }
};

/// A mesh of any number of files, held on disk. The memory that it needs does not depend on its size.
class MeshSpill {
 public:
  /// Creates the folder and writes into it.
  explicit MeshSpill(const std::filesystem::path& folder);

  RecordFile<SpilledVertex> vertices;
  RecordFile<std::array<float, 2>> uv;
  RecordFile<SpilledFace> faces;
  TexelStore texels;
  std::vector<SurfaceAppearance> materials;  ///< textures are stand-ins
  std::vector<std::string> copyrights, warnings;

  /// Calls `visit` for each triangle with an area, in the files' order. Returns the number of triangles without area.
  std::int64_t for_each_triangle(const std::function<void(const SourceTriangle&)>& visit);

  /// Returns the stand-in of an image file, which is decoded and stored when it is first requested.
  std::shared_ptr<const imaging::RgbImage> image(const std::filesystem::path& file);

  /// Adds warnings, each once.
  void warn(const std::string& warning);

 private:
  std::map<std::filesystem::path, std::shared_ptr<const imaging::RgbImage>> images_;
};

/// Writes one OBJ or PLY file into a spill. Polygons are triangulated like those of a mesh in memory.
class SpillReceiver : public FaceReceiver {
 public:
  /// `file`: for messages.
  SpillReceiver(MeshSpill& spill, std::string file);

  void add_position(const geometry::Vec3& position, const std::optional<std::array<float, 3>>& color) override;
  void add_uv(const Eigen::Vector2f& uv) override;
  void use_material(const std::string& material) override;
  void add_face(const std::vector<FaceCorner>& corners) override;

  /// Ends the file. Colours are multiplied by `color_scale(largest value)` and become linear. `look` returns the
  /// appearance of a material's triangles, with texture coordinates or without.
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

/// Returns the mesh files that a user names: files as given, and for a folder all mesh files below it in order of their
/// paths. Throws InputError for a folder without any.
std::vector<std::filesystem::path> list_mesh_files(const std::vector<std::filesystem::path>& given);

/// Reads all files as one mesh. Warnings name the file if there are several. Throws InputError like the function for
/// one file, but files without a triangle are allowed if another has one.
MeshSource read_mesh_source(const std::vector<std::filesystem::path>& files, const MeshSourceOptions& options);

/// Reads all files as one mesh on disk, for a mesh that does not fit into memory. Triangles without area are kept.
/// Throws InputError like read_mesh_source().
void spill_mesh_source(const std::vector<std::filesystem::path>& files, const MeshSourceOptions& options,
                       MeshSpill& spill, const Progress& progress = {});

/// Sizes on disk of mesh files and of the images that they refer to, bytes.
struct MeshFileSizes {
  std::uintmax_t meshes = 0, images = 0;
};
/// Returns the sizes of files that exist. `textures`: whether images count.
MeshFileSizes mesh_file_sizes(const std::vector<std::filesystem::path>& files, bool textures);

/// Estimates the memory, in bytes, that it takes to read the files and to write them with write_mesh_tileset(), from
/// the files' sizes: text and binary formats take some 100 and 20 bytes a triangle, images an eighth to a tenth of
/// their pixels.
std::uintmax_t estimated_memory_bytes(const std::vector<std::filesystem::path>& files, bool textures);

}  // namespace tileflight::mesh_files
