#include "tileflight/evaluation/localization/flight_localizer.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <mutex>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/order_statistics.h"

namespace tileflight::localization {

using geometry::SE3;
using geometry::Sim3;

namespace {

/// Holds where an image was found in the place, and the rendering that it was aligned with.
struct Found {
  LocalizationResult result;
  std::shared_ptr<const RenderedView> view;
};

/// States which share of the other images' correlation an image must reach.
constexpr double kAlike = 0.7;

/// Locates the images one by one, each from where a neighbour was found.
class ImageSearch {
 public:
  ImageSearch(const PictureLocalizer& localizer, const FlightImages& flight, const Sim3& T_local_map,
              const FlightLocalizerOptions& options, const Progress& progress)
      : localizer_(localizer),
        flight_(flight),
        T_local_map_(T_local_map),
        options_(options),
        progress_(progress),
        found_(flight.images.size()) {}

  void run() {
    const std::size_t sections = (found_.size() + options_.section - 1) / options_.section;
    tbb::parallel_for(std::size_t{0}, sections, [this](std::size_t k) { search_section(k); });
    drop_poor_matches();
    // The path may have drifted or broken where a section found nothing: its images are searched again from their
    // neighbours.
    for (std::size_t i = 1; i < found_.size(); ++i) search_from_neighbor(i, i - 1);
    for (std::size_t i = found_.size(); i-- > 1;) search_from_neighbor(i - 1, i);
    drop_poor_matches();
  }

  const std::vector<std::optional<Found>>& found() const { return found_; }
  std::size_t renderings() const { return renderings_; }

  /// Returns the image's pose, carried by the odometry from where another image was found; nullopt where it lost one.
  std::optional<SE3> carried_pose(std::size_t image, std::size_t from) const {
    const auto &to_map = flight_.images[image].T_map_camera, &from_map = flight_.images[from].T_map_camera;
    if (!to_map || !from_map) return std::nullopt;
    SE3 motion = from_map->inverse() * *to_map;
    motion.translation *= T_local_map_.scale;
    return found_[from]->result.T_local_camera * motion;
  }

 private:
  void search_section(std::size_t section) {
    const std::size_t begin = section * options_.section, end = std::min(found_.size(), begin + options_.section);
    for (std::size_t i = begin; i < end; ++i) {
      if (i > begin && found_[i - 1]) {
        found_[i] = search(i, i - 1);
      } else if (flight_.images[i].T_map_camera) {
        found_[i] = search_anew(i, T_local_map_ * *flight_.images[i].T_map_camera);
      }
      report();
    }
  }

  void search_from_neighbor(std::size_t image, std::size_t neighbor) {
    if (!found_[image] && found_[neighbor]) found_[image] = search(image, neighbor);
  }

  std::optional<Found> search(std::size_t image, std::size_t neighbor) {
    const Found& from = *found_[neighbor];
    const SE3 guess = carried_pose(image, neighbor).value_or(from.result.T_local_camera);
    const double motion = localizer_.image_motion(*from.view, from.view->T_local_camera, guess);
    if (!(motion < options_.view_motion)) return search_anew(image, guess);
    const std::optional<imaging::RgbImage> picture = flight_.read(image);
    if (!picture) return std::nullopt;
    const auto result = localizer_.align(*picture, *from.view, guess);
    if (result && result->correlation > kAlike * from.result.correlation) return Found{*result, from.view};
    return search_anew(image, guess);
  }

  /// Renders the place for this image. A guess too poor for the narrow window is refined with the wide one; where the
  /// place shows too few details for the narrow one, the wide one's pose stays.
  std::optional<Found> search_anew(std::size_t image, const SE3& guess) {
    const std::optional<imaging::RgbImage> picture = flight_.read(image);
    if (!picture) return std::nullopt;
    const LocalizerOptions& windows = localizer_.options();
    auto found = align_with_new_view(*picture, guess, windows.narrow_window);
    if (found && found->result.correlation > kAlike) return found;
    auto wide = align_with_new_view(*picture, guess, windows.wide_window);
    if (!wide) return found;
    auto narrow = align_with_new_view(*picture, wide->result.T_local_camera, windows.narrow_window);
    if (!narrow || (found && found->result.correlation > narrow->result.correlation)) narrow = std::move(found);
    return narrow ? narrow : wide;
  }

