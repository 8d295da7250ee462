#include "tileflight/odometry/initializer.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tileflight::odometry {
namespace {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;

bool same_solution(const StartBundle& a, const StartBundle& b) {
  constexpr double kDirection_rad = 0.1, kRotation_rad = 0.02;
  const SE3& x = a.T_camera_first.back();
  const SE3& y = b.T_camera_first.back();
  const double direction = std::acos(std::clamp(x.translation.normalized().dot(y.translation.normalized()), -1.0, 1.0));
  return direction < kDirection_rad && geometry::so3_log(x.rotation.conjugate() * y.rotation).norm() < kRotation_rad;
}

}  // namespace

void Initializer::restart(std::shared_ptr<const Pyramid> pyramid) {
  corners_.clear();
  parallax_.assign(1, 0.0);
  T_world_first_ = T_world_last_;
  last_try_parallax_ = 0.0;
  first_ = count_ - 1;
  for (const Eigen::Vector2f& p : find_corners(*pyramid, lens_.rays[0], options_.corners)) {
    const auto ray = lens_.lenses[0].unproject(p.cast<double>());
    if (ray) corners_.push_back({p, *ray, {}});
  }
  previous_ = std::move(pyramid);
}

int Initializer::follow(const Pyramid& pyramid) {
  std::vector<Eigen::Vector2f> from;
  std::vector<Corner*> alive;
  for (Corner& corner : corners_) {
    const bool seen = corner.pixels.empty() || corner.pixels.back();
    if (seen) {
      from.push_back(corner.pixels.empty() ? corner.first : *corner.pixels.back());
      alive.push_back(&corner);
    } else {
      corner.pixels.emplace_back();
    }
  }
  const auto tracked = track_corners(*previous_, pyramid, from);
  int count = 0;
  for (std::size_t i = 0; i < alive.size(); ++i) {
    alive[i]->pixels.push_back(tracked[i]);
    count += tracked[i].has_value();
  }
  return count;
}

std::vector<RayPair> Initializer::pairs_to(std::size_t picture) const {
  std::vector<RayPair> pairs;
  for (const Corner& corner : corners_) {
    const auto& pixel = corner.pixels[picture - 1];
    const auto ray = pixel ? lens_.lenses[0].unproject(pixel->cast<double>()) : std::nullopt;
    if (ray) pairs.push_back({corner.ray, *ray});
  }
  return pairs;
}

std::vector<std::size_t> Initializer::bundle_pictures() const {
  const std::size_t last = parallax_.size() - 1;
  const std::size_t wanted = std::min<std::size_t>(last, options_.bundle_frames);
  std::vector<std::size_t> pictures;
  for (std::size_t i = 1; i <= wanted; ++i) pictures.push_back(i * last / wanted);
  return pictures;
}

std::vector<CornerTrack> Initializer::tracks_in(const std::vector<std::size_t>& pictures,
                                                std::vector<std::size_t>& corner_of_track) const {
  std::vector<CornerTrack> tracks;
  for (std::size_t c = 0; c < corners_.size(); ++c) {
    if (!corners_[c].pixels[pictures.back() - 1]) continue;
    CornerTrack track{corners_[c].ray, {}};
    for (const std::size_t k : pictures) {
      const auto& pixel = corners_[c].pixels[k - 1];
      track.pixels.push_back(pixel ? std::optional<Vec2>(pixel->cast<double>()) : std::nullopt);
    }
    tracks.push_back(std::move(track));
    corner_of_track.push_back(c);
  }
  return tracks;
}

std::optional<Start> Initializer::add(std::shared_ptr<const Pyramid> pyramid,
                                      const std::optional<SE3>& T_world_camera) {
  constexpr double kGrowth = 1.15;        // parallax by which the next try must be wider
  constexpr double kMinShareLeft = 0.25;  // of the corners
  ++count_;
  T_world_last_ = T_world_camera;
  if (!previous_) {
    restart(std::move(pyramid));
    return std::nullopt;
  }
  const int followed = follow(*pyramid);
  const bool too_few =
      followed < options_.min_tracks || followed < kMinShareLeft * static_cast<double>(corners_.size());
  const bool too_long = parallax_.size() >= static_cast<std::size_t>(options_.max_frames);
  if (too_few || too_long) {
    restart(std::move(pyramid));
    return std::nullopt;
  }
  previous_ = std::move(pyramid);
  parallax_.push_back(fit_rotation(pairs_to(parallax_.size())).median_rad);
  widest_parallax_ = std::max(widest_parallax_, parallax_.back());
  constexpr std::size_t kMinPictures = 3;
  // Before the tracks are lost: level ground seen straight from above hides most of its parallax in the rotation.
  const bool running_out = followed < 2 * options_.min_tracks ||
                           followed < 2.0 * kMinShareLeft * static_cast<double>(corners_.size()) ||
                           2 * parallax_.size() > static_cast<std::size_t>(options_.max_frames);
  const double least = running_out ? options_.last_parallax_rad : options_.min_parallax_rad;
  if (parallax_.size() < kMinPictures || parallax_.back() < std::max(least, kGrowth * last_try_parallax_))
    return std::nullopt;
  last_try_parallax_ = parallax_.back();
  return try_start();
}

