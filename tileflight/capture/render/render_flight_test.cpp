#include "tileflight/capture/render/render_flight.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <atomic>
#include <map>
#include <mutex>
#include <stdexcept>
#include <thread>

#include "tileflight/capture/render/frame_renderer.h"
#include "tileflight/capture/render/test_scenes.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::render::render_flight_test {
namespace {

using geometry::SE3;
using geometry::Trajectory;
using geometry::Vec3;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

scene::Scene hilly_scene() {
  const auto image =
      test_scenes::texture(256, 256, [](int x, int y) { return test_scenes::grey(test_scenes::noise(x / 3, y / 3)); });
  return scene::Scene({test_scenes::hills(Vec3(0, 0, 2880), 120.0, 50, image)});
}

Trajectory flight_over_hills(int frames) {
  Trajectory trajectory;
  for (int i = 0; i < frames; ++i) {
    trajectory.poses.push_back(
        {0.1 * i, test_scenes::looking_along(Vec3(-10 + 0.5 * i, -20, 2905), Vec3(0.1, 0.8, -0.8))});
  }
  return trajectory;
}

struct Collected {
  imaging::RgbImage rgb;
  double time_s = 0.0;
  double exposure_ms = 0.0;
  bool depth = false;
};

struct Collector {
  std::mutex mutex;
  std::map<std::size_t, Collected> frames;

