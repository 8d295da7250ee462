#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <limits>

#include "arrays.h"
#include "bindings.h"
#include "input_options.h"
#include "interruptible.h"
#include "tileflight/world/ground_truth/surface_samples.h"
#include "tileflight/world/ground_truth/voxelize.h"

namespace tileflight::python {
namespace {

app::RegionOptions region_options(const std::vector<double>& center, const std::vector<double>& center_local,
                                  const std::vector<double>& size, const std::vector<double>& origin,
                                  const std::vector<std::string>& region, double error_m, bool allow_incomplete) {
  const auto require = [](const std::vector<double>& numbers, std::size_t least, std::size_t most, const char* what) {
    if (!numbers.empty() && (numbers.size() < least || numbers.size() > most)) throw py::value_error(what);
    if (!std::ranges::all_of(numbers, [](double v) { return std::isfinite(v); })) throw py::value_error(what);
  };
  require(center, 2, 3, "center: latitude, longitude in degrees, and optionally metres above the ellipsoid");
  require(center_local, 3, 3, "center_local: x, y, z in metres");
  require(size, 3, 3, "size: metres east, north, up");
  require(origin, 3, 3, "origin: latitude, longitude in degrees, metres above the ellipsoid");
  if (!(error_m >= 0.0)) throw py::value_error("error must not be negative");
  return {center, center_local, size, origin, region, error_m, allow_incomplete};
}

SceneHandle load(const std::filesystem::path& place, const std::vector<double>& center,
                 const std::vector<double>& center_local, const std::vector<double>& size,
                 const std::vector<double>& origin, const std::vector<std::string>& region, double error_m,
                 bool textures, bool allow_incomplete, const std::optional<geometry::Vec3>& anchor,
                 const py::object& progress) {
  const std::string source = place.string();  // a path or a word, such as a URL
  tileset::LoadOptions options =
      app::load_options(region_options(center, center_local, size, origin, region, error_m, allow_incomplete));
  options.textures = textures;
  options.source = app::source_options({});
  return call_interruptibly(progress, [&](const Progress& report) {
    tileset::LoadedTiles tiles = tileset::load_region(source, options, report);
    if (tiles.meshes.empty()) throw InputError(source, "has no surface in the region");
    std::vector<imaging::TexturedMesh> meshes = std::move(tiles.meshes);
    tiles.meshes.clear();
    return std::make_shared<LoadedScene>(std::move(meshes), std::move(tiles), anchor);
  });
}

SceneHandle scene_from_mesh(const InputArray<double>& vertices, const InputArray<std::uint32_t>& triangles) {
  require_columns(triangles, 3, "triangles");
  imaging::TexturedMesh mesh;
  mesh.name = "mesh";
  mesh.mesh.vertices = points_from_array(vertices, "vertices");
  const auto* begin = reinterpret_cast<const geometry::Triangle*>(triangles.data());
  mesh.mesh.triangles.assign(begin, begin + triangles.shape(0));
  tileset::LoadedTiles tiles;
  tiles.complete = true;
  std::vector<imaging::TexturedMesh> meshes;
  meshes.push_back(std::move(mesh));
  auto scene = std::make_shared<LoadedScene>(std::move(meshes), std::move(tiles));
  const geometry::Box3& bounds = scene->scene.bounds();
  scene->tiles.region = {.center = bounds.center(), .size = bounds.sizes()};
  scene->tiles.triangles = static_cast<std::int64_t>(scene->scene.triangle_count());
  return scene;
}

py::list mesh_list(const py::object& self) {
  const auto& scene = self.cast<const LoadedScene&>();
  py::list list;
  for (const imaging::TexturedMesh& mesh : scene.scene.meshes()) {
    const auto vertices = static_cast<py::ssize_t>(mesh.mesh.vertices.size());
    const auto triangles = static_cast<py::ssize_t>(mesh.mesh.triangles.size());
    py::dict entry;
    entry["name"] = mesh.name;
    entry["vertices"] = view_of<double>(mesh.mesh.vertices.data(), {vertices, 3}, self);
    entry["triangles"] = view_of<std::uint32_t>(mesh.mesh.triangles.data(), {triangles, 3}, self);
    entry["uv"] = mesh.uv.empty() ? py::object(py::none()) : view_of<float>(mesh.uv.data(), {vertices, 2}, self);
    entry["texture"] = mesh.texture
                           ? py::object(view_of<std::uint8_t>(mesh.texture->pixels.data(),
                                                              {mesh.texture->height, mesh.texture->width, 3}, self))
                           : py::object(py::none());
    list.append(entry);
  }
  return list;
}

/// The nearest hit of each ray; infinite distance and index -1 where there is none.
struct RayHits {
  std::vector<double> distances;
  std::vector<std::int32_t> meshes, triangles;
  std::vector<geometry::Vec3> normals;

