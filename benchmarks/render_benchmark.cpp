// Rendering time against its lower bound: a 2688 x 1512 frame through a 155 degree fisheye over a textured height field
// of two million triangles.
//
//   Floor            Embree's own packet intersection of the same rays, default scene flags, nothing else
//   FloorWatertight  the same with Embree's robust flag, which the renderer uses so that no ray slips through an edge
//   Beams            Scene::intersect of the same rays in beams of eight packets, as the renderer casts them
//   RgbAndDepth      CameraRenderer::render, one sample a pixel, filtered texture
//   Light            CameraRenderer::render_light, linear light and depth: at one moment from one pose, at one moment
//                    from a pose for each row (rolling shutter), at three moments from one pose each (motion blur), and
//                    at three moments from a pose for each row; the camera flies at 10 m/s and turns by 30 degrees a
//                    second
//
// To compare on an idle machine: render_benchmark --benchmark_min_time=3
#include <benchmark/benchmark.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <memory>

#include "tests/height_field.h"
#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/image_formation.h"
#include "tileflight/capture/render/ray_table.h"
#include "tileflight/world/scene/embree.h"
#include "tileflight/world/scene/packets.h"
#include "tileflight/world/scene/scene.h"

namespace {

using namespace tileflight;
using geometry::Vec3;

constexpr int kWidth = 2688;
constexpr int kHeight = 1512;
constexpr std::uint32_t kCells = 1000;
constexpr double kSize_m = 300.0;

double height_m(double x, double y) {
  return 6.0 * std::sin(0.05 * x) * std::cos(0.04 * y) + 1.5 * std::sin(0.4 * x + 0.3 * y) +
         0.3 * std::sin(2.1 * x) * std::cos(1.7 * y);
}

std::uint8_t noise(int x, int y) {
  auto h = static_cast<std::uint32_t>(x) * 73856093U ^ static_cast<std::uint32_t>(y) * 19349663U;
  h = (h ^ (h >> 16U)) * 0x7feb352dU;
  return static_cast<std::uint8_t>((h ^ (h >> 15U)) & 0xFFU);
}

std::shared_ptr<const imaging::RgbImage> noisy_texture(int size) {
  auto image = std::make_shared<imaging::RgbImage>(size, size);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      (*image)(x, y) = {noise(x / 5, y / 5), noise(x / 17, y / 17), noise(x, y)};
    }
  }
  return image;
}

imaging::TexturedMesh textured_hills() {
  imaging::TexturedMesh field;
  field.mesh = tests::height_field(kCells, -0.5 * kSize_m, kSize_m, height_m);
  for (const Vec3& p : field.mesh.vertices) {
    field.uv.emplace_back(static_cast<float>(p.x() / kSize_m + 0.5), static_cast<float>(0.5 - p.y() / kSize_m));
  }
  field.texture = noisy_texture(4096);
  return field;
}

imaging::Camera camera() { return imaging::make_fisheye(kWidth, kHeight, 155.0, {-1.0 / 24, 1.0 / 1920, 0, 0}); }

/// 40 m above the centre, looking ahead and 35 degrees down.
geometry::SE3 pose() {
  const double pitch = 35.0 * 3.14159265358979 / 180.0;
  geometry::Mat3 r;
  r << 1, 0, 0, 0, -std::sin(pitch), std::cos(pitch), 0, -std::cos(pitch), -std::sin(pitch);
  return {r, Vec3(0.0, -30.0, 45.0)};
}

const scene::Scene& shared_scene() {
  static const scene::Scene scene({textured_hills()});
  return scene;
}

/// Holds the same triangles in a plain Embree scene.
class PlainEmbree {
 public:
  explicit PlainEmbree(RTCSceneFlags flags) : device_(rtcNewDevice(nullptr)), scene_(rtcNewScene(device_)) {
    const geometry::TriangleMesh& mesh = shared_scene().meshes()[0].mesh;
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* out = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                            3 * sizeof(float), mesh.vertices.size()));
    for (const Vec3& vertex : mesh.vertices) {
      for (int axis = 0; axis < 3; ++axis) *out++ = static_cast<float>(vertex[axis]);
    }
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.triangles.data(), 0,
                               sizeof(geometry::Triangle), mesh.triangles.size());
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    rtcSetSceneFlags(scene_, flags);
    rtcCommitScene(scene_);
  }
  ~PlainEmbree() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  PlainEmbree(const PlainEmbree&) = delete;
  PlainEmbree& operator=(const PlainEmbree&) = delete;
  RTCScene get() const { return scene_; }

 private:
  RTCDevice device_;
  RTCScene scene_;
};

