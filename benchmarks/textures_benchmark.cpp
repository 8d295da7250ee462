// Textures of a place against what its images see of them: 1000 tiles of 30 m with a texture of 512 x 512 each, of
// which charts cover three quarters.
//
//   Pyramid      MipPyramid of one texture, with its coverage: seconds a texel
//   Floor        the bytes that a pyramid moves at least: the texture read, and its levels written
//   Appearance   the shading data of the whole place, without images
//   FirstImage   the same, and an image of 640 x 360 from 60 m, which sees a few of the tiles
//
// To compare on an idle machine: textures_benchmark --benchmark_min_time=3
#include <benchmark/benchmark.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "tests/height_field.h"
#include "tileflight/capture/render/appearance.h"
#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/world/scene/scene.h"

namespace {

using namespace tileflight;

constexpr int kTexture_px = 512, kTiles = 1000, kTilesInRow = 40;
constexpr double kTile_m = 30.0;

std::shared_ptr<const imaging::RgbImage> noisy_texture(std::uint32_t seed) {
  auto image = std::make_shared<imaging::RgbImage>(kTexture_px, kTexture_px);
  std::uint32_t state = seed + 1;
  for (imaging::Rgb8& texel : image->pixels) {
    state = state * 1664525U + 1013904223U;
    texel = {static_cast<std::uint8_t>(state >> 24U), static_cast<std::uint8_t>(state >> 16U), 90};
  }
  return image;
}

/// A tile whose four charts leave a quarter of the texture unused.
imaging::TexturedMesh tile(int number) {
  imaging::TexturedMesh mesh;
  const double west = kTile_m * (number % kTilesInRow), south = kTile_m * (number / kTilesInRow);
  mesh.mesh = tests::height_field(8, 0.0, kTile_m, [](double, double) { return 0.0; });
  for (geometry::Vec3& p : mesh.mesh.vertices) {
    mesh.uv.emplace_back(static_cast<float>(0.86 * p.x() / kTile_m), static_cast<float>(0.86 * p.y() / kTile_m));
    p += geometry::Vec3(west, south, 0.0);
  }
  mesh.texture = noisy_texture(static_cast<std::uint32_t>(number));
  return mesh;
}

const scene::Scene& place() {
  static const scene::Scene all = [] {
    std::vector<imaging::TexturedMesh> meshes;
    for (int i = 0; i < kTiles; ++i) meshes.push_back(tile(i));
    return scene::Scene(std::move(meshes));
  }();
  return all;
}

void Pyramid(benchmark::State& state) {
  const imaging::TexturedMesh mesh = tile(0);
  const imaging::TexturedMesh* const user = &mesh;
  for (auto _ : state) {
    const render::MipPyramid pyramid(mesh.texture, [&] { return render::texture_coverage({&user, 1}); });
    benchmark::DoNotOptimize(pyramid.build());
  }
  state.counters["s/texel"] = benchmark::Counter(static_cast<double>(state.iterations()) * kTexture_px * kTexture_px,
                                                 benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
BENCHMARK(Pyramid)->Unit(benchmark::kMillisecond);

void Floor(benchmark::State& state) {
  const auto texture = noisy_texture(0);
  std::vector<imaging::Rgb8> levels(texture->pixels.size());
  for (auto _ : state) {
    std::ranges::copy(texture->pixels, levels.begin());
    std::copy_n(texture->pixels.begin(), texture->pixels.size() / 3, levels.begin());
    benchmark::ClobberMemory();
  }
  state.counters["s/texel"] = benchmark::Counter(static_cast<double>(state.iterations()) * kTexture_px * kTexture_px,
                                                 benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
BENCHMARK(Floor)->Unit(benchmark::kMillisecond);

void Appearance(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(std::make_unique<render::Appearance>(place()));
}
BENCHMARK(Appearance)->Unit(benchmark::kMillisecond)->UseRealTime();

void FirstImage(benchmark::State& state) {
  geometry::Mat3 down;
  down << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  const geometry::SE3 pose(down, geometry::Vec3(400, 300, 60));
  const imaging::Camera camera = imaging::make_pinhole(640, 360, 80.0);
  for (auto _ : state) {
    const render::CameraRenderer renderer(place(), camera, {});
    benchmark::DoNotOptimize(renderer.render(pose));
  }
}
BENCHMARK(FirstImage)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
