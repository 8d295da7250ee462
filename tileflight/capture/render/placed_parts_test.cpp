// Pictures of a scene with placed parts against those of the same meshes moved to their places.
#include <gmock/gmock.h>

#include <cmath>

#include "tileflight/capture/render/appearance.h"
#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/daylight.h"
#include "tileflight/capture/render/scene_objects.h"
#include "tileflight/capture/render/surface_color.h"
#include "tileflight/capture/render/test_scenes.h"

namespace tileflight::render::placed_parts_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using imaging::Camera;
using imaging::TexturedMesh;
using Meshes = std::vector<TexturedMesh>;
namespace shapes = test_scenes;

/// Ground with hills as place; hills with a texture and vertex colours as model.
class PlacedParts : public testing::Test {
 protected:
  static std::shared_ptr<const imaging::RgbImage> spots(int seed) {
    return shapes::texture(64, 64, [seed](int x, int y) {
      return imaging::Rgb8{static_cast<std::uint8_t>(shapes::noise(x / 4, y / 4, seed)),
                           static_cast<std::uint8_t>(60 + 2 * x), static_cast<std::uint8_t>(60 + 2 * y)};
    });
  }
  static Meshes model() {
    TexturedMesh coloured = shapes::hills(Vec3(0, 0, 3), 8.0, 10, spots(5), 1.0);
    for (std::size_t i = 0; i < coloured.mesh.vertices.size(); ++i)
      coloured.colors.push_back({static_cast<std::uint8_t>(100 + i % 100), 250, 200, 255});
    return {shapes::hills(Vec3(0, 0, 0), 10.0, 12, spots(2), 2.0), coloured};
  }
  PlacedParts() : part(std::make_shared<const scene::ScenePart>(model(), scene::SceneFrame(Vec3::Zero()))) {}

  /// `turn`: at which the first thing is.
  scene::Scene placed(const std::vector<double>& turns) const {
    return scene::Scene({std::make_shared<const scene::ScenePart>(place(), scene::SceneFrame(kAnchor))}, things(turns));
  }
  scene::Scene baked(double turn) const {
    Meshes all = place();
    for (const scene::PlacedPart& thing : things({turn})) {
      for (TexturedMesh mesh : part->meshes()) {
        for (Vec3& vertex : mesh.mesh.vertices) vertex = thing.poses[0] * vertex;
        mesh.name = thing.name;
        all.push_back(std::move(mesh));
      }
    }
    return scene::Scene(std::move(all), kAnchor);
  }
  static inline const Vec3 kAnchor{1, 2, 3};
  static inline const SE3 kView = shapes::looking_along(Vec3(-18, -22, 16), Vec3(18, 22, -13));
  Camera camera = imaging::make_pinhole(160, 120, 65.0);
  std::shared_ptr<const scene::ScenePart> part;

 private:
  static Meshes place() { return {shapes::hills(Vec3(0, 0, -3), 120.0, 30, spots(1), 3.0)}; }
  std::vector<scene::PlacedPart> things(const std::vector<double>& turns) const {
    scene::PlacedPart first{"first", part, {}}, second{"second", part, {}};
    for (const double turn : turns) {
      const SE3 pose(geometry::so3_exp(Vec3(0.1, 0.2, turn)), Vec3(2.0 * turn, -3.0, 4.0));
      first.poses.push_back(scene::placed_at(pose, Vec3(1.3, 0.8, 1.0)));
    }
    second.poses.push_back(scene::placed_at(SE3(geometry::so3_exp(Vec3(0, 0, 2)), Vec3(9, 8, 3))));
    return {first, second};
  }
};

/// Share of pixels that differ by more than 2 of 255: at silhouettes a ray may pass on another side within rounding.
double different_share(const imaging::RgbImage& a, const imaging::RgbImage& b) {
  int different = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    int worst = 0;
    for (std::size_t c = 0; c < 3; ++c) worst = std::max(worst, std::abs(int{a.pixels[i][c]} - int{b.pixels[i][c]}));
    different += worst > 2 ? 1 : 0;
  }
  return static_cast<double>(different) / static_cast<double>(a.pixels.size());
}