void fill_rays(const render::RayBlock& block, const Eigen::Matrix3f& r, const Eigen::Vector3f& origin,
               RTCRayHit8& packet) {
  for (int i = 0; i < 8; ++i) {
    packet.ray.org_x[i] = origin.x();
    packet.ray.org_y[i] = origin.y();
    packet.ray.org_z[i] = origin.z();
    packet.ray.dir_x[i] = r(0, 0) * block.x[i] + r(0, 1) * block.y[i] + r(0, 2) * block.z[i];
    packet.ray.dir_y[i] = r(1, 0) * block.x[i] + r(1, 1) * block.y[i] + r(1, 2) * block.z[i];
    packet.ray.dir_z[i] = r(2, 0) * block.x[i] + r(2, 1) * block.y[i] + r(2, 2) * block.z[i];
    packet.ray.tnear[i] = 0.0F;
    packet.ray.tfar[i] = std::numeric_limits<float>::infinity();
    packet.ray.time[i] = 0.0F;
    packet.ray.mask[i] = 0xFFFFFFFFU;
    packet.ray.flags[i] = 0;
    packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
}

void intersect_frame(benchmark::State& state, RTCSceneFlags flags) {
  const PlainEmbree tree(flags);
  const render::RayTable rays(camera(), 1);
  const Eigen::Matrix3f r = pose().rotation.toRotationMatrix().cast<float>();
  const Eigen::Vector3f origin = pose().translation.cast<float>();
  for (auto _ : state) {
    tbb::parallel_for(0, rays.block_rows(), [&](int row) {
      for (int column = 0; column < rays.block_columns(); ++column) {
        RTCRayHit8 packet;
        fill_rays(rays.block(column, row), r, origin, packet);
        scene::find_nearest(tree.get(), &packet);
        benchmark::DoNotOptimize(packet.ray.tfar[0]);
      }
    });
  }
  state.counters["rays/s"] =
      benchmark::Counter(static_cast<double>(kWidth) * kHeight, benchmark::Counter::kIsIterationInvariantRate);
}

void floor_of_embree(benchmark::State& state) { intersect_frame(state, RTC_SCENE_FLAG_NONE); }
void floor_watertight(benchmark::State& state) { intersect_frame(state, RTC_SCENE_FLAG_ROBUST); }

void intersect_beams(benchmark::State& state) {
  const scene::Scene& scene = shared_scene();
  const render::RayTable rays(camera(), 1);
  const Eigen::Matrix3f r = pose().rotation.toRotationMatrix().cast<float>();
  const Eigen::Vector3f origin = (pose().translation - scene.anchor()).cast<float>();
  for (auto _ : state) {
    tbb::parallel_for(0, rays.block_rows() / 4, [&](int row) {
      std::array<scene::RayPacket8, 8> beam;
      for (int column = 0; column < rays.block_columns(); column += 2) {
        for (int k = 0; k < 8; ++k) {
          beam[k].reset();
          fill_rays(rays.block(column + k % 2, 4 * row + k / 2), r, origin, reinterpret_cast<RTCRayHit8&>(beam[k]));
        }
        scene.intersect(beam);
        benchmark::DoNotOptimize(beam[0].far[0]);
      }
    });
  }
  state.counters["rays/s"] =
      benchmark::Counter(static_cast<double>(kWidth) * kHeight, benchmark::Counter::kIsIterationInvariantRate);
}

void render_frame(benchmark::State& state) {
  const render::CameraRenderer renderer(shared_scene(), camera(), {});
  for (auto _ : state) benchmark::DoNotOptimize(renderer.render(pose()));
  state.counters["rays/s"] =
      benchmark::Counter(static_cast<double>(kWidth) * kHeight, benchmark::Counter::kIsIterationInvariantRate);
}

/// `exposure_s` 0: one moment; `line_delay_s` 0: a global shutter.
void render_light(benchmark::State& state, double exposure_s, double line_delay_s) {
  const render::CameraRenderer renderer(shared_scene(), camera(), {});
  render::ImageFormation formation;
  formation.exposure_time_s = exposure_s;
  formation.exposure_samples = 3;
  formation.line_delay_s = line_delay_s;
  const auto pose_at = [](double time_s) {
    geometry::SE3 T = pose();
    T.translation += Vec3(6.0, 8.0, 0.5) * time_s;
    T.rotation = geometry::so3_exp(Vec3(0.1, 0.2, 0.48) * time_s) * T.rotation;
    return T;
  };
  const render::ShutterPoses poses = render::shutter_poses(formation, pose_at, 0.0, kHeight);
  for (auto _ : state) benchmark::DoNotOptimize(renderer.render_light(poses));
  state.counters["rays/s"] =
      benchmark::Counter(static_cast<double>(kWidth) * kHeight, benchmark::Counter::kIsIterationInvariantRate);
}

constexpr double kExposure_s = 0.006, kLineDelay_s = 6e-6;

BENCHMARK(floor_of_embree)->Name("Floor")->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK(floor_watertight)
    ->Name("FloorWatertight")
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();
BENCHMARK(intersect_beams)->Name("Beams")->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK(render_frame)->Name("RgbAndDepth")->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(render_light, global, 0.0, 0.0)
    ->Name("Light/global")
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();
BENCHMARK_CAPTURE(render_light, rolling, 0.0, kLineDelay_s)
    ->Name("Light/rolling")
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();
BENCHMARK_CAPTURE(render_light, blurred, kExposure_s, 0.0)
    ->Name("Light/blurred")
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();
BENCHMARK_CAPTURE(render_light, blurred_and_rolling, kExposure_s, kLineDelay_s)
    ->Name("Light/blurred_and_rolling")
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

}  // namespace
