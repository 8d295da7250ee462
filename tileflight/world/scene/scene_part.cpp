#include "tileflight/world/scene/scene_part.h"

#include <algorithm>
#include <cassert>
#include <string>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/deferred_texture.h"
#include "tileflight/world/scene/beam_tree.h"
#include "tileflight/world/scene/embree_tree.h"

namespace tileflight::scene {
namespace {

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
  if (mesh.texture && mesh.texture->empty() && !imaging::is_deferred(mesh.texture))
    throw InputError(where, "its texture has no pixels; leave it out");
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

}  // namespace

SceneFrame::SceneFrame(const geometry::Vec3& anchor) : anchor_(anchor), device_(new_device()) {}

struct ScenePart::Impl {
  std::vector<imaging::TexturedMesh> meshes;
  SceneFrame frame;
  geometry::Box3 bounds;
  std::size_t triangle_count = 0;
  LazyTree<EmbreeTree> ray_tree;
  LazyTree<BeamTree> beam_tree;

  Impl(std::vector<imaging::TexturedMesh> own_meshes, const SceneFrame& own_frame)
      : meshes(std::move(own_meshes)), frame(own_frame) {}
};

ScenePart::ScenePart(std::vector<imaging::TexturedMesh> meshes, const SceneFrame& frame)
    : impl_(std::make_unique<Impl>(std::move(meshes), frame)) {
  for (std::size_t i = 0; i < impl_->meshes.size(); ++i) {
    check_mesh(impl_->meshes[i], i);
    impl_->triangle_count += impl_->meshes[i].mesh.triangles.size();
  }
  impl_->bounds = bounds_of(impl_->meshes);
}

ScenePart::~ScenePart() = default;

const std::vector<imaging::TexturedMesh>& ScenePart::meshes() const { return impl_->meshes; }
std::vector<imaging::TexturedMesh> ScenePart::release_meshes() && { return std::move(impl_->meshes); }
const geometry::Box3& ScenePart::bounds() const { return impl_->bounds; }
const SceneFrame& ScenePart::frame() const { return impl_->frame; }
std::size_t ScenePart::triangle_count() const { return impl_->triangle_count; }

void ScenePart::build_ray_tree() const {
  if (impl_->triangle_count > 0) ray_tree();
}

void ScenePart::build_beam_tree() const {
  if (impl_->triangle_count > 0) beam_tree();
}

const EmbreeTree& ScenePart::ray_tree() const {
  assert(impl_->triangle_count > 0);
  return impl_->ray_tree.get(
      [this] { return build_embree_tree(impl_->meshes, impl_->frame.anchor(), impl_->frame.device()); });
}

const BeamTree& ScenePart::beam_tree() const {
  assert(impl_->triangle_count > 0);
  return impl_->beam_tree.get([this] { return BeamTree(impl_->meshes, impl_->frame.anchor(), impl_->frame.device()); });
}

geometry::Box3 bounds_of(const std::vector<imaging::TexturedMesh>& meshes) {
  geometry::Box3 box;
  for (const imaging::TexturedMesh& mesh : meshes) {
    if (mesh.mesh.triangles.empty()) continue;
    for (const geometry::Vec3& vertex : mesh.mesh.vertices) box.extend(vertex);
  }
  return box;
}

}  // namespace tileflight::scene
