#include "tileflight/slam/mapping/static_stereo.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "tileflight/slam/mapping/activation.h"
#include "tileflight/slam/mapping/residual_states.h"
#include "tileflight/slam/mapping/tracer.h"
#include "tileflight/slam/mapping/window_optimizer.h"

namespace tileflight::mapping {
namespace {

using Status = keyframes::ImmaturePoint::Status;

/// Share of the searched points that must match for a picture to be used. Chosen by hand: chance matches are a few
/// percent, repeating texture and occlusion leave well over a half.
constexpr double kLeastMatched = 0.2, kWellMatched = 0.5;

bool is_matched(const StereoMatches& matches, double share) { return matches.found >= share * matches.searched; }

/// The points after a search in one stereo picture.
struct SearchedPoints {
  std::vector<keyframes::ImmaturePoint> points;
  StereoMatches matches;
};

/// Outcome of a search for one point: only an unambiguous match replaces what was known of it.
enum class SearchOutcome : std::uint8_t { kOutside, kFailed, kFound };

keyframes::PairTransform inverse(const keyframes::PairTransform& pair) {
  return {pair.R.transpose(), -(pair.R.transpose() * pair.t), 1.0F / pair.gain, -pair.offset / pair.gain};
}

/// Search from a keyframe in one of its stereo pictures, and back.
class StereoSearch {
 public:
  StereoSearch(const keyframes::Lens& own_lens, const keyframes::Window& window, const keyframes::Keyframe& keyframe,
               std::size_t camera, const keyframes::OdometryOptions& options)
      : own_lens_(own_lens),
        lens_(window.stereo_cameras[camera].lens),
        own_(keyframe.pyramid->levels[0]),
        picture_(keyframe.stereo[camera].pyramid->levels[0]),
        pair_(keyframes::stereo_transform(window, keyframe, static_cast<int>(camera))),
        back_(inverse(pair_)),
        options_(options),
        tracing_(options.tracing) {
    // The tracer takes at most so many steps, which shall not be longer than a pixel.
    constexpr double kLongest_px = 126.0;
    const double size = picture_.width + picture_.height;
    tracing_.max_search_share = std::min(tracing_.stereo_search_share, kLongest_px / size);
  }

  SearchedPoints operator()(std::vector<keyframes::ImmaturePoint> points) const {
    SearchedPoints result{std::move(points), {}};
    std::vector<SearchOutcome> outcomes(result.points.size());
    tbb::parallel_for(std::size_t{0}, result.points.size(),
                      [&](std::size_t i) { outcomes[i] = search(result.points[i]); });
    for (const SearchOutcome outcome : outcomes) {
      result.matches.searched += outcome != SearchOutcome::kOutside;
      result.matches.found += outcome == SearchOutcome::kFound;
    }
    return result;
  }

 private:
  SearchOutcome search(keyframes::ImmaturePoint& point) const {
    keyframes::ImmaturePoint traced = point;
    trace_point(lens_, picture_, pair_, tracing_, options_.window.huber, traced);
    if (traced.status == Status::kOutside) return SearchOutcome::kOutside;
    if (traced.status == Status::kSkipped && point.has_depth()) return SearchOutcome::kFound;  // by another camera
    if (traced.status != Status::kGood || traced.quality < kLeastQuality || !resembles(traced) || !leads_back(traced))
      return SearchOutcome::kFailed;
    traced.quality = std::max(traced.quality, kConfirmedQuality);
    point = traced;
    return SearchOutcome::kFound;
  }

  /// Whether the match explains most of the patch's contrast: a smooth patch fits smooth places anywhere.
  bool resembles(const keyframes::ImmaturePoint& point) const {
    constexpr float kUnexplained = 0.25F, kNoise = 4.0F;  // share; squared grey values; chosen by hand
    const keyframes::RhoLinearization match =
        keyframes::evaluate_rho(lens_, picture_, point.patch, point.rho(), pair_, options_.window.huber);
    const Eigen::Map<const Eigen::Array<float, keyframes::kPatternSize, 1>> grey(point.patch.intensity.data()),
        weight(point.patch.weight.data());
    const float contrast = pair_.gain * pair_.gain * (weight * (grey - grey.mean()).square()).sum();
    return match.state == keyframes::ResidualState::kGood &&
           match.energy < kUnexplained * contrast + kNoise * keyframes::kPatternSize;
  }

  /// Whether the same search from the match in the stereo picture finds the point's pixel again: not so for repeating
  /// texture, for what the other camera does not see, and for chance.
  bool leads_back(const keyframes::ImmaturePoint& point) const {
    constexpr float kNear_px = 1.0F;
    keyframes::WarpedPatch there;
    if (!keyframes::warp_patch(lens_, point.patch, pair_.R, pair_.t, point.rho(), there)) return false;
    const auto patch = keyframes::make_patch(picture_, lens_, there.pixel, options_.window.gradient_weight);
    if (!patch) return false;
    keyframes::ImmaturePoint back;
    back.patch = *patch;
    trace_point(own_lens_, own_, back_, tracing_, options_.window.huber, back);
    Eigen::Vector2f pixel;
    return back.status == Status::kGood &&
           own_lens_.project<float>(back_.R * patch->ray + back.rho() * back_.t, pixel) &&
           (pixel - point.patch.pixel).norm() < kNear_px;
  }

