// A camera that flies over painted ground, against the closed form of each pixel's light.
#include "tileflight/capture/events/event_camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "tests/refusal.h"
#include "tileflight/capture/render/test_scenes.h"

namespace tileflight::events::event_camera_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
namespace shapes = render::test_scenes;

constexpr int kWidth = 40, kHeight = 6;
constexpr double kHeight_m = 10.0, kSpeed_m_s = 3.0, kEnd_s = 1.0;
const double kFocal_px = 20.0 / std::tan(std::numbers::pi / 6.0);

/// Light of the ground along x: straight between knots, linear light 0..255.
struct Profile {
  std::vector<double> x_m;
  std::vector<int> value;

  double light_at(double x) const {
    const auto above = static_cast<std::size_t>(std::ranges::upper_bound(x_m, x) - x_m.begin());
    const double share = (x - x_m[above - 1]) / (x_m[above] - x_m[above - 1]);
    return (value[above - 1] + share * (value[above] - value[above - 1])) / 255.0;
  }
};

Profile ramp() { return {{-30.0, 30.0}, {12, 250}}; }
Profile edge() { return {{-30.0, 1.1, 1.6, 30.0}, {20, 20, 230, 230}}; }
Profile grating() {
  Profile profile;
  constexpr double kPeriod_m = 2.9;
  for (int k = -400; k <= 400; ++k) {
    profile.x_m.push_back(k * kPeriod_m / 24.0);
    profile.value.push_back(static_cast<int>(std::lround(128.0 + 100.0 * std::sin(2.0 * std::numbers::pi * k / 24.0))));
  }
  return profile;
}

/// Ground painted by its vertices' colours.
scene::Scene ground_of(const Profile& profile) {
  imaging::TexturedMesh mesh;
  for (std::size_t k = 0; k < profile.x_m.size(); ++k) {
    const auto value = static_cast<std::uint8_t>(profile.value[k]);
    for (const double y : {-20.0, 20.0}) {
      mesh.mesh.vertices.emplace_back(profile.x_m[k], y, 0.0);
      mesh.colors.push_back({value, value, value, 255});
    }
  }
  for (std::uint32_t k = 0; k + 1 < profile.x_m.size(); ++k) {
    mesh.mesh.triangles.push_back({2 * k, 2 * k + 2, 2 * k + 3});
    mesh.mesh.triangles.push_back({2 * k, 2 * k + 3, 2 * k + 1});
  }
  return scene::Scene({mesh});
}

SE3 pose_at(double time_s) { return shapes::looking_down(Vec3(kSpeed_m_s * time_s, 0.3, kHeight_m)); }

EventOptions ideal() {
  return {.threshold_sigma = 0.0, .refractory_s = 0.0, .leak_rate_hz = 0.0, .shot_noise_rate_hz = 0.0};
}

/// An event of the closed form.
struct Expected {
  double time_s;
  int polarity;
};

/// What a pixel sends that looks along a profile from x on: on each straight piece, light passes the thresholds where
/// the inverse of the logarithm says.
std::vector<Expected> closed_form(const Profile& profile, const EventOptions& options, double x_m) {
  std::vector<double> knots{x_m};
  const double end_m = x_m + kSpeed_m_s * kEnd_s;
  for (const double knot : profile.x_m) {
    if (knot > x_m && knot < end_m) knots.push_back(knot);
  }
  knots.push_back(end_m);
  const auto log_light = [&](double x) { return std::log(profile.light_at(x) + options.dark_light); };
  double reference = log_light(x_m);
  std::vector<Expected> events;
  for (std::size_t k = 0; k + 1 < knots.size(); ++k) {
    const double first = profile.light_at(knots[k]), last = profile.light_at(knots[k + 1]);
    const int direction = last > first ? 1 : -1;
    const double threshold = direction > 0 ? options.positive_threshold : options.negative_threshold;
    while (last != first) {
      const double next = reference + direction * threshold;
      if (direction * (log_light(knots[k + 1]) - next) < 0.0) break;
      const double share = (std::exp(next) - options.dark_light - first) / (last - first);
      const double at_m = knots[k] + share * (knots[k + 1] - knots[k]);
      events.push_back({(at_m - x_m) / kSpeed_m_s, direction > 0 ? 1 : 0});
      reference = next;
    }
  }
  return events;
}

struct Recording {
  std::vector<Event> events;
  EventCounts counts;
};

Recording record(const scene::Scene& scene, const EventOptions& options,
                 const std::vector<double>& times_s = {0.0, kEnd_s}, const render::PoseFunction& path = pose_at) {
  EventCamera camera(imaging::make_pinhole(kWidth, kHeight, 60.0), path, options, times_s.front());
  Recording recording;
  std::vector<TimeSpan> spans;
  for (std::size_t k = 0; k + 1 < times_s.size(); ++k) spans.push_back({times_s[k], times_s[k + 1]});
  camera.record({scene, {}}, spans, [&](const std::vector<Event>& events) {
    recording.events.insert(recording.events.end(), events.begin(), events.end());
  });
  recording.counts = camera.counts();
  return recording;
}