  std::optional<Found> align_with_new_view(const imaging::RgbImage& picture, const SE3& guess, double window) {
    SE3 pose = guess;
    std::optional<Found> found;
    constexpr int kRounds = 3;
    for (int round = 0; round < kRounds; ++round) {
      const auto view = localizer_.render_view(pose, window);
      ++renderings_;
      if (!view) return std::nullopt;
      const auto result = localizer_.align(picture, *view, pose);
      if (!result) return std::nullopt;
      found = Found{*result, view};
      pose = result->T_local_camera;
      if (localizer_.image_motion(*view, view->T_local_camera, pose) < 0.25 * options_.view_motion) break;
    }
    return found;
  }

  /// Forgets images that match much worse than the flight's others do: the alignment ended beside the right pose.
  void drop_poor_matches() {
    std::vector<double> correlations;
    for (const auto& found : found_)
      if (found) correlations.push_back(found->result.correlation);
    if (correlations.empty()) return;
    const double least = kAlike * base::upper_median(std::move(correlations));
    for (auto& found : found_)
      if (found && found->result.correlation < least) found.reset();
  }

  void report() {
    const std::lock_guard lock(mutex_);
    report_progress(progress_, ++done_, static_cast<std::int64_t>(found_.size()), "locating images");
  }

  const PictureLocalizer& localizer_;
  const FlightImages& flight_;
  const Sim3& T_local_map_;
  const FlightLocalizerOptions& options_;
  const Progress& progress_;
  std::vector<std::optional<Found>> found_;
  std::atomic<std::size_t> renderings_ = 0;
  std::mutex mutex_;
  std::int64_t done_ = 0;
};

/// Sums the motion of the image from each found image to the next one along the flight, as a share of the width.
std::vector<double> summed_motion(const PictureLocalizer& localizer, const std::vector<std::optional<Found>>& found) {
  std::vector<double> motion(found.size(), 0.0);
  const Found* last = nullptr;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (i > 0) motion[i] = motion[i - 1];
    if (!found[i]) continue;
    if (last != nullptr)
      motion[i] += localizer.image_motion(*last->view, last->result.T_local_camera, found[i]->result.T_local_camera);
    last = &*found[i];
  }
  return motion;
}

/// Returns how many found images share the error of each; those that overlap less count less.
std::vector<double> shared_by(const std::vector<std::optional<Found>>& found, const std::vector<double>& motion,
                              double reach) {
  std::vector<double> counts(found.size(), 1.0);
  std::size_t begin = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!found[i]) continue;
    while (motion[i] - motion[begin] >= reach) ++begin;
    for (std::size_t j = begin; j < found.size() && motion[j] - motion[i] < reach; ++j)
      if (j != i && found[j]) counts[i] += 1.0 - std::abs(motion[j] - motion[i]) / reach;
  }
  return counts;
}

std::vector<std::optional<PathStep>> path_steps(const FlightImages& flight) {
  std::vector<std::optional<PathStep>> steps;
  for (std::size_t i = 1; i < flight.images.size(); ++i) {
    const FlightImage &from = flight.images[i - 1], &to = flight.images[i];
    steps.emplace_back();
    if (!from.T_map_camera || !to.T_map_camera) continue;
    steps.back() =
        PathStep{from.T_map_camera->inverse() * *to.T_map_camera, std::hypot(from.sigma_position, to.sigma_position),
                 std::hypot(from.sigma_rotation_rad, to.sigma_rotation_rad)};
  }
  return steps;
}

/// Returns a pose of every image to begin the fusion with: the one that was found, or the one carried from the nearest
/// found image before it (for images before the first one: after it).
std::vector<SE3> first_poses(const ImageSearch& search) {
  const auto& found = search.found();
  const auto first = static_cast<std::size_t>(std::ranges::find_if(found, [](const auto& f) { return f.has_value(); }) -
                                              found.begin());
  std::vector<SE3> poses(found.size());
  std::size_t last = first;
  for (std::size_t i = first; i < found.size(); ++i) {
    if (found[i]) last = i;
    poses[i] = found[i] ? found[i]->result.T_local_camera : search.carried_pose(i, last).value_or(poses[i - 1]);
  }
  for (std::size_t i = first; i-- > 0;) poses[i] = search.carried_pose(i, first).value_or(poses[i + 1]);
  return poses;
}

