#include "tileflight/capture/render/camera_renderer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <array>
#include <cmath>
#include <cstring>
#include <numeric>

#include "tileflight/capture/render/test_scenes.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::render::camera_renderer_test {
namespace {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;
using imaging::Camera;
using imaging::Rgb8;
using scene::Scene;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using namespace test_scenes;

const Vec3 kGround(120.0, -80.0, 2880.0);  // far from the origin, as real places are

/// Distance along the ray of pixel (x, y) to the level z = kGround.z, or infinity.
double ground_distance_m(const Vec3& direction, double height_m) {
  return direction.z() < 0.0 ? -height_m / direction.z() : std::numeric_limits<double>::infinity();
}

struct Lens {
  const char* name;
  Camera camera;
};

std::vector<Lens> lenses() {
  return {{"pinhole90", imaging::make_pinhole(160, 120, 90.0)},
          {"fisheye155", imaging::make_fisheye(201, 113, 155.0, {-1.0 / 24, 1.0 / 1920, 0, 0})},
          {"fisheye200", imaging::make_fisheye(150, 151, 200.0)}};
}

class RenderThroughLens : public testing::TestWithParam<Lens> {};

TEST_P(RenderThroughLens, DepthOfAPlaneIsAnalytic) {
  const Camera& camera = GetParam().camera;
  const Scene scene({ground(kGround, 4000.0, texture(8, 8, [](int, int) { return grey(90); }))});
  const CameraRenderer renderer(scene, camera, {});
  const double height_m = 30.0;
  const SE3 T = looking_along(kGround + Vec3(3.0, -2.0, height_m), Vec3(0.3, 0.8, -0.7));
  const RenderedFrame frame = renderer.render(T);
  int surface = 0;
  for (int y = 0; y < camera.height(); ++y) {
    for (int x = 0; x < camera.width(); ++x) {
      const auto ray = camera.unproject(Vec2(x, y));
      const float depth_m = frame.depth_m(x, y);
      ASSERT_EQ(ray.has_value(), !std::isnan(depth_m)) << x << " " << y;
      if (!ray) {
        EXPECT_EQ(frame.rgb(x, y), (Rgb8{0, 0, 0}));
        continue;
      }
      const double distance_m = ground_distance_m(T.rotation * *ray, height_m);
      if (distance_m > 1500.0) continue;  // beyond the square's rim
      ++surface;
      EXPECT_NEAR(depth_m, distance_m * ray->z(), 1e-4 + 2e-6 * distance_m * distance_m / height_m) << x << " " << y;
      EXPECT_EQ(frame.rgb(x, y), grey(90));
    }
  }
  EXPECT_GT(surface, camera.width() * camera.height() / 4);
}

INSTANTIATE_TEST_SUITE_P(Lenses, RenderThroughLens, testing::ValuesIn(lenses()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(CameraRenderer, TextureLiesOnTheGroundAsOnAMap) {
  // One texel a square metre, each of its own colour; 6 pixels a metre from straight above.
  const int size = 64;
  const auto map = texture(size, size, [](int x, int y) {
    return Rgb8{static_cast<std::uint8_t>(4 * x), static_cast<std::uint8_t>(4 * y), 77};
  });
  const Scene scene({ground(kGround, size, map)});
  Camera camera(imaging::PinholeRadtan{240, 240, 79.5, 59.5, {}}, 160, 120);
  const CameraRenderer renderer(scene, camera, {});
  const RenderedFrame frame = renderer.render(looking_down(kGround + Vec3(5.0, 7.0, 40.0)));
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 160; ++x) {
      const double east_m = 5.0 + (x - 79.5) / 6.0;
      const double south_m = -7.0 + (y - 59.5) / 6.0;
      // Between texel centres colours change linearly (nearly: in light), and texel i's centre is at i + 0.5.
      EXPECT_NEAR(frame.rgb(x, y)[0], 4.0 * (east_m + 32.0 - 0.5), 1.0) << x << " " << y;
      EXPECT_NEAR(frame.rgb(x, y)[1], 4.0 * (south_m + 32.0 - 0.5), 1.0) << x << " " << y;
      EXPECT_EQ(frame.rgb(x, y)[2], 77);
    }
  }
}

/// Linear light of a pixel by casting a fine grid of rays through it and reading the nearest texel: no filter.
double brute_force_light(const Scene& scene, const Camera& camera, const SE3& T, int x, int y, int grid) {
  double sum = 0.0;
  for (int j = 0; j < grid; ++j) {
    for (int i = 0; i < grid; ++i) {
      const auto ray = camera.unproject(Vec2(x + (i + 0.5) / grid - 0.5, y + (j + 0.5) / grid - 0.5));
      const auto hit = scene.intersect({T.translation, T.rotation * *ray});
      if (!hit) {
        sum += srgb_decode(RenderOptions{}.background[0]);
        continue;
      }
      const imaging::TexturedMesh& mesh = scene.meshes()[hit->mesh];
      const auto& t = mesh.mesh.triangles[hit->triangle];
      const Eigen::Vector2f uv =
          (1 - hit->u - hit->v) * mesh.uv[t[0]] + hit->u * mesh.uv[t[1]] + hit->v * mesh.uv[t[2]];
      const auto wrap = [](float s, int size) {
        return std::clamp(static_cast<int>((s - std::floor(s)) * static_cast<float>(size)), 0, size - 1);
      };
      sum += srgb_decode((*mesh.texture)(wrap(uv.x(), mesh.texture->width), wrap(uv.y(), mesh.texture->height))[0]);
    }
  }
  return sum / (grid * grid);
}

struct Agreement {
  double rms = 0.0;  // grey levels
  double correlation = 0.0;
};

/// Compares rendered pixels with brute force over every `step`-th pixel.
Agreement agreement(const Scene& scene, const Camera& camera, const SE3& T, const imaging::RgbImage& image, int step) {
  std::vector<double> a;
  std::vector<double> b;
  for (int y = 2; y < camera.height() - 2; y += step) {
    for (int x = 2; x < camera.width() - 2; x += step) {
      a.push_back(image(x, y)[0]);
      b.push_back(srgb_encode(brute_force_light(scene, camera, T, x, y, 12)));
    }
  }
  const auto n = static_cast<double>(a.size());
  const double mean_a = std::accumulate(a.begin(), a.end(), 0.0) / n;
  const double mean_b = std::accumulate(b.begin(), b.end(), 0.0) / n;
  double aa = 0, bb = 0, ab = 0, dd = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    aa += (a[i] - mean_a) * (a[i] - mean_a);
    bb += (b[i] - mean_b) * (b[i] - mean_b);
    ab += (a[i] - mean_a) * (b[i] - mean_b);
    dd += (a[i] - b[i]) * (a[i] - b[i]);
  }
  return {std::sqrt(dd / n), ab / std::sqrt(aa * bb)};
}