/// Errors of the events' times.
struct Comparison {
  int pixels_with_other_counts = 0;
  std::size_t compared = 0;
  double worst_s = 0.0, mean_s = 0.0;
};

Comparison compare(const Profile& profile, const EventOptions& options, const Recording& recording) {
  Comparison result;
  std::map<std::pair<int, int>, std::vector<Event>> by_pixel;
  for (const Event& event : recording.events) by_pixel[{event.x, event.y}].push_back(event);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double x_m = kHeight_m * (x - 0.5 * (kWidth - 1)) / kFocal_px;
      const std::vector<Expected> expected = closed_form(profile, options, x_m);
      const std::vector<Event>& found = by_pixel[{x, y}];
      const bool is_same = std::ranges::equal(expected, found, {}, &Expected::polarity, &Event::polarity);
      result.pixels_with_other_counts += is_same ? 0 : 1;
      for (std::size_t k = 0; is_same && k < found.size(); ++k) {
        const double error_s = std::abs(1e-6 * (found[k].t_us + 0.5) - expected[k].time_s);
        result.worst_s = std::max(result.worst_s, error_s);
        result.mean_s += error_s;
        ++result.compared;
      }
    }
  }
  result.mean_s /= static_cast<double>(std::max<std::size_t>(1, result.compared));
  return result;
}

/// The time in which the ground moves by so many pixels.
double step_s(double motion_px) { return motion_px * kHeight_m / kFocal_px / kSpeed_m_s; }

TEST(EventCamera, ARampOfLightGivesTheClosedFormsEvents) {
  EventOptions options = ideal();
  options.positive_threshold = 0.07;
  options.max_step_s = 1.0;
  const Recording recording = record(ground_of(ramp()), options);
  const Comparison with = compare(ramp(), options, recording);
  EXPECT_EQ(with.pixels_with_other_counts, 0);
  EXPECT_GT(with.compared, 200U);
  EXPECT_LT(with.worst_s, step_s(0.5));
  EXPECT_LT(with.mean_s, 0.02 * step_s(0.5)) << "a ramp is nearly straight from sample to sample";
  EXPECT_NEAR(static_cast<double>(recording.counts.samples), kEnd_s / step_s(0.9 * 0.5), 2.0);
}

TEST(EventCamera, AMovingEdgeIsSeenWhereItPassesWithinAStep) {
  EventOptions options = ideal();
  options.positive_threshold = 0.31;
  options.max_step_s = 1.0;
  const Recording recording = record(ground_of(edge()), options);
  const Comparison with = compare(edge(), options, recording);
  EXPECT_EQ(with.pixels_with_other_counts, 0);
  EXPECT_GT(with.compared, 60U * 7U - 30U);  // 10.4 columns pass the edge, 7 thresholds (log(230.3 / 20.3) = 2.4) each
  EXPECT_LT(with.worst_s, step_s(0.5));
  for (const Event& event : recording.events) EXPECT_EQ(event.polarity, 1);
}

TEST(EventCamera, BackwardsTheSameEdgeIsSeenGoingDark) {
  EventOptions options = ideal();
  options.negative_threshold = 0.31;
  Profile mirrored = edge();
  std::ranges::reverse(mirrored.value);
  const Recording recording = record(ground_of(mirrored), options);
  const Comparison with = compare(mirrored, options, recording);
  EXPECT_EQ(with.pixels_with_other_counts, 0);
  EXPECT_LT(with.worst_s, step_s(0.5));
  for (const Event& event : recording.events) EXPECT_EQ(event.polarity, 0);
  EXPECT_GT(recording.events.size(), 300U);
}

TEST(EventCamera, AGratingConvergesAsStepsAreHalved) {
  const scene::Scene scene = ground_of(grating());
  double before_s = 1.0;
  int others = kWidth * kHeight / 3;
  for (const double motion_px : {0.5, 0.25, 0.125, 0.0625}) {
    EventOptions options = ideal();
    options.max_motion_px = motion_px;
    options.max_step_s = 1.0;
    const Comparison with = compare(grating(), options, record(scene, options));
    // A turn between two samples may be lost to a pixel that just reaches a threshold there.
    EXPECT_LT(with.pixels_with_other_counts, others) << motion_px;
    others = with.pixels_with_other_counts;
    EXPECT_GT(with.compared, 800U);
    EXPECT_LT(with.worst_s, step_s(motion_px)) << motion_px;
    EXPECT_LT(with.mean_s, 0.5 * before_s) << motion_px;
    before_s = with.mean_s;
  }
  EXPECT_LE(others, kWidth * kHeight / 20);
}

