#include "tileflight/scene/scene.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "tileflight/base/input_error.h"
#include "tileflight/scene/beam_tree.h"
#include "tileflight/scene/embree_tree.h"
#include "tileflight/scene/lazy_tree.h"
#include "tileflight/scene/packets.h"
#include "tileflight/scene/part_queries.h"

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

/// Brings `search` up to date with the part's surfaces.
void search_part(const ScenePart& part, const float (&position)[3], NearestSearch& search) {
  search.meshes = &part.meshes();
  RTCPointQuery query{};
  query.x = position[0];
  query.y = position[1];
  query.z = position[2];
  query.radius = search.radius();
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(part.ray_tree().scene.get(), &query, &context, look_at_triangle, &search);
}

/// Distance along the ray to the triangle's plane in double precision; `distance_m` if the plane is edge-on.
double plane_distance(const Ray& ray, const std::array<geometry::Vec3, 3>& p, double distance_m) {
  const geometry::Vec3 normal = (p[1] - p[0]).cross(p[2] - p[0]);
  const double slope = normal.dot(ray.direction);
  if (std::abs(slope) < 1e-3 * normal.norm()) return distance_m;
  return normal.dot(p[0] - ray.origin) / slope;
}

}  // namespace

struct Scene::Impl {
  std::vector<std::shared_ptr<const ScenePart>> parts;
  std::shared_ptr<ScenePart> own;                    ///< the only part, of a scene that was made of meshes
  std::vector<const imaging::TexturedMesh*> meshes;  ///< of all parts
  geometry::Box3 bounds;
  geometry::Vec3 anchor;
  std::size_t triangle_count = 0;

  explicit Impl(std::vector<std::shared_ptr<const ScenePart>> all) : parts(std::move(all)) {
    for (const auto& part : parts) {
      for (const imaging::TexturedMesh& mesh : part->meshes()) meshes.push_back(&mesh);
      bounds.extend(part->bounds());
      triangle_count += part->triangle_count();
    }
    if (triangle_count == 0) throw InputError("scene", "contains no triangle; is the region empty?");
    anchor = parts.front()->frame().anchor();
  }

  bool is_whole() const { return parts.size() == 1; }
  /// Precondition: is_whole().
  RTCScene rays() const { return parts.front()->ray_tree().scene.get(); }
  /// Precondition: not is_whole().
  const PartQueries& queries() {
    return *queries_.get([this] { return std::make_unique<PartQueries>(parts); });
  }

 private:
  LazyTree<std::unique_ptr<PartQueries>> queries_;
};

namespace {

std::shared_ptr<ScenePart> one_part(std::vector<imaging::TexturedMesh> meshes,
                                    const std::optional<geometry::Vec3>& anchor) {
  const geometry::Box3 box = bounds_of(meshes);
  const SceneFrame frame(anchor.value_or(box.isEmpty() ? geometry::Vec3(geometry::Vec3::Zero()) : box.center()));
  return std::make_shared<ScenePart>(std::move(meshes), frame);
}

}  // namespace

Scene::Scene(std::vector<imaging::TexturedMesh> meshes, const std::optional<geometry::Vec3>& anchor) {
  const std::shared_ptr<ScenePart> part = one_part(std::move(meshes), anchor);
  impl_ = std::make_unique<Impl>(std::vector<std::shared_ptr<const ScenePart>>{part});
  impl_->own = part;
}

Scene::Scene(std::vector<std::shared_ptr<const ScenePart>> parts) {
  assert(!parts.empty());
  assert(std::ranges::all_of(parts, [&](const auto& part) {
    return part->frame().device() == parts.front()->frame().device() &&
           part->frame().anchor() == parts.front()->frame().anchor();
  }));
  impl_ = std::make_unique<Impl>(std::move(parts));
}

Scene::~Scene() = default;
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;

Scene::Meshes Scene::meshes() const { return Meshes(impl_->meshes); }
const std::vector<std::shared_ptr<const ScenePart>>& Scene::parts() const { return impl_->parts; }

std::vector<imaging::TexturedMesh> Scene::release_meshes() && {
  const std::unique_ptr<Impl> ended = std::move(impl_);  // Embree uses the triangles until then; they do not move
  assert(ended->own);
  return std::move(*ended->own).release_meshes();
}

const geometry::Box3& Scene::bounds() const { return impl_->bounds; }
const geometry::Vec3& Scene::anchor() const { return impl_->anchor; }
std::size_t Scene::triangle_count() const { return impl_->triangle_count; }

