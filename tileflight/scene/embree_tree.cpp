#include "tileflight/scene/embree_tree.h"

#include <stdexcept>
#include <string>
#include <utility>

namespace tileflight::scene {
namespace {

[[noreturn]] void throw_embree(const char* what, RTCDevice device) {
  throw std::runtime_error(std::string("Embree: ") + what + " (error " + std::to_string(rtcGetDeviceError(device)) +
                           ")");
}

void fill_vertices(RTCGeometry geometry, const geometry::TriangleMesh& mesh, const geometry::Vec3& anchor) {
  auto* out = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                          3 * sizeof(float), mesh.vertices.size()));
  if (out == nullptr) throw std::runtime_error("Embree: out of memory for vertices");
  for (const geometry::Vec3& vertex : mesh.vertices) {
    const geometry::Vec3 relative = vertex - anchor;
    for (int axis = 0; axis < 3; ++axis) *out++ = static_cast<float>(relative[axis]);
  }
}

void attach_mesh(RTCDevice device, RTCScene scene, const geometry::TriangleMesh& mesh, const geometry::Vec3& anchor,
                 unsigned id) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  fill_vertices(geometry, mesh, anchor);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.triangles.data(), 0,
                             sizeof(geometry::Triangle), mesh.triangles.size());
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(scene, geometry, id);
  rtcReleaseGeometry(geometry);
}

}  // namespace

DeviceHandle new_device() {
  const RTCDevice device = rtcNewDevice(nullptr);
  if (device == nullptr) throw_embree("no device", nullptr);
  return {device, [](RTCDevice released) { rtcReleaseDevice(released); }};
}

EmbreeTree build_embree_tree(const std::vector<imaging::TexturedMesh>& meshes, const geometry::Vec3& anchor,
                             DeviceHandle device) {
  EmbreeTree tree;
  tree.device = std::move(device);
  tree.scene.reset(rtcNewScene(tree.device.get()));
  rtcSetSceneFlags(tree.scene.get(), RTC_SCENE_FLAG_ROBUST);
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    if (meshes[i].mesh.triangles.empty()) continue;
    attach_mesh(tree.device.get(), tree.scene.get(), meshes[i].mesh, anchor, static_cast<unsigned>(i));
  }
  rtcCommitScene(tree.scene.get());
  if (rtcGetDeviceError(tree.device.get()) != RTC_ERROR_NONE) throw_embree("the tree was not built", tree.device.get());
  return tree;
}

}  // namespace tileflight::scene
