#include "tileflight/world/scene/scene.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/world/scene/beam_tree.h"
#include "tileflight/world/scene/embree_tree.h"
#include "tileflight/world/scene/packets.h"
#include "tileflight/world/scene/part_queries.h"

namespace tileflight::scene {

// RayPacket8 is passed to Embree without conversion.
static_assert(offsetof(RayPacket8, nearness) >= sizeof(RTCRayHit8) && alignof(RayPacket8) == alignof(RTCRayHit8));
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
  r.time = static_cast<float>(ray.time);
  r.mask = 0xFFFFFFFFU;
  return r;
}

std::array<geometry::Vec3, 3> corners(const geometry::TriangleMesh& mesh, std::uint32_t triangle) {
  const geometry::Triangle& t = mesh.triangles[triangle];
  return {mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
}

/// State of Embree's point query: the tree's triangles, and the nearest distance so far.
struct NearestSearch {
  geometry::Vec3 point;
  double distance_m;  ///< of the nearest surface found so far, or the limit
  double slack_m;     ///< bound on the rounding of the tree's float boxes
  double time = 0.0;
  bool found = false;
  const std::vector<imaging::TexturedMesh>* meshes = nullptr;  ///< of the part that is searched
  const Eigen::Affine3d* pose = nullptr;                       ///< of the part, if it is placed
  double part_per_scene = 1.0;                                 ///< no length is longer in the part than so many times

  float radius() const { return static_cast<float>((distance_m + slack_m) * (1.0 + 1e-6)); }
  float part_radius() const { return static_cast<float>(part_per_scene) * radius(); }
};

bool look_at_triangle(RTCPointQueryFunctionArguments* asked) {
  auto& search = *static_cast<NearestSearch*>(asked->userPtr);
  auto p = corners((*search.meshes)[asked->geomID].mesh, asked->primID);
  if (search.pose != nullptr) {
    for (geometry::Vec3& corner : p) corner = *search.pose * corner;
  }
  const double distance_m = (geometry::closest_point_on_triangle(search.point, p[0], p[1], p[2]) - search.point).norm();
  if (distance_m > search.distance_m) return false;
  search.distance_m = distance_m;
  search.found = true;
  asked->query->radius = search.part_radius();
  return true;
}

/// Brings `search` up to date with the part's surfaces. `from`: its point, relative to the part's anchor.
void search_part(const ScenePart& part, const geometry::Vec3& from, NearestSearch& search) {
  search.meshes = &part.meshes();
  RTCPointQuery query{};
  query.x = static_cast<float>(from.x());
  query.y = static_cast<float>(from.y());
  query.z = static_cast<float>(from.z());
  query.radius = search.part_radius();
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(part.ray_tree().scene.get(), &query, &context, look_at_triangle, &search);
}

/// Brings `result` up to date with a placed part's surfaces.
void search_part(const QueriedPart& placed, NearestSearch search, NearestSearch& result) {
  const Eigen::Affine3d pose = placed.motion->pose(search.time);
  const geometry::Mat3 inverse = pose.linear().inverse();
  search.pose = &pose;
  search.part_per_scene = inverse.norm();
  const geometry::Vec3 from = inverse * (search.point - pose.translation()) - placed.part->frame().anchor();
  search_part(*placed.part, from, search);
  result.distance_m = search.distance_m;
  result.found = search.found;
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
  std::vector<PlacedPart> placed;
  std::vector<std::shared_ptr<const PartMotion>> motions;  ///< of the placed parts
  std::shared_ptr<ScenePart> own;                          ///< the only part, of a scene that was made of meshes
  std::vector<const imaging::TexturedMesh*> meshes;        ///< of all parts
  std::uint32_t first_placed_mesh = 0;
  std::vector<std::uint32_t> placed_of_mesh;  ///< from there on
  geometry::Box3 bounds;
  geometry::Vec3 anchor;
  std::size_t triangle_count = 0;

  explicit Impl(std::vector<std::shared_ptr<const ScenePart>> all, std::vector<PlacedPart> at = {})
      : parts(std::move(all)), placed(std::move(at)), anchor(parts.front()->frame().anchor()) {
    for (const auto& part : parts) add(*part, part->bounds());
    first_placed_mesh = static_cast<std::uint32_t>(meshes.size());
    for (std::size_t i = 0; i < placed.size(); ++i) {
      motions.push_back(std::make_shared<const PartMotion>(placed[i], anchor));
      add(*placed[i].part, motions.back()->bounds());
      placed_of_mesh.resize(meshes.size() - first_placed_mesh, static_cast<std::uint32_t>(i));
    }
    if (triangle_count == 0) throw InputError("scene", "contains no triangle; is the region empty?");
  }

  bool is_whole() const { return parts.size() == 1 && placed.empty(); }
  /// Precondition: is_whole().
  RTCScene rays() const { return parts.front()->ray_tree().scene.get(); }
  /// Precondition: not is_whole().
  const PartQueries& queries() {
    return *queries_.get([this] { return std::make_unique<PartQueries>(queried(), parts.front()->frame()); });
  }
  std::array<geometry::Vec3, 3> corners_of(const Hit& hit) const {
    auto p = corners(meshes[hit.mesh]->mesh, hit.triangle);
    if (hit.mesh < first_placed_mesh) return p;
    const Eigen::Affine3d pose = motions[placed_of_mesh[hit.mesh - first_placed_mesh]]->pose(hit.time);
    for (geometry::Vec3& corner : p) corner = pose * corner;
    return p;
  }

 private:
  void add(const ScenePart& part, const geometry::Box3& box) {
    for (const imaging::TexturedMesh& mesh : part.meshes()) meshes.push_back(&mesh);
    bounds.extend(box);
    triangle_count += part.triangle_count();
  }
  std::vector<QueriedPart> queried() const {
    std::vector<QueriedPart> all;
    for (const auto& part : parts) all.push_back({part, nullptr});
    for (std::size_t i = 0; i < placed.size(); ++i) all.push_back({placed[i].part, motions[i]});
    return all;
  }

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

Scene::Scene(std::vector<std::shared_ptr<const ScenePart>> parts) : Scene(std::move(parts), {}) {}

Scene::Scene(std::vector<std::shared_ptr<const ScenePart>> parts, std::vector<PlacedPart> placed) {
  assert(!parts.empty());
  assert(std::ranges::all_of(parts, [&](const auto& part) {
    return part->frame().device() == parts.front()->frame().device() &&
           part->frame().anchor() == parts.front()->frame().anchor();
  }));
  impl_ = std::make_unique<Impl>(std::move(parts), std::move(placed));
}

Scene::~Scene() = default;
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;

Scene::Meshes Scene::meshes() const { return Meshes(impl_->meshes); }
const std::vector<std::shared_ptr<const ScenePart>>& Scene::parts() const { return impl_->parts; }

const std::vector<PlacedPart>& Scene::placed() const { return impl_->placed; }
std::uint32_t Scene::first_placed_mesh() const { return impl_->first_placed_mesh; }

std::size_t Scene::placed_of_mesh(std::uint32_t mesh) const {
  assert(mesh >= impl_->first_placed_mesh);
  return impl_->placed_of_mesh[mesh - impl_->first_placed_mesh];
}

Eigen::Affine3d Scene::placed_pose(std::size_t placed, double time) const { return impl_->motions[placed]->pose(time); }
const geometry::Box3& Scene::placed_bounds(std::size_t placed) const { return impl_->motions[placed]->bounds(); }

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
  for (const PlacedPart& placed : impl_->placed) placed.part->build_ray_tree();
  if (!impl_->is_whole()) impl_->queries();
}

void Scene::build_beam_tree() const {
  if (impl_->is_whole()) return impl_->parts.front()->build_beam_tree();
  impl_->queries().build_beam_trees();
}

std::optional<Hit> Scene::intersect(const Ray& ray, double max_distance_m) const {
  RTCRayHit query{};
  query.ray = embree_ray(ray, impl_->anchor, max_distance_m);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  if (impl_->is_whole()) {
    find_nearest(impl_->rays(), query);
  } else {
    impl_->queries().intersect(query);
  }
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  Hit hit{query.ray.tfar, query.hit.geomID, query.hit.primID, query.hit.u, query.hit.v, ray.time};
  hit.distance_m = plane_distance(ray, impl_->corners_of(hit), hit.distance_m);
  return hit;
}

bool Scene::is_occluded(const Ray& ray, double max_distance_m) const {
  RTCRay query = embree_ray(ray, impl_->anchor, max_distance_m);
  if (impl_->is_whole()) {
    find_any(impl_->rays(), query);
  } else {
    impl_->queries().test_occlusion(query);
  }
  return query.tfar < 0.0F;
}

std::optional<double> Scene::distance_to_surface_m(const geometry::Vec3& point, double within_m, double time) const {
  constexpr double kFloatStep = 1e-6;  // relative to a coordinate, some eight times the precision of floats
  const geometry::Vec3 from = point - impl_->anchor;
  const double largest_m = from.norm() + impl_->bounds.sizes().norm();
  NearestSearch search{point, within_m, kFloatStep * largest_m, time};
  if (impl_->is_whole()) {
    search_part(*impl_->parts.front(), from, search);
  } else {
    const Eigen::Vector3f position = from.cast<float>();
    impl_->queries().visit_near(
        {position.x(), position.y(), position.z()}, [&] { return search.radius(); },
        [&](const QueriedPart& one) {
          if (one.motion) return search_part(one, search, search);
          search_part(*one.part, from, search);
        });
  }
  return search.found ? std::optional(search.distance_m) : std::nullopt;
}

void Scene::intersect(RayPacket8& packet) const {
  if (impl_->is_whole()) {
    find_nearest(impl_->rays(), reinterpret_cast<RTCRayHit8*>(&packet));
  } else {
    impl_->queries().intersect(packet);
  }
  for (int i = 0; i < RayPacket8::kLanes; ++i) packet.nearness[i] = 1.0F / packet.far[i];
}

void Scene::intersect(std::span<RayPacket8> beam) const {
  const bool done =
      impl_->is_whole() ? impl_->parts.front()->beam_tree().intersect(beam) : impl_->queries().intersect(beam);
  if (done) return;
  for (RayPacket8& packet : beam) intersect(packet);
}

void Scene::intersect_moving(std::span<const std::span<RayPacket8>> beams) const {
  const bool done = impl_->is_whole() ? impl_->parts.front()->beam_tree().intersect_moving(beams)
                                      : impl_->queries().intersect_moving(beams);
  if (done) return;
  for (const std::span<RayPacket8> beam : beams) {
    for (RayPacket8& packet : beam) intersect(packet);
  }
}

void Scene::test_occlusion(RayPacket8& packet) const {
  if (!impl_->is_whole()) return impl_->queries().test_occlusion(packet);
  find_any(impl_->rays(), reinterpret_cast<RTCRay8*>(&packet));
}

geometry::Vec3 Scene::position(const Hit& hit) const {
  assert(hit.mesh < impl_->meshes.size());
  const auto p = impl_->corners_of(hit);
  const double u = hit.u;
  const double v = hit.v;
  return p[0] + u * (p[1] - p[0]) + v * (p[2] - p[0]);
}

geometry::Vec3 Scene::normal(const Hit& hit) const {
  assert(hit.mesh < impl_->meshes.size());
  const auto p = impl_->corners_of(hit);
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
