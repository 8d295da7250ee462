#include "tileflight/evaluation/scoring/picture_finder.h"

#include <algorithm>
#include <optional>

#include "tileflight/core/imaging/image_files.h"
#include "tileflight/evaluation/localization/picture_localizer.h"

namespace tileflight::scoring {

using geometry::SE3;
using geometry::Sim3;

namespace {
constexpr int kCoarseWidth = 400;  // pixels: sufficient to recognize the place, at a sixth of the cost
}

struct PictureFinder::Impl {
  dataset::Dataset dataset;
  geometry::Trajectory path;
  std::vector<std::pair<std::size_t, std::size_t>> pairs;  ///< pose of the path, frame of the dataset
  localization::PictureLocalizer fine, coarse;

  Impl(const scene::Scene& scene, dataset::Dataset d, geometry::Trajectory p)
      : dataset(std::move(d)),
        path(std::move(p)),
        fine(scene, dataset.calibration.camera),
        coarse(scene, fine.appearance(), dataset.calibration.camera, {.width = kCoarseWidth}) {
    geometry::Trajectory times;
    for (const dataset::Frame& frame : dataset.frames) times.poses.push_back({frame.time_s, SE3()});
    constexpr double kSameTime_s = 1e-3;
    pairs = geometry::associate(path, times, kSameTime_s);
  }

  std::optional<registration::LocatedPicture> locate(std::size_t pair, const SE3& guess,
                                                     registration::PictureDetail detail) const {
    const auto [pose, frame] = pairs[pair];
    const auto& localizer = detail == registration::PictureDetail::kFine ? fine : coarse;
    const auto found = localizer.locate(imaging::read_rgb(dataset.frames[frame].image), guess);
    if (!found) return std::nullopt;
    return registration::LocatedPicture{
        pose, {path.poses[pose].T_local_camera, found->T_local_camera, found->information}, found->correlation};
  }

  /// Predicts a pose from a localized neighbour and the path's own motion between them.
  SE3 predict_pose(const registration::LocatedPicture& neighbor, std::size_t pose, double scale) const {
    SE3 motion = neighbor.found.T_map_camera.inverse() * path.poses[pose].T_local_camera;
    motion.translation *= scale;
    return neighbor.found.T_local_camera * motion;
  }
};

PictureFinder::PictureFinder(const scene::Scene& scene, dataset::Dataset dataset, geometry::Trajectory path)
    : impl_(std::make_unique<Impl>(scene, std::move(dataset), std::move(path))) {}

PictureFinder::~PictureFinder() = default;

std::shared_ptr<const render::Appearance> PictureFinder::appearance() const { return impl_->fine.appearance(); }

registration::LocatedPictures PictureFinder::operator()(const Sim3& T, std::size_t pictures,
                                                        registration::PictureDetail detail) const {
  const Impl& my = *impl_;
  const std::size_t n = std::min(pictures, my.pairs.size());
  std::vector<std::size_t> chosen;
  for (std::size_t k = 0; k < n; ++k) chosen.push_back((2 * k + 1) * my.pairs.size() / (2 * n));
  std::vector<std::optional<registration::LocatedPicture>> found(n);
  for (std::size_t k = 0; k < n; ++k)
    found[k] = my.locate(chosen[k], T * my.path.poses[my.pairs[chosen[k]].first].T_local_camera, detail);
  const auto from_neighbor = [&](std::size_t k, std::size_t neighbor) {
    if (found[k] || !found[neighbor]) return;
    found[k] = my.locate(chosen[k], my.predict_pose(*found[neighbor], my.pairs[chosen[k]].first, T.scale), detail);
  };
  for (std::size_t k = 1; k < n; ++k) from_neighbor(k, k - 1);
  for (std::size_t k = n; k-- > 1;) from_neighbor(k - 1, k);
  registration::LocatedPictures result{.tried = n};
  for (const auto& picture : found)
    if (picture) result.found.push_back(*picture);
  return result;
}

}  // namespace tileflight::scoring