TEST(CameraRenderer, AgreesWithBruteForceSupersampling) {
  const auto image =
      texture(512, 512, [](int x, int y) { return grey((noise(x / 6, y / 6) + noise(x / 23, y / 23, 1)) / 2); });
  const Scene scene({hills(kGround, 100.0, 60, image)});
  const Camera camera = imaging::make_fisheye(120, 80, 130.0);
  const SE3 T = looking_along(kGround + Vec3(-20.0, -25.0, 28.0), Vec3(0.5, 0.6, -0.8));
  const CameraRenderer one(scene, camera, {});
  const CameraRenderer nine(scene, camera, {.samples_per_pixel = 9});
  const Agreement with_one = agreement(scene, camera, T, one.render(T).rgb, 3);
  const Agreement with_nine = agreement(scene, camera, T, nine.render(T).rgb, 3);
  EXPECT_LT(with_one.rms, 12.0);
  EXPECT_GT(with_one.correlation, 0.95);
  EXPECT_LT(with_nine.rms, 5.0);
  EXPECT_GT(with_nine.correlation, 0.99);
}

TEST(CameraRenderer, SeveralSamplesSmoothEdgesInLinearLight) {
  // The left half of the view is white ground, the right half black background: the edge crosses pixel 20.
  const Scene scene(
      {ground(kGround + Vec3(-500.0, 0.0, 0.0), 1000.0, texture(2, 2, [](int, int) { return grey(255); }))});
  Camera camera(imaging::PinholeRadtan{100, 100, 20.0 + 1e-4, 20, {}}, 41, 41);
  const CameraRenderer renderer(scene, camera, {.samples_per_pixel = 16, .background = {0, 0, 0}});
  const RenderedFrame frame = renderer.render(looking_down(kGround + Vec3(0.0, 0.0, 50.0)));
  EXPECT_EQ(frame.rgb(19, 20), grey(255));
  EXPECT_EQ(frame.rgb(21, 20), grey(0));
  EXPECT_NEAR(frame.rgb(20, 20)[0], srgb_encode(0.5), 1.0);
}

