#include "tileflight/odometry/tracking_doubts.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace tileflight::odometry {
namespace {

constexpr const char* kWhere = "odometry";
using NameOf = std::function<std::string(std::int64_t)>;

std::string percent(double share) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2g %%", 100.0 * share);
  return text;
}

std::string count(std::int64_t number) { return std::to_string(number); }

/// "frame 000012" or "frames 000012 to 000019".
std::string frames_text(const FrameQuality& first, const FrameQuality& last, const NameOf& name_of) {
  const std::string from = name_of(first.frame), to = name_of(last.frame);
  return from == to ? "frame " + from : "frames " + from + " to " + to;
}

void doubt_end(const OdometryResult& result, std::int64_t frames, const DoubtLimits& limits, Doubts& doubts) {
  const std::string share = count(result.frames_tracked) + " of " + count(frames) + " frames have a pose";
  if (result.lost) {
    doubts.push_back({"the flight was not tracked to its end (" + share + "): " + result.lost_reason, kWhere, "certain",
                      "use the part that was tracked, or a flight that stays trackable"});
  } else if (static_cast<double>(result.frames_tracked) < limits.least_tracked_share * static_cast<double>(frames)) {
    doubts.push_back({share, kWhere, "certain",
                      "look at the frames without one in quality.csv; choose another stretch of the flight"});
  }
}

void doubt_length(const OdometryResult& result, const DoubtLimits& limits, Doubts& doubts) {
  if (result.frames_tracked >= limits.least_pictures) return;
  doubts.push_back({"only " + count(result.frames_tracked) + " frames have a pose: too few to tell a good track",
                    kWhere, "likely", "take a longer stretch of the flight"});
}

/// The longest run of pictures that fit badly.
void doubt_fit(const OdometryResult& result, const NameOf& name_of, const DoubtLimits& limits, Doubts& doubts) {
  const FrameQuality *first = nullptr, *last = nullptr;
  int bad = 0;
  double worst = 0.0;
  for (const FrameQuality& q : result.quality) {
    if (!q.tracked || q.saturated_share <= limits.saturated_share) continue;
    if (first == nullptr) first = &q;
    last = &q;
    ++bad;
    worst = std::max(worst, q.saturated_share);
  }
  if (bad == 0) return;
  doubts.push_back({"tracking fits badly in " + count(bad) + " frames: up to " + percent(worst) +
                        " of the points look different from their keyframe",
                    std::string(kWhere) + ", " + frames_text(*first, *last, name_of), "likely",
                    "look at these frames (blur, something before the lens, a turn in place); leave them out"});
}

void doubt_scale(const OdometryResult& result, const NameOf& name_of, const DoubtLimits& limits, Doubts& doubts) {
  const auto beyond = [&](const FrameQuality& q) { return q.tracked && q.sigma_log_scale > limits.sigma_log_scale; };
  const auto first = std::find_if(result.quality.begin(), result.quality.end(), beyond);
  if (first == result.quality.end()) return;
  double end = 0.0;
  for (const FrameQuality& q : result.quality) end = std::max(end, q.sigma_log_scale);
  doubts.push_back({"the scale may have changed: it was carried on by few points or without parallax (at least " +
                        percent(end) + " by the residuals alone)",
                    std::string(kWhere) + ", from " + frames_text(*first, *first, name_of) + " on", "likely",
                    "fly on while turning, or use the part before alone"});
}

/// Velocities that last for one picture only, over the speed that the flight seldom exceeds.
void doubt_jumps(const OdometryResult& result, const NameOf& name_of, const DoubtLimits& limits, Doubts& doubts) {
  const auto& poses = result.trajectory.poses;
  if (poses.size() < 4) return;
  std::vector<geometry::Vec3> velocity;
  std::vector<double> speed;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    velocity.push_back((poses[i].T_local_camera.translation - poses[i - 1].T_local_camera.translation) /
                       (poses[i].time_s - poses[i - 1].time_s));
    speed.push_back(velocity.back().norm());
  }
  std::vector<double> sorted = speed;
  std::sort(sorted.begin(), sorted.end());
  const double usual = sorted[(sorted.size() - 1) * 95 / 100];
  // Away and back, or a step to the side: into one velocity and out of it. A change of speed alone is none.
  const auto changes = [&](std::size_t i) {
    return std::min((velocity[i] - velocity[i - 1]).norm(), (velocity[i + 1] - velocity[i]).norm());
  };
  std::size_t worst = 1;
  for (std::size_t i = 1; i + 1 < velocity.size(); ++i) {
    if (changes(i) > changes(worst)) worst = i;
  }
  const double change = changes(worst);
  if (!(change > limits.velocity_change * usual)) return;
  const auto at = std::find_if(result.quality.begin(), result.quality.end(),
                               [&](const FrameQuality& q) { return q.time_s == poses[worst + 1].time_s; });
  char times[32];
  std::snprintf(times, sizeof times, "%.2g", usual > 0 ? change / usual : 0.0);
  doubts.push_back({"the camera jumps: its velocity changes by " + std::string(times) +
                        " times its usual speed from one frame to the next",
                    at == result.quality.end() ? kWhere : std::string(kWhere) + ", " + frames_text(*at, *at, name_of),
                    "likely",
                    "look at the frames around it (something before the lens, missing pictures); leave them out"});
}

