#include "tileflight/evaluation/registration/repeating_textures.h"

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
    if (!best_closely || !there || there->inliers < there->tried) continue;
    const double apart_m = alignment::rms_motion_m(here_closely, end_closely, spread);
    if (apart_m > least_apart_m && there->correlation > best_closely->correlation - kEqual) return apart_m;
  }
  return std::nullopt;
}

}  // namespace tileflight::registration