  FrameSink sink() {
    return [this](const FlightFrame& frame) {
      const std::scoped_lock lock(mutex);
      frames[frame.index] = {frame.rgb, frame.time_s, frame.exposure_ms, !frame.depth_m.empty()};
    };
  }
};

const ImageFormation kDegraded{.seed = 2,
                               .exposure_time_s = 0.02,
                               .exposure_samples = 3,
                               .line_delay_s = 1e-4,
                               .vignetting = 0.3,
                               .exposure_drift = 0.1,
                               .white_electrons = 3000,
                               .read_noise_electrons = 8};

// Where no effect needs a pixel's neighbours, light becomes pixels while it is traced.
TEST(RenderFlight, FramesDevelopedWhileTheyAreTracedAreThoseDevelopedAfterwards) {
  const scene::Scene scene = hilly_scene();
  const imaging::Camera camera = imaging::make_fisheye(150, 75, 140.0);  // not whole tiles; corners without rays
  const Trajectory frames = flight_over_hills(3);
  const geometry::StampedPose& pose = frames.poses[1];
  for (const int samples : {1, 4}) {
    FlightRenderOptions options;
    options.formation = kDegraded;
    options.formation.line_delay_s = 0.0;
    options.formation.exposure_samples = 1;
    options.render.samples_per_pixel = samples;
    const FlightFrame at_once = FrameRenderer(scene, camera, frames, {}, options).render(1);
    const LightFrame light =
        CameraRenderer(scene, camera, make_render_options(options)).render_light({1, 1, {pose.T_local_camera}});
    const double gain = exposure_gain(options.formation, pose.time_s);
    const imaging::RgbImage afterwards =
        develop(light.light, make_vignette(options.formation, 150, 75), options.formation, gain, 1);
    EXPECT_EQ(at_once.rgb.pixels, afterwards.pixels);
    EXPECT_EQ(at_once.check.view.surfaces, light.view.surfaces);
    EXPECT_GT(at_once.check.view.surfaces, 1000);
  }
}

TEST(RenderFlight, EveryFrameArrivesOnceAndTheSameForAnyNumberOfThreads) {
  const scene::Scene scene = hilly_scene();
  const imaging::Camera camera = imaging::make_fisheye(90, 60, 140.0);
  const Trajectory frames = flight_over_hills(9);
  for (const ImageFormation& formation : {ImageFormation{}, kDegraded}) {
    std::map<std::size_t, Collected> reference;
    for (const std::size_t threads : {1U, 2U, 4U}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      Collector collector;
      FlightRenderOptions options;
      options.formation = formation;
      const FlightRenderReport report = render_flight(scene, camera, frames, {}, options, collector.sink());
      EXPECT_EQ(report.frames, 9);
      EXPECT_THAT(report.warnings, testing::IsEmpty());
      ASSERT_EQ(collector.frames.size(), 9U);
      if (reference.empty()) reference = collector.frames;
      for (const auto& [index, frame] : collector.frames) {
        EXPECT_EQ(frame.rgb.pixels, reference[index].rgb.pixels) << index;
        EXPECT_DOUBLE_EQ(frame.time_s, frames.poses[index].time_s);
        EXPECT_TRUE(frame.depth);
        EXPECT_DOUBLE_EQ(frame.exposure_ms, 1e3 * formation.exposure_time_s * exposure_gain(formation, frame.time_s));
      }
    }
  }
}

TEST(RenderFlight, FramesAreThoseOfTheRenderer) {
  const scene::Scene scene = hilly_scene();
  const imaging::Camera camera = imaging::make_fisheye(90, 60, 140.0);
  const Trajectory frames = flight_over_hills(3);
  Collector collector;
  FlightRenderOptions options;
  options.render.depth = false;
  render_flight(scene, camera, frames, {}, options, collector.sink());
  const CameraRenderer renderer(scene, camera, {});
  EXPECT_EQ(collector.frames[2].rgb.pixels, renderer.render(frames.poses[2].T_local_camera).rgb.pixels);
  EXPECT_FALSE(collector.frames[2].depth);
}

// Frames may be distributed over several processes: the images do not depend on which process renders them.
TEST(RenderFlight, FramesThatAreWantedAreThoseOfTheWholeFlight) {
  const scene::Scene scene = hilly_scene();
  const imaging::Camera camera = imaging::make_fisheye(90, 60, 140.0);
  const Trajectory frames = flight_over_hills(7);
  FlightRenderOptions options;
  options.formation = kDegraded;
  options.formation.auto_exposure = {.target = 0.2, .time_constant_s = 0.1};
  Collector whole;
  const FlightRenderReport report = render_flight(scene, camera, frames, {}, options, whole.sink());
  for (const std::size_t rank : {0U, 1U}) {
    options.frame_filter = [rank](std::size_t index) { return index % 2 == rank; };
    Collector part;
    std::int64_t last = 0, total = 0;
    const FlightRenderReport of_part = render_flight(scene, camera, frames, {}, options, part.sink(),
                                                     [&](std::int64_t done, std::int64_t of, std::string_view) {
                                                       last = done;
                                                       total = of;
                                                     });
    ASSERT_EQ(part.frames.size(), rank == 0 ? 4U : 3U);
    EXPECT_EQ(of_part.frames, static_cast<std::int64_t>(part.frames.size()));
    EXPECT_EQ(last, of_part.frames);
    EXPECT_EQ(total, of_part.frames);
    EXPECT_EQ(of_part.exposure_after->log_gain, report.exposure_after->log_gain);
    for (const auto& [index, frame] : part.frames) {
      EXPECT_EQ(index % 2, rank);
      EXPECT_EQ(frame.rgb.pixels, whole.frames[index].rgb.pixels) << index;
      EXPECT_EQ(frame.exposure_ms, whole.frames[index].exposure_ms) << index;
    }
  }
}

TEST(RenderFlight, MemoryIsBoundedByTheFramesInFlight) {
  const scene::Scene scene = hilly_scene();
  std::atomic<int> taken{0};
  std::atomic<int> most{0};
  FlightRenderOptions options;
  options.max_frames_in_memory = 2;
  const FrameSink slow = [&](const FlightFrame&) {
    const int now = ++taken;
    int before = most;
    while (before < now && !most.compare_exchange_weak(before, now)) {
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(3));
    --taken;
  };
  render_flight(scene, imaging::make_fisheye(60, 40, 120.0), flight_over_hills(8), {}, options, slow);
  EXPECT_GT(most, 0);
  EXPECT_LE(most, 2);
}

TEST(RenderFlight, WarnsOfBadPaths) {
  const auto grey = test_scenes::texture(2, 2, [](int, int) { return test_scenes::grey(120); });
  const scene::Scene scene({test_scenes::ground(Vec3(0, 0, 100), 50.0, grey)});
  const auto down = [](double z) { return test_scenes::looking_down(Vec3(0, 0, z)); };
  const SE3 up(geometry::Mat3(geometry::Mat3::Identity()), Vec3(0, 0, 110));
  Trajectory frames;
  frames.poses = {{0, down(110)}, {1, down(100.2)}, {2, down(100.1)}, {3, down(110)}, {4, up}, {5, down(95)}};
  const FlightRenderReport report =
      render_flight(scene, imaging::make_pinhole(33, 21, 40.0), frames, {}, {}, [](auto&&...) {});
  EXPECT_THAT(report.warnings, ElementsAre(HasSubstr("frames 1 to 2: a surface is nearer to the camera than 0.3 m"),
                                           HasSubstr("frames 4 to 5: no surface is in view"),
                                           HasSubstr("frame 5: the camera is inside or under a surface"),
                                           HasSubstr("frame 4: the path to the next frame goes through a surface")));
  EXPECT_NEAR(report.nearest_m, 0.1, 1e-4);
}

TEST(RenderFlight, WarningsOfFramesThatAreNotKnownAreLeftOut) {
  const FrameCheck good{.view = {.nearest_m = 5.0, .rays = 10, .surfaces = 9, .back_faces = 0},
                        .surroundings = {},
                        .path_is_blocked = false};
  FrameCheck near = good, blocked = good;
  near.view.nearest_m = 0.1;
  blocked.path_is_blocked = true;
  const std::vector<std::optional<FrameCheck>> checks{good, near, near, std::nullopt, near, blocked};
  EXPECT_THAT(flight_warnings(checks, 10, 0.3),
              ElementsAre(HasSubstr("frames 11 to 12: a surface is nearer"), HasSubstr("frame 14: a surface is nearer"),
                          HasSubstr("frame 15: the path to the next frame goes through")));
  EXPECT_THAT(flight_warnings(checks, 0, 0.05), ElementsAre(HasSubstr("frame 5: the path to the next")));
}

TEST(RenderFlight, FaultsAreNamedForPrograms) {
  const FrameCheck good{.view = {.nearest_m = 5.0, .rays = 10, .surfaces = 9, .back_faces = 0}, .surroundings = {}};
  FrameCheck inside = good, beside = good, behind = good;
  inside.surroundings.inside = true;
  inside.view.back_faces = 8;  // the fault is not reported twice
  beside.surroundings.clearance_m = 0.1;
  behind.view.back_faces = 8;
  const std::vector<std::optional<FrameCheck>> checks{inside, good, inside, beside, behind};
  const std::vector<FlightFault> faults = find_flight_faults(checks, 3, 0.3);
  ASSERT_EQ(faults.size(), 3U);
  EXPECT_EQ(faults[0].key, "camera_near_surface");
  EXPECT_THAT(faults[0].frames, ElementsAre(6));
  EXPECT_EQ(faults[1].key, "camera_inside_surface");
  EXPECT_THAT(faults[1].frames, ElementsAre(3, 5));
  EXPECT_EQ(faults[2].key, "surfaces_seen_from_behind");
  EXPECT_THAT(faults[2].frames, ElementsAre(7));
  EXPECT_TRUE(find_flight_faults(std::vector<std::optional<FrameCheck>>{good}, 0, 0.3).empty());
}

TEST(RenderFlight, AWallBetweenTwoFramesAndARoundWayPastIt) {
  // A wall across the path from (-5, 0) to (5, 0), 4 m wide; the path goes around it.
  imaging::TexturedMesh wall = test_scenes::ground(
      Vec3(0, 0, 100), 400.0, test_scenes::texture(1, 1, [](int, int) { return test_scenes::grey(120); }));
  imaging::TexturedMesh upright = wall;
  upright.mesh.vertices = {Vec3(0, -2, 100), Vec3(0, 2, 100), Vec3(0, 2, 140), Vec3(0, -2, 140)};
  const scene::Scene scene({wall, upright});
  const auto at = [](double x, double y) { return test_scenes::looking_down(Vec3(x, y, 110)); };
  Trajectory frames;
  frames.poses = {{0, at(-5, 0)}, {1, at(5, 0)}};
  const PoseFunction straight = [&](double t) { return at(-5 + 10 * t, 0); };
  const PoseFunction around = [&](double t) { return at(-5 + 10 * t, 5 * std::sin(M_PI * t)); };
  const auto blocked = [&](const PoseFunction& path) {
    bool found = false;
    render_flight(scene, imaging::make_pinhole(33, 21, 40.0), frames, path, {},
                  [&](const FlightFrame& frame) { found = found || frame.check.path_is_blocked; });
    return found;
  };
  EXPECT_TRUE(blocked(straight));
  EXPECT_TRUE(blocked({})) << "without a path, straight from one to the next";
  EXPECT_FALSE(blocked(around));
}

TEST(RenderFlight, ProgressCountsUpAndErrorsOfTheSinkComeThrough) {
  const scene::Scene scene = hilly_scene();
  const imaging::Camera camera = imaging::make_fisheye(40, 30, 120.0);
  std::vector<std::int64_t> seen;
  render_flight(
      scene, camera, flight_over_hills(5), {}, {}, [](auto&&...) {},
      [&](std::int64_t done, std::int64_t total, std::string_view) {
        EXPECT_EQ(total, 5);
        seen.push_back(done);
      });
  EXPECT_THAT(seen, ElementsAre(1, 2, 3, 4, 5));
  const FrameSink full_disk = [](auto&&...) { throw std::runtime_error("no space left"); };
  EXPECT_THAT([&] { render_flight(scene, camera, flight_over_hills(5), {}, {}, full_disk); },
              ThrowsMessage<std::runtime_error>(HasSubstr("no space left")));
}

TEST(RenderFlight, RefusesNothingToDoAndOptionsOutOfRange) {
  const scene::Scene scene = hilly_scene();
  const imaging::Camera camera = imaging::make_fisheye(40, 30, 120.0);
  const FrameSink ignore = [](auto&&...) {};
  EXPECT_THAT([&] { render_flight(scene, camera, {}, {}, {}, ignore); },
              ThrowsMessage<InputError>(HasSubstr("flight: there are no frames to render")));
  FlightRenderOptions options;
  options.formation.vignetting = 2.0;
  EXPECT_THAT([&] { render_flight(scene, camera, flight_over_hills(1), {}, options, ignore); },
              ThrowsMessage<InputError>(HasSubstr("vignetting: must lie between 0 and 1")));
}

}  // namespace
}  // namespace tileflight::render::render_flight_test