  explicit RayHits(std::size_t count)
      : distances(count, std::numeric_limits<double>::infinity()),
        meshes(count, -1),
        triangles(count, -1),
        normals(count, geometry::Vec3::Zero()) {}

  void set(std::size_t i, const scene::Hit& hit, const geometry::Vec3& normal) {
    distances[i] = hit.distance_m;
    meshes[i] = static_cast<std::int32_t>(hit.mesh);
    triangles[i] = static_cast<std::int32_t>(hit.triangle);
    normals[i] = normal;
  }
};

std::vector<scene::Ray> rays_from(const InputArray<double>& origins, const InputArray<double>& directions) {
  const std::vector<geometry::Vec3> from = points_from_array(origins, "origins");
  const std::vector<geometry::Vec3> along = points_from_array(directions, "directions");
  if (from.size() != along.size() && from.size() != 1)
    throw py::value_error("there must be as many origins as directions, or one origin");
  std::vector<scene::Ray> rays;
  for (std::size_t i = 0; i < along.size(); ++i) {
    const geometry::Vec3& origin = from[from.size() == 1 ? 0 : i];
    const double length = along[i].norm();
    if (!origin.allFinite() || !std::isfinite(length) || !(length > 0.0))
      throw py::value_error("origins and directions must be finite, directions not zero");
    rays.push_back({origin, along[i] / length});
  }
  return rays;
}

py::dict cast_rays(const LoadedScene& scene, const InputArray<double>& origins, const InputArray<double>& directions,
                   double max_distance) {
  const std::vector<scene::Ray> rays = rays_from(origins, directions);
  RayHits hits(rays.size());
  {
    const py::gil_scoped_release unlocked;
    tbb::parallel_for(std::size_t{0}, rays.size(), [&](std::size_t i) {
      if (const auto hit = scene.scene.intersect(rays[i], max_distance)) hits.set(i, *hit, scene.scene.normal(*hit));
    });
  }
  const auto count = static_cast<py::ssize_t>(rays.size());
  py::dict result;
  result["distance"] = move_to_array<double>(std::move(hits.distances), {count});
  result["mesh"] = move_to_array<std::int32_t>(std::move(hits.meshes), {count});
  result["triangle"] = move_to_array<std::int32_t>(std::move(hits.triangles), {count});
  result["normal"] = points_to_array(std::move(hits.normals));
  return result;
}

py::array_t<double> distance_to_surface(const LoadedScene& scene, const InputArray<double>& points, double within) {
  const std::vector<geometry::Vec3> from = points_from_array(points, "points");
  std::vector<double> distances(from.size(), std::numeric_limits<double>::infinity());
  {
    const py::gil_scoped_release unlocked;
    tbb::parallel_for(std::size_t{0}, from.size(), [&](std::size_t i) {
      if (const auto distance = scene.scene.distance_to_surface_m(from[i], within)) distances[i] = *distance;
    });
  }
  return move_to_array<double>(std::move(distances), {static_cast<py::ssize_t>(from.size())});
}

geometry::VoxelGrid voxelize(const LoadedScene& scene, double edge, const py::object& progress) {
  return call_interruptibly(progress, [&](const Progress& report) {
    return ground_truth::voxelize(scene::merge_meshes(scene.scene.meshes()), scene.tiles.region.box(), edge, report);
  });
}

py::dict sample_surface(const LoadedScene& scene, double per_m2, std::uint64_t seed) {
  if (!(per_m2 > 0.0)) throw py::value_error("per_m2 must be positive");
  geometry::PointCloud samples = call_interruptibly(py::none(), [&](const Progress&) {
    return ground_truth::sample_surface(scene::merge_meshes(scene.scene.meshes()), scene.tiles.region.box(), per_m2,
                                        seed);
  });
  const auto count = static_cast<py::ssize_t>(samples.size());
  py::dict result;
  result["points"] = points_to_array(std::move(samples.positions));
  result["normals"] = move_to_array<float>(std::move(samples.normals), {count, 3});
  return result;
}

py::object origin_of(const LoadedScene& scene) {
  const auto origin = scene.origin();
  if (!origin) return py::none();
  return py::make_tuple(origin->latitude_deg, origin->longitude_deg, origin->height.m);
}

const geometry::LocalFrame& frame_of(const LoadedScene& scene) {
  if (!scene.tiles.local_frame) throw py::value_error("the place is not georeferenced");
  return *scene.tiles.local_frame;
}

py::array_t<double> to_local(const LoadedScene& scene, const InputArray<double>& geodetic) {
  const geometry::LocalFrame& frame = frame_of(scene);
  std::vector<geometry::Vec3> points = points_from_array(geodetic, "geodetic");
  for (geometry::Vec3& p : points) p = frame.local_from_geodetic({p.x(), p.y(), geometry::EllipsoidalHeight{p.z()}});
  return points_to_array(std::move(points));
}

py::array_t<double> to_geodetic(const LoadedScene& scene, const InputArray<double>& local) {
  const geometry::LocalFrame& frame = frame_of(scene);
  std::vector<geometry::Vec3> points = points_from_array(local, "points");
  for (geometry::Vec3& p : points) {
    const geometry::Geodetic place = frame.geodetic_from_local(p);
    p = {place.latitude_deg, place.longitude_deg, place.height.m};
  }
  return points_to_array(std::move(points));
}

py::array_t<double> box_to_array(const geometry::Box3& box) { return points_to_array({box.min(), box.max()}); }

void bind_voxel_grid(py::module_& module) {
  using geometry::VoxelGrid;
  py::class_<VoxelGrid, std::shared_ptr<VoxelGrid>>(
      module, "VoxelGrid", "A sparse grid of cubic cells; axes and cells along east, north, up of the local frame.")
      .def_readonly("edge", &VoxelGrid::edge_m, "Edge of a cell, metres.")
      .def_readonly("dims", &VoxelGrid::dims, "Cells along east, north, up.")
      .def_property_readonly(
          "origin", [](const VoxelGrid& g) { return g.origin; }, "Minimum corner (3), metres.")
      .def_property_readonly(
          "cells",
          [](const py::object& self) {
            const auto& grid = self.cast<const VoxelGrid&>();
            static_assert(sizeof(geometry::Cell) == 3 * sizeof(std::int32_t));
            return view_of<std::int32_t>(grid.occupied.data(), {static_cast<py::ssize_t>(grid.occupied.size()), 3},
                                         self);
          },
          "Indices (N, 3) of the occupied cells, sorted; a view.")
      .def_property_readonly(
          "centers", [](const VoxelGrid& g) { return points_to_array(geometry::cell_centers(g).positions); },
          "Centres (N, 3) of the occupied cells, metres, in the order of `cells`.")
      .def(
          "write_binvox",
          [](const VoxelGrid& g, const std::filesystem::path& file) { geometry::write_binvox(file, g); },
          py::arg("file"))
      .def("__len__", [](const VoxelGrid& g) { return g.occupied.size(); });
  module.def("read_binvox", &geometry::read_binvox, py::arg("file"), "A grid from a binvox file.");
}

void bind_load(py::module_& module) {
  using py::arg;
  module.def(
      "load", &load, arg("source"), py::kw_only(), arg("center") = std::vector<double>{},
      arg("center_local") = std::vector<double>{}, arg("size") = std::vector<double>{},
      arg("origin") = std::vector<double>{}, arg("region") = std::vector<std::string>{}, arg("error") = 0.0,
      arg("textures") = true, arg("allow_incomplete") = false, arg("anchor") = py::none(), arg("progress") = py::none(),
      "Loads a region of 3D Tiles. source: tileset.json, its folder, an archive (.3tz, .3dtiles), an http(s) "
      "URL, 'google' or 'ion:ASSET'. center: latitude, longitude in degrees[, ellipsoidal height in metres], or "
      "center_local: x, y, z in the tileset's frame; size: metres east, north, up; region: GeoJSON files "
      "instead; nothing of these: the whole of a small tileset. origin: of the local frame (default: the "
      "region's centre). error: allowed geometric error, metres; 0: the finest level. anchor: local point from "
      "which the ray tracer's single-precision coordinates count (default: the middle of the bounds; commands "
      "take the pose in the middle of the flight). progress: a callable (done, total, what). Raises InputError.");
}

}  // namespace

void bind_scene(py::module_& module) {
  using py::arg;
  bind_voxel_grid(module);
  py::class_<LoadedScene, SceneHandle>(
      module, "Scene", "A place as triangles with textures, in a local frame: metres, x east, y north, z up.")
      .def_static("from_mesh", &scene_from_mesh, arg("vertices"), arg("triangles"),
                  "A scene of one mesh: vertices (N, 3) in metres, triangles (M, 3) of vertex indices.")
      .def_property_readonly("meshes", &mesh_list,
                             "A list of dictionaries: name, vertices (N, 3) metres, triangles (M, 3), uv (N, 2) with "
                             "(0, 0) at the top left or None, texture (height, width, 3) or None; read-only views.")
      .def_property_readonly(
          "bounds", [](const LoadedScene& s) { return box_to_array(s.scene.bounds()); },
          "Minimum and maximum corner (2, 3) of all vertices, metres.")
      .def_property_readonly(
          "region", [](const LoadedScene& s) { return box_to_array(s.tiles.region.box()); },
          "Minimum and maximum corner (2, 3) of the region asked for, metres.")
      .def_property_readonly("triangles", [](const LoadedScene& s) { return s.scene.triangle_count(); })
      .def_property_readonly(
          "origin", &origin_of,
          "Latitude, longitude (degrees) and ellipsoidal height (metres) of the local frame; None if "
          "the place is not georeferenced.")
      .def_property_readonly(
          "complete", [](const LoadedScene& s) { return s.tiles.complete; },
          "Whether every tile of the region could be read.")
      .def_property_readonly(
          "failures", [](const LoadedScene& s) { return s.tiles.failures; },
          "A line for each tile that could not be read.")
      .def_property_readonly(
          "attribution", [](const LoadedScene& s) { return s.tiles.attribution; },
          "Copyrights to be shown with pictures, most frequent first.")
      .def_property_readonly(
          "cut_hash", [](const LoadedScene& s) { return s.tiles.cut_hash; },
          "SHA-256 over the identities of the tiles in use.")
      .def("to_local", &to_local, arg("geodetic"),
           "Local points (N, 3) of latitudes, longitudes (degrees) and ellipsoidal heights (N, 3).")
      .def("to_geodetic", &to_geodetic, arg("points"), "The inverse of to_local.")
      .def("cast_rays", &cast_rays, arg("origins"), arg("directions"), arg("max_distance") = 1e9,
           "Nearest surfaces along rays from origins (N, 3), or one (1, 3), in directions (N, 3) of any length. A "
           "dictionary: distance (N) metres, infinite without a hit; mesh, triangle (N) indices, -1 without a hit; "
           "normal (N, 3) unit, oriented by the winding.")
      .def("distance_to_surface", &distance_to_surface, arg("points"), arg("within") = 1e9,
           "Distances (N) from points (N, 3) to the nearest surface, metres; infinite beyond `within`.")
      .def("voxelize", &voxelize, arg("edge") = 1.0, arg("progress") = py::none(),
           "The cells of the region that a triangle touches, exactly; `edge` in metres.")
      .def("sample_surface", &sample_surface, arg("per_m2") = 16.0, arg("seed") = 1,
           "Points (N, 3) and unit normals (N, 3) uniformly by area on the surface in the region.")
      .def("__repr__", [](const LoadedScene& s) {
        return "<Scene of " + std::to_string(s.scene.triangle_count()) + " triangles>";
      });
  bind_load(module);
}

}  // namespace tileflight::python