/// Standard deviation over time of a pixel's grey level while the camera moves slowly over fine noise; mean over
/// pixels.
double shimmer(int repeats) {
  const auto image = texture(256, 256, [](int x, int y) { return grey(noise(x, y)); });
  const Scene scene({ground(kGround, 128.0, image, static_cast<float>(repeats))});
  const Camera camera = imaging::make_fisheye(96, 64, 120.0);
  const CameraRenderer renderer(scene, camera, {});
  std::vector<double> sum(96 * 64, 0.0);
  std::vector<double> squares(96 * 64, 0.0);
  constexpr int kFrames = 12;
  for (int i = 0; i < kFrames; ++i) {
    const Vec3 position = kGround + Vec3(0.013 * i, 0.021 * i, 20.0);
    const RenderedFrame frame = renderer.render(looking_along(position, Vec3(0.0, 1.0, -0.9)));
    for (std::size_t p = 0; p < sum.size(); ++p) {
      sum[p] += frame.rgb.pixels[p][0];
      squares[p] += std::pow(frame.rgb.pixels[p][0], 2);
    }
  }
  double total = 0.0;
  for (std::size_t p = 0; p < sum.size(); ++p) {
    total += std::sqrt(std::max(0.0, squares[p] / kFrames - std::pow(sum[p] / kFrames, 2)));
  }
  return total / static_cast<double>(sum.size());
}

TEST(CameraRenderer, FineTextureDoesNotShimmer) {
  // Texels of 1.4 to 6 cm under pixels of about 40 cm: without a filter each frame would show different noise, with a
  // standard deviation near that of the texels (74 grey levels).
  EXPECT_LT(shimmer(8), 6.0);
  EXPECT_LT(shimmer(36), 3.0);
}

TEST(CameraRenderer, MeanLightIsKeptWhereTexelsAreFarBelowAPixel) {
  const auto checker = texture(64, 64, [](int x, int y) { return grey((x + y) % 2 == 0 ? 255 : 0); });
  const Scene scene({ground(kGround, 200.0, checker, 100.0F)});
  const CameraRenderer renderer(scene, imaging::make_pinhole(60, 40, 60.0), {});
  const RenderedFrame frame = renderer.render(looking_down(kGround + Vec3(0.0, 0.0, 60.0)));
  ASSERT_EQ(frame.rgb.pixels.size(), 60U * 40U);
  for (const Rgb8& pixel : frame.rgb.pixels) EXPECT_NEAR(pixel[0], srgb_encode(0.5), 2.0);
}