double different_share(const LinearImage& a, const LinearImage& b) {
  int different = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    float worst = 0.0F;
    for (std::size_t c = 0; c < 3; ++c) worst = std::max(worst, std::abs(a.pixels[i][c] - b.pixels[i][c]));
    different += worst > 0.01F ? 1 : 0;
  }
  return static_cast<double>(different) / static_cast<double>(a.pixels.size());
}

double mean_difference(const LinearImage& a, const LinearImage& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) sum += std::abs(a.pixels[i][c] - b.pixels[i][c]);
  }
  return sum / static_cast<double>(3 * a.pixels.size());
}

TEST_F(PlacedParts, AreShownAsTheirMeshesMovedThere) {
  const scene::Scene parts = placed({0.7}), whole = baked(0.7);
  const CameraRenderer renderer(parts, camera, {}), wanted(whole, camera, {});
  const RenderedFrame frame = renderer.render(kView), reference = wanted.render(kView);
  EXPECT_LT(different_share(frame.rgb, reference.rgb), 0.002);
  EXPECT_EQ(frame.view.rays, reference.view.rays);
  EXPECT_NEAR(static_cast<double>(frame.view.back_faces), static_cast<double>(reference.view.back_faces), 5.0);
  int different = 0;
  for (std::size_t i = 0; i < frame.depth_m.pixels.size(); ++i) {
    const float a = frame.depth_m.pixels[i], b = reference.depth_m.pixels[i];
    different += a == b || std::abs(a - b) < 1e-3F ? 0 : 1;
  }
  EXPECT_LE(different, 20);
  const CameraRenderer elsewhere(whole, camera, {});
  EXPECT_GT(different_share(CameraRenderer(placed({0.2}), camera, {}).render(kView).rgb, reference.rgb), 0.05)
      << "it is in the picture";
}

TEST_F(PlacedParts, HaveTheirNormalsAndAreObjectsOfTheirOwn) {
  const scene::Scene parts = placed({0.7}), whole = baked(0.7);
  const SceneObjects objects(parts), wanted(whole);
  ASSERT_EQ(objects.all().size(), 3U);
  EXPECT_EQ(objects.all()[1].tile, "first");
  EXPECT_TRUE(objects.all()[1].is_placed);
  EXPECT_FALSE(objects.all()[0].is_placed);
  const SceneObjects appended(SceneObjects(scene::Scene(parts.parts())), parts);
  imaging::Image<std::uint32_t> seen(160, 120, 99), reference(160, 120, 99);
  imaging::Image<std::array<float, 3>> normals(160, 120), reference_normals(160, 120);
  CameraRenderer(parts, camera, {}).visit_surface(std::span(&kView, 1), [&](const SurfacePoint& at) {
    if (!at.hit) return;
    seen(at.x, at.y) = objects.index_of(at.mesh, at.triangle);
    EXPECT_EQ(appended.index_of(at.mesh, at.triangle), seen(at.x, at.y));
    normals(at.x, at.y) = at.normal_local;
  });
  CameraRenderer(whole, camera, {}).visit_surface(std::span(&kView, 1), [&](const SurfacePoint& at) {
    if (!at.hit) return;
    reference(at.x, at.y) = wanted.index_of(at.mesh, at.triangle);
    reference_normals(at.x, at.y) = at.normal_local;
  });
  int different = 0, first = 0;
  for (std::size_t i = 0; i < seen.pixels.size(); ++i) {
    different += seen.pixels[i] != reference.pixels[i] ? 1 : 0;
    first += seen.pixels[i] == 1 ? 1 : 0;
    const Eigen::Vector3f a(normals.pixels[i].data()), b(reference_normals.pixels[i].data());
    different += (a - b).norm() > 1e-3F * (1.0F + a.norm()) ? 1 : 0;
  }
  EXPECT_LE(different, 30);
  EXPECT_GT(first, 300);
}

TEST_F(PlacedParts, CastShadowsAndStandInThem) {
  const scene::Scene parts = placed({0.7}), whole = baked(0.7);
  DaylightOptions light;
  light.utc_s = 1'718'900'000.0;  // a summer's day
  const RenderOptions options{.samples_per_pixel = 4,
                              .haze_per_m = 0.002,
                              .daylight = make_daylight(light, geometry::Geodetic{0.0, -78.0, {2000.0}})};
  const ShutterPoses once{1, 1, {kView}};
  const LinearImage a = CameraRenderer(parts, camera, options).render_light(once).light;
  const LinearImage b = CameraRenderer(whole, camera, options).render_light(once).light;
  EXPECT_LT(different_share(a, b), 0.01);
  const LinearImage bare = CameraRenderer(scene::Scene(parts.parts()), camera, options).render_light(once).light;
  EXPECT_GT(different_share(a, bare), 0.1);
}

