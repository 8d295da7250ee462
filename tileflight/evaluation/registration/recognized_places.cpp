#include "tileflight/evaluation/registration/recognized_places.h"

#include <algorithm>
#include <cmath>

namespace tileflight::registration {

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
