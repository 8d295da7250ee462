#include "tileflight/experiments/report/frame_pairs.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tileflight::report {
namespace {

/// Distance equivalent to a rotation of one degree when pairs are ranked.
constexpr double kMetresPerDegree = 0.5;
/// Maximum number of frames per flight that are considered.
constexpr std::size_t kMaxCandidates = 400;
/// Cameras with a larger angle between them do not show the same.
constexpr double kMaxAngle_deg = 60.0;

struct PosedFrame {
  FrameFile file;
  geometry::SE3 T_local_camera;
};

std::vector<PosedFrame> posed(const FlightRun& flight) {
  std::vector<PosedFrame> result;
  for (const FrameFile& frame : flight.frames) {
    std::optional<geometry::SE3> pose;
    if (flight.estimate) pose = geometry::interpolate(*flight.estimate, frame.time_s);
    if (!flight.estimate && flight.truth) pose = geometry::interpolate(*flight.truth, frame.time_s);
    if (pose) result.push_back({frame, *pose});
  }
  return result;
}

std::vector<PosedFrame> subsample(const std::vector<PosedFrame>& frames) {
  const std::size_t step = frames.size() / kMaxCandidates + 1;
  std::vector<PosedFrame> result;
  for (std::size_t i = 0; i < frames.size(); i += step) result.push_back(frames[i]);
  return result;
}

/// A pair as indices into both lists.
struct Candidate {
  std::size_t i, j;
  double distance_m, angle_deg;

  double pose_distance() const { return distance_m + kMetresPerDegree * angle_deg; }
};

Candidate candidate(const std::vector<PosedFrame>& first, std::size_t i, const std::vector<PosedFrame>& second,
                    std::size_t j) {
  const geometry::SE3 &a = first[i].T_local_camera, &b = second[j].T_local_camera;
  return {i, j, (a.translation - b.translation).norm(),
          a.rotation.angularDistance(b.rotation) * 180 / std::numbers::pi};
}

/// All pairs with similar viewing directions, the most similar first.
std::vector<Candidate> candidates(const std::vector<PosedFrame>& first, const std::vector<PosedFrame>& second) {
  std::vector<Candidate> result;
  for (std::size_t i = 0; i < first.size(); ++i) {
    for (std::size_t j = 0; j < second.size(); ++j) {
      const Candidate pair = candidate(first, i, second, j);
      if (pair.angle_deg <= kMaxAngle_deg) result.push_back(pair);
    }
  }
  std::stable_sort(result.begin(), result.end(),
                   [](const Candidate& a, const Candidate& b) { return a.pose_distance() < b.pose_distance(); });
  return result;
}

/// Greedily selects the most similar pairs, each at least a sixth of the wanted spacing away from those selected, in
/// both flights.
std::vector<FramePair> pick_most_similar(const std::vector<PosedFrame>& first, const std::vector<PosedFrame>& second,
                                         std::size_t count) {
  const auto apart = [count](std::size_t a, std::size_t b, std::size_t size) {
    return std::max(a, b) - std::min(a, b) >= std::max<std::size_t>(1, size / (6 * count));
  };
  std::vector<Candidate> taken;
  for (const Candidate& next : candidates(first, second)) {
    if (taken.size() == count) break;
    const bool is_new = std::all_of(taken.begin(), taken.end(), [&](const Candidate& other) {
      return apart(next.i, other.i, first.size()) && apart(next.j, other.j, second.size());
    });
    if (is_new) taken.push_back(next);
  }
  std::sort(taken.begin(), taken.end(), [](const Candidate& a, const Candidate& b) { return a.i < b.i; });
  std::vector<FramePair> pairs;
  for (const Candidate& c : taken) pairs.push_back({first[c.i].file, second[c.j].file, c.distance_m, c.angle_deg});
  return pairs;
}

}  // namespace

std::vector<FrameFile> pick_evenly(const std::vector<FrameFile>& frames, std::size_t count) {
  std::vector<FrameFile> result;
  for (std::size_t i = 0; i < std::min(count, frames.size()); ++i) {
    result.push_back(frames[(2 * i + 1) * frames.size() / (2 * std::min(count, frames.size()))]);
  }
  return result;
}

std::vector<FramePair> frame_pairs(const FlightRun& first, const FlightRun& second, std::size_t count) {
  std::vector<FramePair> pairs = pick_most_similar(subsample(posed(first)), subsample(posed(second)), count);
  if (!pairs.empty()) return pairs;
  const std::vector<FrameFile> left = pick_evenly(first.frames, count), right = pick_evenly(second.frames, count);
  for (std::size_t i = 0; i < std::min(left.size(), right.size()); ++i) pairs.push_back({left[i], right[i], {}, {}});
  return pairs;
}

}  // namespace tileflight::report
