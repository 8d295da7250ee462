#include "tileflight/scene/scene.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <mutex>
#include <string>
#include <utility>

#include "tileflight/base/input_error.h"
#include "tileflight/scene/beam_tree.h"
#include "tileflight/scene/embree_tree.h"
#include "tileflight/scene/packets.h"

namespace tileflight::scene {

// RayPacket8 is passed to Embree without conversion.
static_assert(sizeof(RayPacket8) == sizeof(RTCRayHit8) && alignof(RayPacket8) == alignof(RTCRayHit8));
static_assert(offsetof(RayPacket8, near) == offsetof(RTCRayHit8, ray.tnear));
static_assert(offsetof(RayPacket8, direction_x) == offsetof(RTCRayHit8, ray.dir_x));
static_assert(offsetof(RayPacket8, far) == offsetof(RTCRayHit8, ray.tfar));
static_assert(offsetof(RayPacket8, flags) == offsetof(RTCRayHit8, ray.flags));
static_assert(offsetof(RayPacket8, normal_x) == offsetof(RTCRayHit8, hit.Ng_x));
static_assert(offsetof(RayPacket8, u) == offsetof(RTCRayHit8, hit.u));
static_assert(offsetof(RayPacket8, triangle) == offsetof(RTCRayHit8, hit.primID));
static_assert(offsetof(RayPacket8, mesh) == offsetof(RTCRayHit8, hit.geomID));
static_assert(RayPacket8::kMiss == RTC_INVALID_GEOMETRY_ID);
static_assert(offsetof(RTCRayHit8, ray) == 0 && alignof(RTCRay8) <= alignof(RayPacket8));

namespace {

alignas(32) constexpr int kAllLanes[8] = {-1, -1, -1, -1, -1, -1, -1, -1};  // disabled by far limits

std::string mesh_label(const imaging::TexturedMesh& mesh, std::size_t index) {
  return mesh.name.empty() ? "mesh " + std::to_string(index) : mesh.name;
}

void check_attributes(const imaging::TexturedMesh& mesh, const std::string& where) {
  const std::size_t vertices = mesh.mesh.vertices.size();
  if (!mesh.uv.empty() && mesh.uv.size() != vertices) {
    throw InputError(where, std::to_string(mesh.uv.size()) + " texture coordinates for " + std::to_string(vertices) +
                                " vertices; give one per vertex");
  }
  if (!mesh.colors.empty() && mesh.colors.size() != vertices) {
    throw InputError(where, std::to_string(mesh.colors.size()) + " colours for " + std::to_string(vertices) +
                                " vertices; give one per vertex");
  }
  const auto finite = [](const Eigen::Vector2f& uv) { return uv.allFinite(); };
  if (!std::ranges::all_of(mesh.uv, finite))
    throw InputError(where, "a texture coordinate is not finite; repair the mesh");
  if (mesh.texture && mesh.texture->empty()) throw InputError(where, "its texture has no pixels; leave it out");
}

void check_mesh(const imaging::TexturedMesh& mesh, std::size_t index) {
  const std::string where = mesh_label(mesh, index);
  const std::size_t vertices = mesh.mesh.vertices.size();
  const auto finite = [](const geometry::Vec3& p) { return p.allFinite(); };
  if (!std::ranges::all_of(mesh.mesh.vertices, finite)) {
    throw InputError(where, "a vertex is not finite; repair the mesh");
  }
  const auto inside = [&](const geometry::Triangle& t) {
    return t[0] < vertices && t[1] < vertices && t[2] < vertices;
  };
  if (!std::ranges::all_of(mesh.mesh.triangles, inside)) {
    throw InputError(where, "a triangle refers to a vertex that does not exist; repair the mesh");
  }
  check_attributes(mesh, where);
}

geometry::Box3 bounds_of(const std::vector<imaging::TexturedMesh>& meshes) {
  geometry::Box3 box;
  for (const imaging::TexturedMesh& mesh : meshes) {
    if (mesh.mesh.triangles.empty()) continue;
    for (const geometry::Vec3& vertex : mesh.mesh.vertices) box.extend(vertex);
  }
  return box;
}

RTCRay embree_ray(const Ray& ray, const geometry::Vec3& anchor, double max_distance_m) {
  const geometry::Vec3 origin = ray.origin - anchor;
  RTCRay r{};
  r.org_x = static_cast<float>(origin.x());
  r.org_y = static_cast<float>(origin.y());
  r.org_z = static_cast<float>(origin.z());
  r.dir_x = static_cast<float>(ray.direction.x());
  r.dir_y = static_cast<float>(ray.direction.y());
  r.dir_z = static_cast<float>(ray.direction.z());
  r.tfar = static_cast<float>(max_distance_m);
  r.mask = 0xFFFFFFFFU;
  return r;
}

std::array<geometry::Vec3, 3> corners(const geometry::TriangleMesh& mesh, std::uint32_t triangle) {
  const geometry::Triangle& t = mesh.triangles[triangle];
  return {mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
}

/// State of Embree's point query: the tree's triangles, and the nearest distance so far.
struct NearestSearch {
  const std::vector<imaging::TexturedMesh>* meshes;
  geometry::Vec3 point;
  double distance_m;  ///< of the nearest surface found so far, or the limit
  double slack_m;     ///< bound on the rounding of the tree's float boxes
  bool found = false;

  float radius() const { return static_cast<float>((distance_m + slack_m) * (1.0 + 1e-6)); }
};

bool look_at_triangle(RTCPointQueryFunctionArguments* asked) {
  auto& search = *static_cast<NearestSearch*>(asked->userPtr);
  const auto p = corners((*search.meshes)[asked->geomID].mesh, asked->primID);
  const double distance_m = (geometry::closest_point_on_triangle(search.point, p[0], p[1], p[2]) - search.point).norm();
  if (distance_m > search.distance_m) return false;
  search.distance_m = distance_m;
  search.found = true;
  asked->query->radius = search.radius();
  return true;
}

/// Distance along the ray to the triangle's plane in double precision; `distance_m` if the plane is edge-on.
double plane_distance(const Ray& ray, const std::array<geometry::Vec3, 3>& p, double distance_m) {
  const geometry::Vec3 normal = (p[1] - p[0]).cross(p[2] - p[0]);
  const double slope = normal.dot(ray.direction);
  if (std::abs(slope) < 1e-3 * normal.norm()) return distance_m;
  return normal.dot(p[0] - ray.origin) / slope;
}

}  // namespace

/// An object built on first use.
template <class Tree>
class LazyTree {
 public:
  template <class Build>
  const Tree& get(const Build& build) {
    std::call_once(once_, [&] { build_apart(build); });
    return *tree_;
  }

