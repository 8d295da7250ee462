#include "tileflight/slam/mapping/mapper.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include "tileflight/slam/mapping/test_rendered_window.h"
#include "tileflight/slam/mapping/tracer.h"

namespace tileflight::mapping::mapper_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using test_support::RenderedFlight;

constexpr int kFirstKeyframes = 4, kKeyframes = 9;  // keyframe i is image 2 i

/// The error of the poses that the mapper is given: 5 cm, 3 mrad.
SE3 disturbed(const SE3& T_camera_map, std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  geometry::Vec6 twist;
  for (int i = 0; i < 6; ++i) twist[i] = (i < 3 ? 0.05 : 0.003) * unit(random);
  return SE3::exp(twist) * T_camera_map;
}

/// A mapper that was started from true poses and then given keyframes at disturbed ones.
class MappedFlight {
 public:
  MappedFlight() {
    flight_.options.selection.points_per_keyframe = 600;
    flight_.options.window.active_points = 800;
    flight_.options.window.min_keyframes = 4;
    flight_.options.window.max_keyframes = 5;
    flight_.options.window.refine_intrinsics = false;
    flight_.options.map.dense = false;
    initialize();
    std::mt19937 random(4);
    for (int k = kFirstKeyframes; k < kKeyframes; ++k) {
      mapper_.trace(*flight_.pyramid(2 * k - 1), RenderedFlight::T_camera_map(2 * k - 1), {});
      const imaging::RgbImage image = flight_.image(2 * k);
      KeyframeCandidate source = candidate(2 * k, image);
      source.T_camera_map = disturbed(source.T_camera_map, random);
      given_error_m_ = std::max(given_error_m_, error_m(k, source.T_camera_map.inverse()));
      std::set<int> in_window = {k};
      for (const keyframes::Keyframe& keyframe : mapper_.window().keyframes) in_window.insert(keyframe.id);
      mapper_.add_keyframe(source);
      note_steps(in_window);
      largest_window_ = std::max(largest_window_, mapper_.window().size());
      const KeyframeRecord newest = mapper_.keyframes().back();
      largest_error_m_ = std::max(largest_error_m_, error_m(newest.id, newest.T_map_camera));
    }
  }

  static double error_m(int keyframe, const SE3& T_map_camera) {
    return (T_map_camera.translation - RenderedFlight::T_camera_map(2 * keyframe).inverse().translation).norm();
  }
  const RenderedFlight& flight() const { return flight_; }
  const Mapper& mapper() const { return mapper_; }
  double given_error_m() const { return given_error_m_; }
  double largest_error_m() const { return largest_error_m_; }
  int largest_window() const { return largest_window_; }
  /// By keyframe: its pose in the axes of the keyframe before, after the last optimisation of both.
  const std::map<int, SE3>& steps() const { return steps_; }

 private:
  void note_steps(const std::set<int>& optimized) {
    const std::vector<KeyframeRecord> all = mapper_.keyframes();
    for (std::size_t k = 1; k < all.size(); ++k) {
      if (optimized.contains(all[k].id) && optimized.contains(all[k - 1].id))
        steps_[all[k].id] = all[k - 1].T_map_camera.inverse() * all[k].T_map_camera;
    }
  }
  KeyframeCandidate candidate(int image_index, const imaging::RgbImage& image) const {
    KeyframeCandidate source;
    source.frame_index = image_index;
    source.time_s = 0.1 * image_index;
    source.pyramid = flight_.pyramid(image_index);
    source.image = &image;
    source.T_camera_map = RenderedFlight::T_camera_map(image_index);
    source.brightness_information = {1e6, 1e4};
    return source;
  }
  void initialize() {
    std::vector<keyframes::Keyframe> keyframes;
    for (int i = 0; i <= 2 * (kFirstKeyframes - 1); ++i) {
      const SE3 T_camera_map = RenderedFlight::T_camera_map(i);
      const auto pyramid = flight_.pyramid(i);
      for (keyframes::Keyframe& keyframe : keyframes) {
        trace_points(flight_.lens.lenses[0], pyramid->levels[0],
                     keyframes::pair_transform(T_camera_map * keyframe.T_camera_map().inverse(), {}, {}),
                     flight_.options.tracing, flight_.options.window.huber, keyframe.immature);
      }
      const imaging::RgbImage image = flight_.image(i);
      if (i % 2 == 0) keyframes.push_back(mapper_.make_keyframe(candidate(i, image)));
    }
    mapper_.initialize(std::move(keyframes));
  }

  RenderedFlight flight_;
  Mapper mapper_{flight_.lens, flight_.options};
  double given_error_m_ = 0.0, largest_error_m_ = 0.0;
  int largest_window_ = 0;
  std::map<int, SE3> steps_;
};