std::vector<SE3> Initializer::motions(std::size_t picture) const {
  constexpr double kThreshold_px = 1.5;
  if (T_world_first_ && T_world_last_) {
    const SE3 T_last_first = T_world_last_->inverse() * *T_world_first_;
    const double baseline = T_last_first.translation.norm();
    if (baseline > 0) return {SE3(T_last_first.rotation, T_last_first.translation / baseline)};
  }
  return relative_pose_candidates(pairs_to(picture), kThreshold_px / lens_.lenses[0].focal_px(), options_.seed);
}

std::optional<Start> Initializer::try_start() {
  constexpr int kIterations = 30;
  constexpr double kMaxBehindShare = 0.1;
  const Lens& lens = lens_.lenses[0];
  const std::size_t last = parallax_.size() - 1;
  const std::vector<SE3> candidates = motions(last);
  const std::vector<std::size_t> pictures = bundle_pictures();
  std::vector<std::size_t> corner_of_track;
  const std::vector<CornerTrack> tracks = tracks_in(pictures, corner_of_track);
  std::vector<StartBundle> all(candidates.size());
  tbb::parallel_for(std::size_t{0}, candidates.size(), [&](std::size_t i) {
    all[i] = adjust_start(lens, tracks, pictures.size(), candidates[i], kIterations);
  });
  std::stable_sort(all.begin(), all.end(), [](const StartBundle& a, const StartBundle& b) { return a.cost < b.cost; });
  std::erase_if(all, [&](const StartBundle& b) { return b.behind_share > kMaxBehindShare; });
  if (all.empty()) return std::nullopt;
  const StartBundle& best = all.front();
  last_fit_px_ = best.median_residual_px;
  if (best.median_residual_px > options_.max_median_residual_px) return std::nullopt;
  double ratio = 0.0;
  for (std::size_t i = 1; i < all.size() && ratio == 0.0; ++i) {
    if (!same_solution(best, all[i])) ratio = best.cost / all[i].cost;
  }
  if (ratio > options_.max_cost_ratio && parallax_.back() < options_.enough_parallax_rad) return std::nullopt;
  Start start = complete(best, pictures, corner_of_track);
  start.cost_ratio = ratio;
  return start;
}

Start Initializer::complete(const StartBundle& bundle, const std::vector<std::size_t>& pictures,
                            const std::vector<std::size_t>& corner_of_track) const {
  Start start;
  start.first = first_;
  start.parallax_rad = parallax_;
  start.median_residual_px = bundle.median_residual_px;
  start.T_camera_first.assign(parallax_.size(), SE3());
  std::vector<std::size_t> every;
  for (std::size_t k = 1; k < parallax_.size(); ++k) every.push_back(k);
  std::vector<std::size_t> same;
  const std::vector<CornerTrack> tracks = tracks_in(every, same);
  for (std::size_t k = 1; k < parallax_.size(); ++k) {
    const auto exact = std::find(pictures.begin(), pictures.end(), k);
    start.T_camera_first[k] = exact != pictures.end()
                                  ? bundle.T_camera_first[exact - pictures.begin()]
                                  : resect(lens_.lenses[0], tracks, bundle.rho, k - 1, start.T_camera_first[k - 1]);
  }
  for (std::size_t i = 0; i < corner_of_track.size(); ++i) {
    if (bundle.rho[i] <= 0) continue;
    start.pixels.push_back(corners_[corner_of_track[i]].first);
    start.rho.push_back(static_cast<float>(bundle.rho[i]));
  }
  return start;
}

std::string Initializer::reason() const {
  const double degrees = widest_parallax_ * 180.0 / std::numbers::pi;
  const std::string seen = std::to_string(degrees).substr(0, 4) + " degrees";
  if (widest_parallax_ < options_.min_parallax_rad)
    return "no parallax: rays moved by " + seen + " at most after the best rotation";
  return "no start found: parallax of " + seen + ", but no motion of a rigid scene fits the tracks (last fit " +
         std::to_string(last_fit_px_).substr(0, 4) + " px)";
}

}  // namespace tileflight::odometry