TEST(CameraRenderer, GrazingStripesStaySharpAcrossTheLongAxis) {
  // Stripes along the view direction, seen at a grazing angle: pixels are elongated along them, and only an anisotropic
  // filter keeps their contrast.
  const auto stripes = texture(256, 256, [](int x, int) { return grey(x / 8 % 2 == 0 ? 230 : 20); });
  const Scene scene({ground(kGround, 256.0, stripes)});
  Camera camera(imaging::PinholeRadtan{150, 150, 79.5, 59.5, {}}, 160, 120);
  const CameraRenderer renderer(scene, camera, {});
  const RenderedFrame frame = renderer.render(looking_along(kGround + Vec3(0.0, -60.0, 6.0), Vec3(0.0, 1.0, -0.1)));
  int low = 255;
  int high = 0;
  const int row = 59;  // about 60 m ahead: a pixel is 0.4 m wide and 4 m long, a stripe 8 m wide
  for (int x = 0; x < 160; ++x) {
    low = std::min<int>(low, frame.rgb(x, row)[0]);
    high = std::max<int>(high, frame.rgb(x, row)[0]);
  }
  EXPECT_LT(low, 25);
  EXPECT_GT(high, 225);
}

TEST(CameraRenderer, ColoursMultiplyInLinearLight) {
  imaging::TexturedMesh tinted = ground(kGround, 100.0, nullptr);
  tinted.uv.clear();
  tinted.base_color = {0.5F, 0.25F, 1.0F, 1.0F};
  tinted.colors.assign(4, {255, 128, 51, 255});
  const SE3 T = looking_down(kGround + Vec3(0.0, 0.0, 10.0));
  const auto centre_of = [&](const imaging::TexturedMesh& mesh) {
    const Scene scene({mesh});
    const CameraRenderer renderer(scene, imaging::make_pinhole(9, 9, 40.0), {});
    return renderer.render(T).rgb(4, 4);
  };
  const Rgb8 untextured = centre_of(tinted);
  EXPECT_NEAR(untextured[0], srgb_encode(0.5), 1.0);
  EXPECT_NEAR(untextured[1], srgb_encode(0.25 * 128 / 255), 1.0);
  EXPECT_NEAR(untextured[2], srgb_encode(0.2), 1.0);
  imaging::TexturedMesh both = ground(kGround, 100.0, texture(4, 4, [](int, int) { return grey(150); }));
  both.base_color = tinted.base_color;
  EXPECT_NEAR(centre_of(both)[0], srgb_encode(0.5 * srgb_decode(150)), 1.0);
}

/// Closed form: light = a1 c1 + (1 - a1) (a2 c2 + (1 - a2) (…)), over the background where nothing is opaque.
TEST(Blending, SurfacesOverEachOtherBlendBackToFront) {
  const Vec3 up = Vec3::UnitZ();
  const imaging::TexturedMesh floor = colored_ground(kGround, 100.0, {0.5F, 0.1F, 0.9F, 1.0F}),
                              red = pane(kGround + 2.0 * up, 100.0, {0.8F, 0.0F, 0.0F, 0.3F}),
                              green = pane(kGround + 4.0 * up, 100.0, {0.1F, 0.6F, 0.2F, 0.6F});
  const SE3 T = looking_down(kGround + 10.0 * up);
  const auto render = [&](std::vector<imaging::TexturedMesh> meshes, const RenderOptions& options = {}) {
    const Scene scene(std::move(meshes));
    return CameraRenderer(scene, imaging::make_pinhole(9, 9, 40.0), options).render(T);
  };
  const RenderOptions plain;
  for (const int samples : {1, 4}) {
    RenderOptions options;
    options.samples_per_pixel = samples;
    const RenderedFrame two = render({floor, green}, options), three = render({red, floor, green}, options),
                        sky = render({green, red}, options);
    for (std::size_t c = 0; c < 3; ++c) {
      const double f = floor.base_color[c], r = red.base_color[c], g = green.base_color[c],
                   b = srgb_decode(plain.background[c]);
      EXPECT_NEAR(two.rgb(4, 4)[c], srgb_encode(0.6 * g + 0.4 * f), 0.6);
      EXPECT_NEAR(three.rgb(4, 4)[c], srgb_encode(0.6 * g + 0.4 * (0.3 * r + 0.7 * f)), 0.6);
      EXPECT_NEAR(sky.rgb(4, 4)[c], srgb_encode(0.6 * g + 0.4 * (0.3 * r + 0.7 * b)), 0.6);
    }
    EXPECT_NEAR(three.depth_m(4, 4), 6.0, 1e-4) << "depth is that of the first surface";
  }
  // An opacity changes nothing of a surface that does not blend.
  imaging::TexturedMesh solid = green;
  solid.blends = false;
  EXPECT_NEAR(render({floor, solid}).rgb(4, 4)[1], srgb_encode(0.6), 0.6);
}

