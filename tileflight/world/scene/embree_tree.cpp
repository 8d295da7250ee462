#include "tileflight/world/scene/embree_tree.h"

#include <tbb/parallel_for.h>

#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

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

struct ReleaseGeometry {
  void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
};
using GeometryHandle = std::unique_ptr<std::remove_pointer_t<RTCGeometry>, ReleaseGeometry>;

GeometryHandle new_geometry(RTCDevice device, const geometry::TriangleMesh& mesh, const geometry::Vec3& anchor) {
  GeometryHandle geometry(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE));
  fill_vertices(geometry.get(), mesh, anchor);
  rtcSetSharedGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.triangles.data(), 0,
                             sizeof(geometry::Triangle), mesh.triangles.size());
  rtcCommitGeometry(geometry.get());
  return geometry;
}

}  // namespace

DeviceHandle new_device() {
  // By default Embree takes the widest vectors of the processor, of which some have fused operations: last bits would
  // depend on the processor. Rays take no longer with those that every processor has.
#ifdef __x86_64__
  constexpr const char* kSettings = "isa=sse2";
#else
  constexpr const char* kSettings = nullptr;
#endif
  auto* const device = rtcNewDevice(kSettings);
  if (device == nullptr) throw_embree("no device", nullptr);
  return {device, [](RTCDevice released) { rtcReleaseDevice(released); }};
}

EmbreeTree build_embree_tree(const std::vector<imaging::TexturedMesh>& meshes, const geometry::Vec3& anchor,
                             DeviceHandle device) {
  EmbreeTree tree;
  tree.device = std::move(device);
  tree.scene.reset(rtcNewScene(tree.device.get()));
  rtcSetSceneFlags(tree.scene.get(), RTC_SCENE_FLAG_ROBUST);
  std::vector<GeometryHandle> geometries(meshes.size());
  tbb::parallel_for(std::size_t{0}, meshes.size(), [&](std::size_t i) {
    if (!meshes[i].mesh.triangles.empty()) geometries[i] = new_geometry(tree.device.get(), meshes[i].mesh, anchor);
  });
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    if (geometries[i]) rtcAttachGeometryByID(tree.scene.get(), geometries[i].get(), static_cast<unsigned>(i));
  }
  rtcCommitScene(tree.scene.get());
  if (rtcGetDeviceError(tree.device.get()) != RTC_ERROR_NONE) throw_embree("the tree was not built", tree.device.get());
  return tree;
}

}  // namespace tileflight::scene
