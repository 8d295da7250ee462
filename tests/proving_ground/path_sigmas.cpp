#include "path_sigmas.h"

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>

#include "tileflight/core/alignment/umeyama.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::proving_ground {
namespace {

namespace fs = std::filesystem;

/// A line of quality.csv.
struct PictureQuality {
  double time_s = 0.0, sigma_position = 0.0, sigma_rotation_rad = 0.0;
  bool tracked = false, keyframe = false;
};

std::vector<PictureQuality> read_quality(const fs::path& file) {
  const std::string all = base::read_text(file);
  std::string_view rest = all;
  const std::vector<std::string_view> head = base::split_fields(base::take_line(rest).value_or(""), ",");
  const auto column = [&](std::string_view name) {
    const auto at = std::ranges::find(head, name);
    if (at == head.end()) throw InputError(file.string(), "has no column " + std::string(name));
    return static_cast<std::size_t>(at - head.begin());
  };
  const std::size_t time = column("time_s"), tracked = column("tracked"), keyframe = column("keyframe"),
                    position = column("sigma_position"), rotation = column("sigma_rotation_rad");
  std::vector<PictureQuality> lines;
  while (const auto line = base::take_line(rest)) {
    const std::vector<std::string_view> fields = base::split_fields(*line, ",");
    if (fields.size() != head.size()) throw InputError(file.string(), "a line has another number of columns");
    const auto number = [&](std::size_t k) { return base::parse_number<double>(fields[k]).value_or(0.0); };
    lines.push_back({number(time), number(position), number(rotation), number(tracked) > 0.0, number(keyframe) > 0.0});
  }
  return lines;
}

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
  void add(const std::vector<PictureQuality>& pictures) {
    constexpr double kSameTime_s = 1e-5;
    const PosePair* reference = nullptr;
    for (const PictureQuality& picture : pictures) {
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
      if (picture.keyframe) reference = &*pair;
    }
  }
};

}  // namespace

std::optional<PathSigmas> path_sigmas(const fs::path& odometry, const geometry::Trajectory& truth) {
  constexpr int kFewest = 10;
  const std::vector<PosePair> pairs = pose_pairs(geometry::read_tum(odometry / "trajectory.txt"), truth);
  if (pairs.size() < 3) return std::nullopt;
  std::vector<PictureQuality> pictures = read_quality(odometry / "quality.csv");
  const auto state = nlohmann::json::parse(base::read_text(odometry / "odometry.json"));
  if (!state.contains("dispersion") || state["dispersion"].is_null()) return std::nullopt;
  // A flight that was tracked backwards has its keyframes after the pictures that rest on them.
  if (state.value("backwards", false)) std::ranges::reverse(pictures);
  // Those before the start rest on the keyframe after them.
  const auto start =
      pictures.begin() + std::min<std::ptrdiff_t>(std::ssize(pictures), state.value("frames_before_start", 0));
  const auto from_start = std::find_if(start, pictures.end(), [](const PictureQuality& p) { return p.keyframe; });
  std::vector<PictureQuality> before(std::make_reverse_iterator(start), pictures.rend());
  if (from_start != pictures.end()) before.insert(before.begin(), *from_start);
  SquaredSigmas sum(pairs);
  sum.add(before);
  sum.add({start, pictures.end()});
  if (sum.counted < kFewest) return std::nullopt;
  return PathSigmas{sum.position / sum.counted, sum.rotation / sum.counted};
}

}  // namespace tileflight::proving_ground