 private:
  /// Builds in an arena of its own, for two reasons. While this thread waits for parts of the tree, it must not pick up
  /// a task that needs the tree. And Embree's scene keeps a task group, whose context would be bound to that of the
  /// algorithm in which the tree happens to be built, and would refer to it after its end.
  template <class Build>
  void build_apart(const Build& build) {
    tbb::task_arena arena(tbb::this_task_arena::max_concurrency());
    arena.execute([&] { tree_.emplace(build()); });
  }

  std::once_flag once_;
  std::optional<Tree> tree_;
};

struct Scene::Impl {
  std::vector<imaging::TexturedMesh> meshes;
  geometry::Box3 bounds;
  geometry::Vec3 anchor;
  std::size_t triangle_count = 0;

  RTCScene rays() {
    return ray_tree_.get([this] { return build_embree_tree(meshes, anchor); }).scene.get();
  }
  const BeamTree& beams() {
    return beam_tree_.get([this] { return BeamTree(meshes, anchor); });
  }

 private:
  LazyTree<EmbreeTree> ray_tree_;
  LazyTree<BeamTree> beam_tree_;
};

Scene::Scene(std::vector<imaging::TexturedMesh> meshes, const std::optional<geometry::Vec3>& anchor)
    : impl_(std::make_unique<Impl>()) {
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    check_mesh(meshes[i], i);
    impl_->triangle_count += meshes[i].mesh.triangles.size();
  }
  if (impl_->triangle_count == 0) throw InputError("scene", "contains no triangle; is the region empty?");
  impl_->meshes = std::move(meshes);
  impl_->bounds = bounds_of(impl_->meshes);
  impl_->anchor = anchor.value_or(impl_->bounds.center());
}

Scene::~Scene() = default;
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;

const std::vector<imaging::TexturedMesh>& Scene::meshes() const { return impl_->meshes; }
std::vector<imaging::TexturedMesh> Scene::release_meshes() && {
  const std::unique_ptr<Impl> ended = std::move(impl_);  // Embree uses the triangles until then; they do not move
  return std::move(ended->meshes);
}

const geometry::Box3& Scene::bounds() const { return impl_->bounds; }
const geometry::Vec3& Scene::anchor() const { return impl_->anchor; }
std::size_t Scene::triangle_count() const { return impl_->triangle_count; }

void Scene::build_ray_tree() const { impl_->rays(); }
void Scene::build_beam_tree() const { impl_->beams(); }

std::optional<Hit> Scene::intersect(const Ray& ray, double max_distance_m) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit query{};
  query.ray = embree_ray(ray, impl_->anchor, max_distance_m);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(impl_->rays(), &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  const auto triangle = corners(impl_->meshes[query.hit.geomID].mesh, query.hit.primID);
  const double distance_m = plane_distance(ray, triangle, query.ray.tfar);
  return Hit{distance_m, query.hit.geomID, query.hit.primID, query.hit.u, query.hit.v};
}

bool Scene::is_occluded(const Ray& ray, double max_distance_m) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay query = embree_ray(ray, impl_->anchor, max_distance_m);
  rtcOccluded1(impl_->rays(), &context, &query);
  return query.tfar < 0.0F;
}