TEST_F(PlacedParts, AreWhereTheyAreAtEachRowsTimeAndAtEachMomentOfTheExposure) {
  // A thing turns by 0.4 rad; rows are read one after the other, each exposed for three moments.
  const scene::Scene parts = placed({0.5, 0.7, 0.9});
  ShutterPoses shutter{3, 120, {}, {}};
  const auto time_of = [](int moment, int row) { return 0.25F * static_cast<float>(moment) + 0.5F * row / 119.0F; };
  for (int k = 0; k < 3; ++k) {
    for (int row = 0; row < 120; ++row) {
      shutter.T_local_camera.push_back(kView);
      shutter.scene_times.push_back(time_of(k, row));
    }
  }
  const CameraRenderer renderer(parts, camera, {});
  const LinearImage moving = renderer.render_light(shutter).light;
  // Row by row, from scenes in which the thing stands where it is at that time.
  LinearImage wanted(160, 120);
  for (int row = 0; row < 120; row += 7) {
    for (int k = 0; k < 3; ++k) {
      const double time = time_of(k, row);
      const scene::Scene still(parts.parts(), [&] {
        std::vector<scene::PlacedPart> things = parts.placed();
        things[0].poses = {parts.placed_pose(0, time)};
        return things;
      }());
      const LinearImage at = CameraRenderer(still, camera, {}).render_light({1, 1, {kView}}).light;
      for (int x = 0; x < 160; ++x) {
        for (std::size_t c = 0; c < 3; ++c) wanted(x, row)[c] += at(x, row)[c] / 3.0F;
      }
    }
  }
  double sum = 0.0;
  int different = 0, pixels = 0;
  for (int row = 0; row < 120; row += 7) {
    for (int x = 0; x < 160; ++x, ++pixels) {
      float worst = 0.0F;
      for (std::size_t c = 0; c < 3; ++c) worst = std::max(worst, std::abs(moving(x, row)[c] - wanted(x, row)[c]));
      different += worst > 0.01F ? 1 : 0;
      sum += worst;
    }
  }
  // Beams and packets have other footprints at the edges of blocks: a few pixels differ a little.
  EXPECT_LT(different, pixels / 50);
  EXPECT_LT(sum / pixels, 1e-3);
  const LinearImage frozen = renderer.render_light({1, 1, {kView}}).light;
  EXPECT_GT(mean_difference(moving, frozen), 5e-3) << "it does move";
}

TEST_F(PlacedParts, ASharedTableOfRaysGivesTheSamePicture) {
  const scene::Scene parts = placed({0.7}), other = placed({0.2});
  const CameraRenderer first(parts, camera, {.samples_per_pixel = 4});
  const CameraRenderer shared(other, std::make_shared<const Appearance>(other), first.rays(), first.options());
  const CameraRenderer own(other, camera, {.samples_per_pixel = 4});
  EXPECT_EQ(shared.render(kView).rgb.pixels, own.render(kView).rgb.pixels);
}

TEST_F(PlacedParts, AColourAtAHitIsThatOfTheMeshMovedThere) {
  const scene::Scene parts = placed({0.7}), whole = baked(0.7);
  const Appearance own(parts), wanted(whole);
  int placed_hits = 0;
  for (int i = 0; i < 200; ++i) {
    const scene::Ray ray{Vec3(-4.0 + 0.05 * i, -6.0 + 0.03 * i, 30.0), -Vec3::UnitZ()};
    const auto a = parts.intersect(ray), b = whole.intersect(ray);
    ASSERT_TRUE(a && b);
    placed_hits += a->mesh >= parts.first_placed_mesh() ? 1 : 0;
    const LinearRgb one = surface_color(parts, own, *a, 0.3), other = surface_color(whole, wanted, *b, 0.3);
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(one[c], other[c], 0.08) << "the mean scale, not each axis's";
  }
  EXPECT_GT(placed_hits, 50);
}

}  // namespace
}  // namespace tileflight::render::placed_parts_test