/// What residuals have in common, wherever the camera is: its lens, its shutter, or a false start.
void doubt_calibration(const OdometryResult& result, const DoubtLimits& limits, Doubts& doubts) {
  if (!result.pattern || result.pattern->rms_px <= limits.pattern_px || result.pattern->sigmas <= limits.pattern_sigmas)
    return;
  char text[32];
  std::snprintf(text, sizeof text, "%.2g", result.pattern->rms_px);
  doubts.push_back(
      {"the calibration does not fit the pictures: residuals have a pattern of " + std::string(text) +
           " pixels (RMS) that is the same in all keyframes (another lens or line delay, or a false start)",
       kWhere, result.pattern->rms_px > limits.pattern_likely_px ? "likely" : "possible",
       "calibrate this camera as it was flown (focus, resolution, crop, rolling shutter)"});
}

void doubt_second(const OdometryResult& result, const std::optional<Agreement>& second, const NameOf& name_of,
                  const DoubtLimits& limits, Doubts& doubts) {
  if (!second || second->rms_share <= limits.disagreement) return;
  const auto at =
      std::min_element(result.quality.begin(), result.quality.end(), [&](const FrameQuality& a, const FrameQuality& b) {
        return std::abs(a.time_s - second->worst_time_s) < std::abs(b.time_s - second->worst_time_s);
      });
  doubts.push_back(
      {"forwards and backwards the flight is tracked differently: paths differ by " + percent(second->rms_share) +
           " of their length (a wrong start, or a scale that changed)",
       at == result.quality.end() ? kWhere : std::string(kWhere) + ", most at " + frames_text(*at, *at, name_of),
       "likely", "track parts of the flight by themselves (--from, --to) and compare them"});
}

}  // namespace

Doubts doubts_of(const OdometryResult& result, std::int64_t frames, const NameOf& name_of,
                 const std::optional<Agreement>& second, const DoubtLimits& limits) {
  Doubts doubts;
  doubt_end(result, frames, limits, doubts);
  if (result.frames_tracked == 0) return doubts;
  doubt_length(result, limits, doubts);
  doubt_second(result, second, name_of, limits, doubts);
  doubt_fit(result, name_of, limits, doubts);
  doubt_scale(result, name_of, limits, doubts);
  doubt_jumps(result, name_of, limits, doubts);
  doubt_calibration(result, limits, doubts);
  return doubts;
}

namespace {

double median_rmse(const OdometryResult& result) {
  std::vector<double> rmse;
  for (const FrameQuality& q : result.quality) {
    if (q.tracked && q.rmse > 0.0) rmse.push_back(q.rmse);
  }
  if (rmse.empty()) return 0.0;
  std::nth_element(rmse.begin(), rmse.begin() + static_cast<std::ptrdiff_t>(rmse.size() / 2), rmse.end());
  return rmse[rmse.size() / 2];
}

/// The first is free of doubts, the second not, and the first fits better.
bool clearly_better(const OdometryResult& a, const OdometryResult& b, const DoubtLimits& limits) {
  constexpr double kBetter = 0.9;  // of the other's residuals
  const auto has_doubts = [&](const OdometryResult& result) {
    const auto no_name = [](std::int64_t) { return std::string(); };
    return !doubts_of(result, result.frames, no_name, {}, limits).empty();
  };
  return !has_doubts(a) && has_doubts(b) && median_rmse(a) < kBetter * median_rmse(b);
}

}  // namespace

Belief belief(const OdometryResult& first, const OdometryResult& second, const std::optional<Agreement>& agreement,
              const DoubtLimits& limits) {
  constexpr double kFarFewer = 0.8, kAsMany = 0.95;
  const auto poses = [](const OdometryResult& result) { return static_cast<double>(result.frames_tracked); };
  if (poses(first) < kFarFewer * poses(second)) return Belief::kSecond;
  if (poses(second) < kAsMany * poses(first)) return Belief::kFirst;
  if (!agreement || agreement->rms_share <= limits.disagreement) return Belief::kFirst;
  if (clearly_better(first, second, limits)) return Belief::kFirst;
  return clearly_better(second, first, limits) ? Belief::kSecond : Belief::kOpen;
}

}  // namespace tileflight::odometry