const MappedFlight& mapped() {
  static const MappedFlight kMapped;
  return kMapped;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

TEST(Mapper, BringsKeyframesToTheirTruePoses) {
  const double given_m = mapped().given_error_m();
  EXPECT_GT(given_m, 0.05);
  EXPECT_LT(mapped().largest_error_m(), 0.5 * given_m) << "when they were added";
  for (const KeyframeRecord& keyframe : mapped().mapper().keyframes()) {
    EXPECT_LT(MappedFlight::error_m(keyframe.id, keyframe.T_map_camera), 0.3 * given_m) << keyframe.id;
    const SE3 error = keyframe.T_map_camera * RenderedFlight::T_camera_map(2 * keyframe.id);
    EXPECT_LT(geometry::so3_log(error.rotation).norm(), 1e-3) << keyframe.id;
  }
}

TEST(Mapper, KeepsARecordOfEveryKeyframeAndASmallWindow) {
  const Mapper& mapper = mapped().mapper();
  const std::vector<KeyframeRecord> all = mapper.keyframes();
  ASSERT_EQ(all.size(), static_cast<std::size_t>(kKeyframes));
  for (int i = 0; i < kKeyframes; ++i) {
    EXPECT_EQ(all[i].id, i);
    EXPECT_EQ(all[i].frame_index, 2 * i);
    EXPECT_DOUBLE_EQ(all[i].time_s, 0.2 * i);
  }
  EXPECT_LE(mapped().largest_window(), 5);
  EXPECT_GE(mapper.window().size(), 4);
  EXPECT_EQ(mapper.window().keyframes.back().id, kKeyframes - 1);
  EXPECT_EQ(mapper.step_uncertainties().size(), all.size());
  EXPECT_TRUE(mapper.intrinsics_delta().isZero(0)) << "it was not to be estimated";
}

TEST(Mapper, StepsAreThoseWhenBothKeyframesWereLastInTheWindow) {
  const std::vector<StepUncertainty>& steps = mapped().mapper().step_uncertainties();
  const std::vector<KeyframeRecord> keyframes = mapped().mapper().keyframes();
  ASSERT_EQ(mapped().steps().size(), steps.size() - 1);
  EXPECT_EQ(steps[0].before, -1);
  int moved_later = 0;
  for (const auto& [id, expected] : mapped().steps()) {
    const StepUncertainty& step = steps[static_cast<std::size_t>(id)];
    EXPECT_EQ(step.before, id - 1);
    EXPECT_LT((step.T_before_keyframe.matrix() - expected.matrix()).norm(), 1e-12) << id;
    const SE3 latest = keyframes[static_cast<std::size_t>(id - 1)].T_map_camera.inverse() *
                       keyframes[static_cast<std::size_t>(id)].T_map_camera;
    moved_later += (latest.matrix() - expected.matrix()).norm() > 1e-9;
  }
  EXPECT_GT(moved_later, 0) << "no keyframe outlived its neighbour";
}

TEST(Mapper, PointsLieOnTheGroundThoseThatLeftTheWindowToo) {
  const std::vector<KeyframeRecord> keyframes = mapped().mapper().keyframes();
  std::set<int> in_window;
  for (const keyframes::Keyframe& keyframe : mapped().mapper().window().keyframes) in_window.insert(keyframe.id);
  std::vector<double> left_m, inside_m;
  for (const MapPoint& point : mapped().mapper().points()) {
    const Vec3 p = keyframes.at(point.keyframe).T_map_camera * (point.ray.cast<double>() / point.rho);
    const double error_m = std::abs(p.z() - mapped().flight().relief.height_m(p.x(), p.y()));
    (in_window.contains(point.keyframe) ? inside_m : left_m).push_back(error_m);
  }
  ASSERT_GT(left_m.size(), 300U);
  ASSERT_GT(inside_m.size(), 300U);
  EXPECT_LT(median(left_m), 0.15);
  EXPECT_LT(median(inside_m), 0.15);
}

TEST(Mapper, ReferencePointsHaveTheTrueDistancesFromTheirKeyframe) {
  const Mapper& mapper = mapped().mapper();
  const keyframes::Window& window = mapper.window();
  std::size_t hosted = 0;
  for (int slot = 0; slot < window.size(); ++slot) {
    const std::vector<tracking::ReferencePoint> points = mapper.reference_points(slot);
    std::vector<double> errors;
    for (const tracking::ReferencePoint& point : points) {
      const auto ray = mapped().flight().camera.unproject(point.pixel.cast<double>());
      ASSERT_TRUE(ray);
      const float truth = mapped().flight().rho(2 * window.keyframes[slot].id, ray->cast<float>());
      errors.push_back(std::abs(point.rho / truth - 1.0));
    }
    EXPECT_GT(points.size(), window.keyframes[slot].points.size()) << "points of other keyframes are seen too";
    EXPECT_LT(median(errors), 0.01) << slot;
    hosted += window.keyframes[slot].points.size();
  }
  EXPECT_EQ(mapper.active_points(), hosted);
}

}  // namespace
}  // namespace tileflight::mapping::mapper_test