std::optional<double> Scene::distance_to_surface_m(const geometry::Vec3& point, double within_m) const {
  constexpr double kFloatStep = 1e-6;  // relative to a coordinate, some eight times the precision of floats
  const geometry::Vec3 from = point - impl_->anchor;
  const double largest_m = from.norm() + impl_->bounds.sizes().norm();
  NearestSearch search{&impl_->meshes, point, within_m, kFloatStep * largest_m};
  RTCPointQuery query{};
  query.x = static_cast<float>(from.x());
  query.y = static_cast<float>(from.y());
  query.z = static_cast<float>(from.z());
  query.radius = search.radius();
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(impl_->rays(), &query, &context, look_at_triangle, &search);
  return search.found ? std::optional(search.distance_m) : std::nullopt;
}

void Scene::intersect(RayPacket8& packet) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect8(kAllLanes, impl_->rays(), &context, reinterpret_cast<RTCRayHit8*>(&packet));
}

void Scene::intersect(std::span<RayPacket8> beam) const {
  if (impl_->beams().intersect(beam)) return;
  for (RayPacket8& packet : beam) intersect(packet);
}

void Scene::test_occlusion(RayPacket8& packet) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcOccluded8(kAllLanes, impl_->rays(), &context, reinterpret_cast<RTCRay8*>(&packet));
}

geometry::Vec3 Scene::position(const Hit& hit) const {
  assert(hit.mesh < impl_->meshes.size());
  const auto p = corners(impl_->meshes[hit.mesh].mesh, hit.triangle);
  const double u = hit.u;
  const double v = hit.v;
  return p[0] + u * (p[1] - p[0]) + v * (p[2] - p[0]);
}

geometry::Vec3 Scene::normal(const Hit& hit) const {
  assert(hit.mesh < impl_->meshes.size());
  const auto p = corners(impl_->meshes[hit.mesh].mesh, hit.triangle);
  const geometry::Vec3 area_normal = (p[1] - p[0]).cross(p[2] - p[0]);
  const double length = area_normal.norm();
  return length > 0.0 ? geometry::Vec3(area_normal / length) : geometry::Vec3(geometry::Vec3::Zero());
}

geometry::TriangleMesh merge_meshes(const std::vector<imaging::TexturedMesh>& meshes) {
  geometry::TriangleMesh all;
  std::size_t triangles = 0;
  for (const imaging::TexturedMesh& part : meshes) triangles += part.mesh.triangles.size();
  all.triangles.reserve(triangles);
  for (const imaging::TexturedMesh& part : meshes) {
    const auto offset = static_cast<std::uint32_t>(all.vertices.size());
    all.vertices.insert(all.vertices.end(), part.mesh.vertices.begin(), part.mesh.vertices.end());
    for (const geometry::Triangle& t : part.mesh.triangles) {
      all.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
    }
  }
  return all;
}

}  // namespace tileflight::scene