double position_sigma_m(const PoseMeasurement& located) {
  return std::sqrt(std::max(0.0, located.covariance.topLeftCorner<3, 3>().trace()));
}

/// Tells whether the motion between two located images is another than the odometry's step, by far more than both err.
bool contradicts_step(const PathStep& step, const PoseMeasurement& from, const PoseMeasurement& to, double scale) {
  constexpr double kSigmas = 4.0, kShareOfStep = 0.05, kLeast_m = 0.02;
  const SE3 motion = from.T_local_camera.inverse() * to.T_local_camera;
  const double apart_m = (motion.translation - scale * step.T_this_next.translation).norm();
  const double sigma_m = std::hypot(scale * step.sigma_translation, position_sigma_m(from), position_sigma_m(to));
  return apart_m > kSigmas * sigma_m + kShareOfStep * motion.translation.norm() + kLeast_m;
}

/// Forgets the odometry's steps where it went wrong: three and more, one after the other, that contradict the located
/// images. One image that was located elsewhere contradicts the two steps beside it, and several of them, in a part of
/// the place that looks the same, one at each end: these steps stay.
void drop_wrong_steps(const std::vector<std::optional<PoseMeasurement>>& located, double scale,
                      std::vector<std::optional<PathStep>>& steps) {
  constexpr std::size_t kFewest = 3;
  const auto is_wrong = [&](std::size_t i) {
    return steps[i] && located[i] && located[i + 1] && contradicts_step(*steps[i], *located[i], *located[i + 1], scale);
  };
  for (std::size_t begin = 0; begin < steps.size();) {
    std::size_t end = begin;
    while (end < steps.size() && is_wrong(end)) ++end;
    if (end - begin >= kFewest)
      for (std::size_t i = begin; i < end; ++i) steps[i].reset();
    begin = std::max(end, begin + 1);
  }
}

double largest_position_sigma(const FusedPose& pose) {
  return std::sqrt(std::max(0.0, pose.covariance.topLeftCorner<3, 3>().diagonal().maxCoeff()));
}

}  // namespace

LocatedFlight locate_flight(const PictureLocalizer& localizer, const FlightImages& flight, const Sim3& T_local_map,
                            const FlightLocalizerOptions& options, const Progress& progress) {
  ImageSearch search(localizer, flight, T_local_map, options, progress);
  search.run();
  const auto& found = search.found();
  if (std::ranges::none_of(found, [](const auto& f) { return f.has_value(); }))
    throw InputError(
        "images",
        "none was found in the place near where the flight was registered: check that the tiles are of this "
        "place, and that calibration and odometry are of these images");

  const std::vector<double> shares = shared_by(found, summed_motion(localizer, found), options.shared_motion);
  std::vector<std::optional<PoseMeasurement>> measurements(found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!found[i]) continue;
    const LocalizationResult& result = found[i]->result;
    measurements[i] = PoseMeasurement{result.T_local_camera, result.covariance, shares[i]};
  }
  FusionOptions fusion{.scale = T_local_map.scale};
  if (flight.has_scale) fusion.sigma_log_scale = 0.01;
  std::vector<std::optional<PathStep>> steps = path_steps(flight);
  drop_wrong_steps(measurements, T_local_map.scale, steps);
  const FusedPath path = fuse_path(first_poses(search), steps, measurements, fusion);

  LocatedFlight located{
      .images = std::vector<LocatedImage>(found.size()), .noise = path.noise, .renderings = search.renderings()};
  for (std::size_t i = 0; i < found.size(); ++i) {
    LocatedImage& image = located.images[i];
    image.pose = path.poses[i];
    image.contradicts = image.pose.is_outlier;
    if (found[i]) {
      image.correlation = found[i]->result.correlation;
      image.share_in_view = found[i]->result.share_in_view;
      image.parts = found[i]->result.parts;
    }
    const bool is_known = largest_position_sigma(image.pose) < options.lost_sigma_m;
    if (is_known) image.source = found[i] && !image.contradicts ? PoseSource::kPlace : PoseSource::kOdometry;
  }
  return located;
}

}  // namespace tileflight::localization
