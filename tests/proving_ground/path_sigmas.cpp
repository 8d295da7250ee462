#include "path_sigmas.h"

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>

#include "tileflight/core/alignment/umeyama.h"
#include "tileflight/core/base/files.h"
#include "tileflight/slam/odometry/track_result.h"

namespace tileflight::proving_ground {
namespace {

namespace fs = std::filesystem;

/// A picture's pose and its true one.
struct PosePair {
  double time_s = 0.0;
  geometry::SE3 estimate, truth;
};

std::vector<PosePair> pose_pairs(const geometry::Trajectory& estimate, const geometry::Trajectory& truth) {
  std::vector<PosePair> pairs;
  for (const auto& [e, t] : geometry::associate(estimate, truth))
    pairs.push_back({estimate.poses[e].time_s, estimate.poses[e].T_local_camera, truth.poses[t].T_local_camera});
  return pairs;
}

double scale_of(const std::vector<PosePair>& pairs) {
  std::vector<geometry::Vec3> estimate, truth;
  for (const PosePair& pair : pairs) {
    estimate.push_back(pair.estimate.translation);
    truth.push_back(pair.truth.translation);
  }
  return alignment::umeyama(estimate, truth, alignment::ScaleMode::kEstimated).T_target_source.scale;
}

/// Sums of squared errors over the stated sigmas of steps from keyframes.
struct SquaredSigmas {
  explicit SquaredSigmas(const std::vector<PosePair>& of) : pairs(of), scale(scale_of(of)) {}

  const std::vector<PosePair>& pairs;
  double scale;
  double position = 0.0, rotation = 0.0;
  int counted = 0;

  /// Each picture rests on the keyframe before it in `pictures`.
  void add(const std::vector<tracking::FrameQuality>& pictures) {
    constexpr double kSameTime_s = 1e-5;
    const PosePair* reference = nullptr;
    for (const tracking::FrameQuality& picture : pictures) {
      const auto pair = std::ranges::find_if(
          pairs, [&](const PosePair& p) { return std::abs(p.time_s - picture.time_s) < kSameTime_s; });
      if (!picture.tracked || pair == pairs.end()) continue;
      if (reference && picture.sigma_position > 0.0 && picture.sigma_rotation_rad > 0.0) {
        const geometry::SE3 stated = reference->estimate.inverse() * pair->estimate;
        const geometry::SE3 real = reference->truth.inverse() * pair->truth;
        const double off = (stated.translation - real.translation / scale).norm() / picture.sigma_position;
        const double turned = stated.rotation.angularDistance(real.rotation) / picture.sigma_rotation_rad;
        position += off * off;
        rotation += turned * turned;
        ++counted;
      }
      if (picture.is_keyframe) reference = &*pair;
    }
  }
};

}  // namespace

std::optional<PathSigmas> path_sigmas(const fs::path& odometry, const geometry::Trajectory& truth) {
  constexpr int kFewest = 10;
  const std::vector<PosePair> pairs = pose_pairs(geometry::read_tum(odometry / "trajectory.txt"), truth);
  if (pairs.size() < 3) return std::nullopt;
  std::vector<tracking::FrameQuality> pictures = odometry::read_quality_csv(odometry / "quality.csv");
  const auto state = nlohmann::json::parse(base::read_text(odometry / "odometry.json"));
  if (!state.contains("dispersion") || state["dispersion"].is_null()) return std::nullopt;
  // A flight that was tracked backwards has its keyframes after the pictures that rest on them.
  if (state.value("backwards", false)) std::ranges::reverse(pictures);
  // Those before the start rest on the keyframe after them.
  const auto start =
      pictures.begin() + std::min<std::ptrdiff_t>(std::ssize(pictures), state.value("frames_before_start", 0));
  const auto from_start =
      std::find_if(start, pictures.end(), [](const tracking::FrameQuality& p) { return p.is_keyframe; });
  std::vector<tracking::FrameQuality> before(std::make_reverse_iterator(start), pictures.rend());
  if (from_start != pictures.end()) before.insert(before.begin(), *from_start);
  SquaredSigmas sum(pairs);
  sum.add(before);
  sum.add({start, pictures.end()});
  if (sum.counted < kFewest) return std::nullopt;
  return PathSigmas{sum.position / sum.counted, sum.rotation / sum.counted};
}

}  // namespace tileflight::proving_ground