/// Air between camera and surfaces: light = T a c1 + … with T = exp(-haze distance), plus (1 - T) of the air's colour.
TEST(Blending, AirLiesBetweenTheLayersToo) {
  const Vec3 up = Vec3::UnitZ();
  const Scene scene({colored_ground(kGround, 100.0, {0.5F, 0.5F, 0.5F, 1.0F}),
                     pane(kGround + 5.0 * up, 100.0, {0.9F, 0.9F, 0.9F, 0.25F})});
  RenderOptions options;
  options.haze_per_m = 0.05;
  options.haze_color = Rgb8{60, 60, 60};
  const CameraRenderer renderer(scene, imaging::make_pinhole(9, 9, 40.0), options);
  const double air = srgb_decode(60), near = std::exp(-0.05 * 5.0), between = near;
  const double floor_at_pane = between * 0.5 + (1 - between) * air;
  const double expected = near * (0.25 * 0.9 + 0.75 * floor_at_pane) + (1 - near) * air;
  EXPECT_NEAR(renderer.render(looking_down(kGround + 10.0 * up)).rgb(4, 4)[1], srgb_encode(expected), 0.6);
}

TEST(Blending, OpacityComesFromTexelsAndVertexColours) {
  const Vec3 up = Vec3::UnitZ();
  imaging::TexturedMesh glass = ground(kGround + 2.0 * up, 64.0, texture(8, 8, [](int, int) { return grey(255); }));
  glass.blends = true;
  const auto half = static_cast<int>(std::lround(srgb_encode(0.4)));
  glass.opacity = texture(8, 8, [&](int x, int) { return grey(x < 4 ? half : 0); });
  glass.colors.assign(4, {255, 255, 255, 128});
  const Scene scene({colored_ground(kGround, 200.0, {0.2F, 0.2F, 0.2F, 1.0F}), glass});
  const CameraRenderer renderer(scene, imaging::make_pinhole(9, 9, 90.0), {});
  const RenderedFrame frame = renderer.render(looking_down(kGround + 12.0 * up));
  const double opacity = 0.4 * 128 / 255;
  EXPECT_NEAR(frame.rgb(0, 4)[1], srgb_encode(opacity * 1.0 + (1 - opacity) * 0.2), 1.0);
  EXPECT_NEAR(frame.rgb(8, 4)[1], srgb_encode(0.2), 1.0);
}