void Scene::build_ray_tree() const {
  tbb::parallel_for(std::size_t{0}, impl_->parts.size(), [&](std::size_t i) { impl_->parts[i]->build_ray_tree(); });
  if (!impl_->is_whole()) impl_->queries();
}

void Scene::build_beam_tree() const {
  if (impl_->is_whole()) return impl_->parts.front()->build_beam_tree();
  impl_->queries().build_beam_trees();
}

std::optional<Hit> Scene::intersect(const Ray& ray, double max_distance_m) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit query{};
  query.ray = embree_ray(ray, impl_->anchor, max_distance_m);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  if (impl_->is_whole()) {
    rtcIntersect1(impl_->rays(), &context, &query);
  } else {
    impl_->queries().intersect(query);
  }
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  const auto triangle = corners(impl_->meshes[query.hit.geomID]->mesh, query.hit.primID);
  const double distance_m = plane_distance(ray, triangle, query.ray.tfar);
  return Hit{distance_m, query.hit.geomID, query.hit.primID, query.hit.u, query.hit.v};
}

bool Scene::is_occluded(const Ray& ray, double max_distance_m) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay query = embree_ray(ray, impl_->anchor, max_distance_m);
  if (impl_->is_whole()) {
    rtcOccluded1(impl_->rays(), &context, &query);
  } else {
    impl_->queries().test_occlusion(query);
  }
  return query.tfar < 0.0F;
}

std::optional<double> Scene::distance_to_surface_m(const geometry::Vec3& point, double within_m) const {
  constexpr double kFloatStep = 1e-6;  // relative to a coordinate, some eight times the precision of floats
  const geometry::Vec3 from = point - impl_->anchor;
  const double largest_m = from.norm() + impl_->bounds.sizes().norm();
  NearestSearch search{nullptr, point, within_m, kFloatStep * largest_m};
  const float position[3] = {static_cast<float>(from.x()), static_cast<float>(from.y()), static_cast<float>(from.z())};
  if (impl_->is_whole()) {
    search_part(*impl_->parts.front(), position, search);
  } else {
    impl_->queries().visit_near(
        position, [&] { return search.radius(); }, [&](const ScenePart& part) { search_part(part, position, search); });
  }
  return search.found ? std::optional(search.distance_m) : std::nullopt;
}

void Scene::intersect(RayPacket8& packet) const {
  if (!impl_->is_whole()) return impl_->queries().intersect(packet);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect8(kAllLanes, impl_->rays(), &context, reinterpret_cast<RTCRayHit8*>(&packet));
}

void Scene::intersect(std::span<RayPacket8> beam) const {
  const bool done =
      impl_->is_whole() ? impl_->parts.front()->beam_tree().intersect(beam) : impl_->queries().intersect(beam);
  if (done) return;
  for (RayPacket8& packet : beam) intersect(packet);
}

void Scene::test_occlusion(RayPacket8& packet) const {
  if (!impl_->is_whole()) return impl_->queries().test_occlusion(packet);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcOccluded8(kAllLanes, impl_->rays(), &context, reinterpret_cast<RTCRay8*>(&packet));
}

geometry::Vec3 Scene::position(const Hit& hit) const {
  assert(hit.mesh < impl_->meshes.size());
  const auto p = corners(impl_->meshes[hit.mesh]->mesh, hit.triangle);
  const double u = hit.u;
  const double v = hit.v;
  return p[0] + u * (p[1] - p[0]) + v * (p[2] - p[0]);
}

geometry::Vec3 Scene::normal(const Hit& hit) const {
  assert(hit.mesh < impl_->meshes.size());
  const auto p = corners(impl_->meshes[hit.mesh]->mesh, hit.triangle);
  const geometry::Vec3 area_normal = (p[1] - p[0]).cross(p[2] - p[0]);
  const double length = area_normal.norm();
  return length > 0.0 ? geometry::Vec3(area_normal / length) : geometry::Vec3(geometry::Vec3::Zero());
}

namespace {

template <class Meshes>
geometry::TriangleMesh merge(const Meshes& meshes) {
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

}  // namespace

geometry::TriangleMesh merge_meshes(const std::vector<imaging::TexturedMesh>& meshes) { return merge(meshes); }
geometry::TriangleMesh merge_meshes(const Scene::Meshes& meshes) { return merge(meshes); }

}  // namespace tileflight::scene