  // Second-best over best energy: below the first a match is not tried; one that leads back counts as unambiguous for
  // activation (TracingOptions::min_quality). Chosen by hand.
  static constexpr float kLeastQuality = 1.2F, kConfirmedQuality = 4.0F;

  const keyframes::Lens& own_lens_;
  const keyframes::Lens& lens_;
  const keyframes::PyramidLevel& own_;
  const keyframes::PyramidLevel& picture_;
  keyframes::PairTransform pair_, back_;
  const keyframes::OdometryOptions& options_;
  keyframes::TracingOptions tracing_;
};

double mean_grey(const keyframes::PyramidLevel& picture) {
  constexpr int kStride = 4;
  double sum = 0.0;
  int count = 0;
  for (int y = 0; y < picture.height; y += kStride) {
    for (int x = 0; x < picture.width; x += kStride, ++count) sum += picture.intensity(x, y);
  }
  return sum / std::max(count, 1);
}

/// Search in the picture of one camera, with the brightness that gives more matches.
SearchedPoints trace_in_camera(const keyframes::Lens& own_lens, const keyframes::Window& window,
                               const keyframes::OdometryOptions& options, std::size_t camera,
                               keyframes::Keyframe& keyframe) {
  keyframes::StereoPicture& picture = keyframe.stereo[camera];
  const auto traced = [&] { return StereoSearch(own_lens, window, keyframe, camera, options)(keyframe.immature); };
  SearchedPoints first = traced();
  if (is_matched(first.matches, kWellMatched)) return first;
  const double own = mean_grey(keyframe.pyramid->levels[0]), other = mean_grey(picture.pyramid->levels[0]);
  if (!(own > 0.0) || !(other > 0.0)) return first;
  const keyframes::AffineBrightness before = picture.brightness_linear;
  picture.brightness_linear = {std::log(other / own), 0.0};
  SearchedPoints second = traced();
  if (second.matches.found > first.matches.found) return second;
  picture.brightness_linear = before;
  return first;
}

bool has_stereo_depth(const keyframes::ImmaturePoint& point) {
  constexpr float kLargestShare = 0.25F;  // half interval over the inverse distance; chosen by hand
  return point.has_depth() && point.rho() > 0.0F &&
         0.5F * (point.rho_max - point.rho_min) <= kLargestShare * point.rho();
}

}  // namespace

std::vector<StereoMatches> trace_stereo(const keyframes::Window& window, const keyframes::Lens& lens,
                                        const keyframes::OdometryOptions& options, keyframes::Keyframe& keyframe) {
  constexpr int kFewest = 20;  // searched points on which a judgement of the picture rests
  std::vector<StereoMatches> matches(keyframe.stereo.size());
  for (std::size_t c = 0; c < keyframe.stereo.size(); ++c) {
    if (!keyframe.stereo[c].pyramid) continue;
    SearchedPoints found = trace_in_camera(lens, window, options, c, keyframe);
    matches[c] = found.matches;
    if (found.matches.searched >= kFewest && !is_matched(found.matches, kLeastMatched)) {
      keyframe.stereo[c].pyramid.reset();
      continue;
    }
    keyframe.immature = std::move(found.points);
  }
  return matches;
}

int start_from_stereo(keyframes::Window& window, const keyframes::Lens& lens,
                      const keyframes::OdometryOptions& options) {
  constexpr int kIterations = 8, kRounds = 2, kFewest = 50;  // the last in the header
  keyframes::Keyframe& keyframe = window.keyframes.at(0);
  std::vector<std::optional<keyframes::ActivePoint>> points(keyframe.immature.size());
  tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t i) {
    if (has_stereo_depth(keyframe.immature[i]))
      points[i] = try_activation(window, lens, 0, keyframe.immature[i], options.window, 1);
  });
  std::vector<keyframes::ImmaturePoint> waiting;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i])
      keyframe.points.push_back(std::move(*points[i]));
    else
      waiting.push_back(keyframe.immature[i]);
  }
  for (int round = 0; round < kRounds; ++round) {
    optimize_window(window, lens, options.window, kIterations);
    relinearize(window, 0);
  }
  remove_bad_residuals(window);
  std::erase_if(keyframe.points, [](const keyframes::ActivePoint& point) {
    return point.stereo_observations.empty() || !(point.rho > 0.0F);
  });
  if (static_cast<int>(keyframe.points.size()) < kFewest) {
    keyframe.points.clear();
    return 0;
  }
  keyframe.activated_points = static_cast<std::int64_t>(keyframe.points.size());
  keyframe.immature = std::move(waiting);
  return static_cast<int>(keyframe.points.size());
}

}  // namespace tileflight::mapping