/// Many layers are bounded, and layers of placed parts count with those of the place.
TEST(Blending, LayersAreBoundedAndPlacedPartsBlend) {
  const Vec3 up = Vec3::UnitZ();
  std::vector<imaging::TexturedMesh> many;
  for (int i = 0; i < 200; ++i) many.push_back(pane(kGround + 0.01 * i * up, 50.0, {1.0F, 1.0F, 1.0F, 0.01F}));
  const Scene deep(std::move(many));
  const CameraRenderer bounded(deep, imaging::make_pinhole(9, 9, 40.0), {});
  EXPECT_EQ(bounded.render(looking_down(kGround + 10.0 * up)).rgb(4, 4)[1], 255) << "the 16th is shown opaque";

  const scene::SceneFrame frame(kGround);
  const auto part = [&](std::vector<imaging::TexturedMesh> meshes) {
    return std::make_shared<const scene::ScenePart>(std::move(meshes), frame);
  };
  const scene::PlacedPart window{
      "window", part({pane(Vec3::Zero(), 4.0, {0.0F, 1.0F, 0.0F, 0.5F})}), {scene::placed_at(SE3(), Vec3::Ones())}};
  std::vector<scene::PlacedPart> placed(2, window);
  placed[0].poses = {scene::placed_at(SE3(geometry::Mat3::Identity(), kGround + 3.0 * up), Vec3(2, 2, 2))};
  placed[1].poses = {scene::placed_at(SE3(geometry::Mat3::Identity(), kGround + 5.0 * up), Vec3(3, 3, 3))};
  const Scene scene({part({colored_ground(kGround, 100.0, {0.8F, 0.0F, 0.8F, 1.0F})})}, placed);
  const CameraRenderer renderer(scene, imaging::make_pinhole(9, 9, 20.0), {});
  const Rgb8 seen = renderer.render(looking_down(kGround + 10.0 * up)).rgb(4, 4);
  EXPECT_NEAR(seen[0], srgb_encode(0.25 * 0.8), 0.6);
  EXPECT_NEAR(seen[1], srgb_encode(0.75), 0.6);
}

TEST(CameraRenderer, TextureCoordinatesOutsideTheImageFollowTheSampler) {
  // Columns of 4 texels: black, dark, light, white; coordinates 0..4 over the ground, a texel is 1 m wide.
  const auto image = texture(4, 1, [](int x, int) {
    return grey(std::array{0, 80, 160, 240}[static_cast<std::size_t>(x)]);
  });
  const auto row_of = [&](imaging::Wrap wrap) {
    imaging::TexturedMesh mesh = ground(kGround, 16.0, image, 4.0F);
    mesh.wrap_u = wrap;
    const Scene scene({mesh});
    Camera camera(imaging::PinholeRadtan{100, 100, 7.5, 0.5, {}}, 16, 2);  // a pixel a metre, centres on texel centres
    const CameraRenderer renderer(scene, camera, {});
    const RenderedFrame frame = renderer.render(looking_down(kGround + Vec3(0, 0, 100)));
    std::vector<int> values;
    for (int x = 0; x < 16; ++x) values.push_back((frame.rgb(x, 0)[0] + 5) / 80);
    return values;
  };
  EXPECT_EQ(row_of(imaging::Wrap::kRepeat), (std::vector<int>{0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3}));
  EXPECT_EQ(row_of(imaging::Wrap::kMirroredRepeat), (std::vector<int>{0, 1, 2, 3, 3, 2, 1, 0, 0, 1, 2, 3, 3, 2, 1, 0}));
  EXPECT_EQ(row_of(imaging::Wrap::kClampToEdge), (std::vector<int>{0, 1, 2, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3}));
}

TEST(CameraRenderer, ViewTellsWhatIsNearAndFromWhichSide) {
  const Scene scene({ground(kGround, 1000.0, texture(2, 2, [](int, int) { return grey(99); }))});
  const CameraRenderer renderer(scene, imaging::make_pinhole(33, 21, 60.0), {});
  const ViewStatistics above = renderer.render(looking_down(kGround + Vec3(0, 0, 12.5))).view;
  EXPECT_NEAR(above.nearest_m, 12.5, 1e-4);
  EXPECT_EQ(above.surface_share(), 1.0);
  EXPECT_EQ(above.back_face_share(), 0.0);
  const ViewStatistics ahead = renderer.render(looking_along(kGround + Vec3(0, 0, 2.0), Vec3(0, 1, 0))).view;
  EXPECT_NEAR(ahead.surface_share(), 10.0 / 21.0, 1e-9);
  const SE3 T_up(geometry::Mat3(geometry::Mat3::Identity()), kGround + Vec3(0, 0, -3.0));
  EXPECT_EQ(renderer.render(T_up).view.back_face_share(), 1.0);
}

