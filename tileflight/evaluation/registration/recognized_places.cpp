#include "tileflight/evaluation/registration/recognized_places.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "tileflight/core/alignment/similarity_chart.h"

namespace tileflight::registration {

using geometry::Sim3;
using geometry::Vec3;

std::optional<double> find_repetition(const StartRefiner& follower, const alignment::PointSpread& spread, Sim3& T) {
  constexpr std::size_t kPictures = 4;
  constexpr int kDirections = 8;
  constexpr double kBetter = 0.02, kEqual = 0.01, kLeastApart_m = 0.05;
  constexpr double kResolved = 0.01;  // share of the viewing distance, a few pixels; shorter repetitions are not
                                      // detected
  const auto here = follower.check_pictures(T, kPictures);
  if (!here) return std::nullopt;
  const double least_apart_m = std::max(kLeastApart_m, kResolved * follower.viewing_distance_m(T));
  double best = here->correlation;
  std::vector<std::pair<double, Sim3>> ends;
  for (const double share : {0.02, 0.04, 0.08}) {  // shifts, as shares of the viewing distance
    for (int k = 0; k < kDirections; ++k) {
      const double angle = 2.0 * std::numbers::pi * k / kDirections;
      const double step_m = share * follower.viewing_distance_m(T);
      Sim3 aside = T;
      aside.translation += step_m * Vec3(std::cos(angle), std::sin(angle), 0.0);
      const auto there = follower.check_pictures(aside, kPictures);
      if (there && there->inliers == there->tried) ends.emplace_back(there->correlation, aside);
    }
  }
  const Sim3 begun = T;
  for (const auto& [correlation, end] : ends) {
    if (correlation > best + kBetter || (T.matrix() != begun.matrix() && correlation > best))
      best = correlation, T = end;
  }
  // Coarse images converge to slightly different poses anyway, so a possible other placement is checked at full
  // accuracy.
  Sim3 here_closely = T;
  std::optional<PictureAgreement> best_closely;
  for (const auto& [correlation, end] : ends) {
    if (alignment::rms_motion_m(T, end, spread) < least_apart_m || correlation < best - kEqual) continue;
    if (!best_closely) best_closely = follower.check_pictures(here_closely, kPictures, PictureDetail::kFine);
    Sim3 end_closely = end;
    const auto there = follower.check_pictures(end_closely, kPictures, PictureDetail::kFine);
    constexpr double kNearlyAll = 0.9;
    if (!best_closely || !there || static_cast<double>(there->inliers) < kNearlyAll * static_cast<double>(there->tried))
      continue;
    const double apart_m = alignment::rms_motion_m(here_closely, end_closely, spread);
    if (apart_m > least_apart_m && there->correlation > best_closely->correlation - kEqual) return apart_m;
  }
  return std::nullopt;
}

using geometry::Sim3;

namespace {

/// In images: those that agree, each with the share of its grey values' variance that the place explains. At a similar
/// place as many may be located as at the right one, but they look less alike.
double explained_images(const PictureAgreement& pictures) {
  return static_cast<double>(pictures.inliers) * pictures.correlation * std::abs(pictures.correlation);
}

/// The recognised candidates at places of their own, nearly as good as the first by the few images compared so far: at
/// most `most`, the first one included.
std::vector<Candidate> rivals_of_first(const std::vector<Candidate>& candidates, const alignment::PointSpread& spread,
                                       std::size_t most) {
  constexpr double kByChance = 0.6;  // few images, which may be located or not, and not at their best
  std::vector<Candidate> apart;
  for (const Candidate& candidate : candidates) {
    if (!candidate.is_recognised() || apart.size() >= most) break;
    if (!apart.empty() && explained_images(*candidate.pictures) < kByChance * explained_images(*apart.front().pictures))
      break;
    const auto is_same = [&](const Candidate& other) {
      return alignment::rms_motion_m(other.T, candidate.T, spread) < same_place_m(other.T, spread);
    };
    if (std::ranges::none_of(apart, is_same)) apart.push_back(candidate);
  }
  return apart;
}

/// Whether the images of `other` speak nearly as much for it as those of `best` for that.
bool fits_as_well(const PictureAgreement& other, const PictureAgreement& best) {
  constexpr double kShare = 0.9, kCorrelation = 0.05;  // of the images; chosen by hand
  return static_cast<double>(other.inliers) >= kShare * static_cast<double>(best.inliers) &&
         other.correlation > best.correlation - kCorrelation;
}

}  // namespace

bool is_better(const Candidate& a, const Candidate& b) {
  if (a.is_recognised() != b.is_recognised()) return a.is_recognised();
  if (!a.is_recognised()) return a.ray_score() > b.ray_score();
  return explained_images(*a.pictures) > explained_images(*b.pictures);
}

double same_place_m(const Sim3& T, const alignment::PointSpread& spread) {
  constexpr double kShare = 0.02, kLeast_m = 0.5;
  const geometry::Mat3 about_mean = spread.second_moment - spread.mean * spread.mean.transpose();
  return std::max(kLeast_m, kShare * T.scale * std::sqrt(about_mean.trace()));
}

std::optional<double> find_similar_place(std::vector<Candidate>& candidates, const StartRefiner& refiner,
                                         std::size_t pictures, const alignment::PointSpread& spread) {
  constexpr std::size_t kMostCompared = 4;
  std::vector<Candidate> rivals = rivals_of_first(candidates, spread, kMostCompared);
  if (rivals.size() < 2) return std::nullopt;
  for (Candidate& rival : rivals) rival.pictures = refiner.check_pictures(rival.T, pictures, PictureDetail::kFine);
  std::ranges::stable_sort(rivals, is_better);
  if (!rivals.front().is_recognised()) return std::nullopt;
  std::optional<double> nearest_m;
  for (std::size_t k = 1; k < rivals.size(); ++k) {
    if (!rivals[k].is_recognised() || !fits_as_well(*rivals[k].pictures, *rivals.front().pictures)) continue;
    const double apart_m = alignment::rms_motion_m(rivals.front().T, rivals[k].T, spread);
    if (apart_m < same_place_m(rivals.front().T, spread)) continue;
    nearest_m = std::min(apart_m, nearest_m.value_or(apart_m));
  }
  candidates.insert(candidates.begin(), rivals.front());
  return nearest_m;
}

}  // namespace tileflight::registration