TEST(EventCamera, StepsFollowTurnsOfTheCamera) {
  EventOptions options = ideal();
  options.max_step_s = 1.0;
  const auto turning = [](double time_s) {
    SE3 T = pose_at(0.0);
    T.rotation = T.rotation * Eigen::Quaterniond(geometry::so3_exp(Vec3(0, 0.4 * time_s * time_s, 0)));
    return T;
  };
  const std::uint64_t samples = record(ground_of(ramp()), options, {0.0, 1.0}, turning).counts.samples;
  // 0.4 rad about y: f tan(0.4) px at the image's middle, more at its edges: the integral of the border's speed.
  const double edge_rad = std::atan(19.5 / kFocal_px);
  const double border_px = kFocal_px * 0.4 * (1.0 + std::tan(edge_rad) * std::tan(edge_rad));
  EXPECT_GT(static_cast<double>(samples), border_px / 0.5);
  EXPECT_LT(static_cast<double>(samples), 1.4 * border_px / 0.45 + 3.0);
}

TEST(EventCamera, AStillPictureTakesLongStepsOnly) {
  EventOptions options = ideal();
  options.max_step_s = 0.25;
  const Recording recording = record(ground_of(grating()), options, {0.0, 1.0}, [](double) { return pose_at(0.0); });
  EXPECT_EQ(recording.counts.samples, 4U);
  EXPECT_TRUE(recording.events.empty());
}

TEST(EventCamera, ChangeOfLightMayShortenSteps) {
  EventOptions options = ideal();
  options.max_motion_px = 3.0;
  options.max_step_s = 1.0;
  const scene::Scene scene = ground_of(grating());
  const std::uint64_t coarse = record(scene, options).counts.samples;
  options.max_change = 0.1;
  const Recording fine = record(scene, options);
  EXPECT_GT(fine.counts.samples, 3 * coarse);
  EXPECT_LE(compare(grating(), options, fine).pixels_with_other_counts, kWidth * kHeight / 10);
}

TEST(EventCamera, EventsDoNotDependOnThreadsNorOnPartsOfTheFlight) {
  const EventOptions options{.seed = 3, .shot_noise_rate_hz = 5.0};
  const scene::Scene scene = ground_of(grating());
  const std::vector<double> times_s{0.0, 0.21, 0.5, 0.77, 1.0};
  const auto made = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return record(scene, options, times_s).events;
  };
  const std::vector<Event> whole = made(1);
  EXPECT_GT(whole.size(), 3000U);
  EXPECT_EQ(whole, made(2));
  std::vector<Event> in_parts;
  EventCamera camera(imaging::make_pinhole(kWidth, kHeight, 60.0), pose_at, options, 0.0);
  const auto keep = [&](const std::vector<Event>& events) {
    in_parts.insert(in_parts.end(), events.begin(), events.end());
  };
  camera.record({scene, {}}, {{0.0, 0.21}}, keep);
  const scene::Scene same = ground_of(grating());
  camera.record({same, {}}, {{0.21, 0.5}, {0.5, 0.77}}, keep);
  camera.record({scene, {}}, {{0.77, 1.0}}, keep);
  EXPECT_EQ(in_parts, whole);
}

TEST(EventCamera, OtherTilesOfThePlaceGiveNoEvents) {
  std::vector<Event> events;
  EventOptions options = ideal();
  EventCamera camera(
      imaging::make_pinhole(kWidth, kHeight, 60.0), [](double) { return pose_at(0.0); }, options, 0.0);
  const auto keep = [&](const std::vector<Event>& some) { events.insert(events.end(), some.begin(), some.end()); };
  const scene::Scene one = ground_of(grating()), other = ground_of(edge());
  camera.record({one, {}}, {{0.0, 0.1}}, keep);
  camera.record({other, {}}, {{0.1, 0.2}}, keep);
  EXPECT_TRUE(events.empty());
}

TEST(EventCamera, TimesCountFromTheMicrosecondOfTheStart) {
  EventOptions options = ideal();
  options.positive_threshold = 0.07;
  constexpr double kStart_s = 1403636579.7635554;
  const std::vector<Event> early = record(ground_of(ramp()), options).events;
  const std::vector<Event> late = record(ground_of(ramp()), options, {kStart_s, kStart_s + 1.0}, [](double t) {
                                    return pose_at(t - kStart_s);
                                  }).events;
  ASSERT_EQ(early.size(), late.size());
  for (std::size_t k = 0; k < early.size(); ++k)
    EXPECT_NEAR(early[k].t_us + 1e6 * kStart_s, late[k].t_us + std::floor(1e6 * kStart_s), 200.0);
}

TEST(EventCamera, RefusesARateThatNoCameraReadsOut) {
  EventOptions options = ideal();
  options.max_rate_hz = 5.0;
  EXPECT_THAT(tests::refusal_of([&] { record(ground_of(grating()), options); }),
              testing::StartsWith("events: more than 5 a second and pixel (max_rate_hz) from 0.000000 to 1.000000 s"));
  options.positive_threshold = 0.0;
  EXPECT_THAT(tests::refusal_of([&] { record(ground_of(grating()), options); }),
              testing::StartsWith("events: positive_threshold: must lie between 0.01 and 10"));
}

}  // namespace
}  // namespace tileflight::events::event_camera_test