TEST(CameraRenderer, SameBytesForAnyNumberOfThreads) {
  const auto image = texture(300, 200, [](int x, int y) { return grey(noise(x / 2, y / 2)); });
  const auto bytes = [&](std::size_t threads, int samples) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const Scene scene({hills(kGround, 80.0, 90, image)});
    const CameraRenderer renderer(scene, imaging::make_fisheye(211, 119, 155.0), {.samples_per_pixel = samples});
    return renderer.render(looking_along(kGround + Vec3(0, -20, 20), Vec3(0.1, 0.8, -0.7)));
  };
  for (const int samples : {1, 4}) {
    const RenderedFrame one = bytes(1, samples);
    const RenderedFrame two = bytes(2, samples);
    EXPECT_EQ(one.rgb.pixels, two.rgb.pixels);
    EXPECT_EQ(std::memcmp(one.depth_m.pixels.data(), two.depth_m.pixels.data(), 4 * one.depth_m.pixels.size()), 0);
  }
}

TEST(CameraRenderer, RowsComeFromTheirOwnPoses) {
  const auto image = texture(256, 256, [](int x, int y) { return grey(noise(x / 4, y / 4)); });
  const Scene scene({hills(kGround, 100.0, 40, image)});
  const CameraRenderer renderer(scene, imaging::make_fisheye(81, 41, 120.0), {});
  std::vector<SE3> poses;
  for (int y = 0; y < 41; ++y)
    poses.push_back(looking_along(kGround + Vec3(0.2 * y, 0, 25), Vec3(0.01 * y, 0.8, -0.7)));
  const RenderedFrame rolling = renderer.render_rows(poses);
  for (const int y : {0, 17, 40}) {
    const RenderedFrame whole = renderer.render(poses[static_cast<std::size_t>(y)]);
    double difference = 0.0;
    for (int x = 0; x < 81; ++x) {
      const float depth_m = whole.depth_m(x, y);
      EXPECT_TRUE(rolling.depth_m(x, y) == depth_m || std::abs(rolling.depth_m(x, y) - depth_m) < 1e-3)
          << x << " " << y;
      difference += std::abs(rolling.rgb(x, y)[0] - whole.rgb(x, y)[0]) / 81.0;
    }
    EXPECT_LT(difference, 5.0);  // not 0: footprints hold the rows' own motion
  }
}

TEST(CameraRenderer, LightIsAveragedOverTheExposure) {
  // Half of the exposure over white, half over black ground.
  const auto white = texture(2, 2, [](int, int) { return grey(255); });
  const auto black = texture(2, 2, [](int, int) { return grey(0); });
  const Scene scene({ground(kGround, 100.0, white), ground(kGround + Vec3(1000, 0, 0), 100.0, black)});
  const CameraRenderer renderer(scene, imaging::make_pinhole(17, 11, 30.0), {});
  const SE3 over_white = looking_down(kGround + Vec3(0, 0, 30));
  const SE3 over_black = looking_down(kGround + Vec3(1000, 0, 30));
  const LightFrame frame = renderer.render_light({4, 1, {over_white, over_black, over_black, over_white}});
  ASSERT_EQ(frame.light.pixels.size(), 17U * 11U);
  for (const LinearRgb& light : frame.light.pixels) EXPECT_NEAR(light[1], 0.5F, 1e-5F);
  EXPECT_THAT(
      [&] {
        renderer.render_light({2, 1, {over_white}});
      },
      ThrowsMessage<std::invalid_argument>(HasSubstr("times x (1 or height) poses are needed")));
}

TEST(CameraRenderer, RefusesAnImpossibleNumberOfSamples) {
  const Scene scene({ground(kGround, 100.0, nullptr)});
  EXPECT_THAT([&] { CameraRenderer(scene, imaging::make_pinhole(8, 8, 40.0), {.samples_per_pixel = 5}); },
              ThrowsMessage<InputError>(HasSubstr("must be 1, 4, 9 or 16, got 5")));
}

}  // namespace
}  // namespace tileflight::render::camera_renderer_test
