#include "tileflight/capture/recording/reproduction.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "tileflight/capture/flight_path/smooth_path.h"
#include "tileflight/capture/render/view_overlap.h"
#include "tileflight/core/alignment/transform_file.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/core/imaging/image_similarity.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/world/ground_truth/truth_folder.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::recording {

namespace fs = std::filesystem;

void write_followed_flight(const fs::path& real, const std::optional<flight_path::SmoothingOptions>& smoothing,
                           const fs::path& out, const fs::path& located) {
  const fs::path source = located.empty() ? real / "odometry/trajectory.txt" : located;
  geometry::Trajectory local = geometry::read_tum(source);
  if (local.size() < 2) throw InputError(source.string(), "has fewer than two poses; there is no path to follow");
  if (located.empty())
    local = geometry::transformed(alignment::read_transform(real / "transform.json").T_target_source, local);
  const bool is_smoothed = local.size() >= flight_path::kMinPosesToSmooth;
  const base::OutputFolder output{
      .folder = out, .command = "run", .replace = true, .inputs = {real / "odometry", real / "dataset"}};
  base::write_folder(output, [&](const fs::path& folder) {
    geometry::write_tum(folder / "poses.txt", local);
    fs::copy_file(real / "dataset/camera.yaml", folder / "camera.yaml");
    base::write_file(folder / "flight.yaml",
                     "# The other flight's path as estimated by odometry, at the times of its images.\n"
                     "camera: camera.yaml\ntrajectory: poses.txt\nsmooth: " +
                         flight_path::smoothing_text(is_smoothed ? smoothing : std::nullopt) + "\n");
  });
}

namespace {

using geometry::SE3;
using imaging::GrayImage;
using nlohmann::json;

constexpr std::size_t kMaxPairs = 200;
constexpr std::size_t kShiftedPairs = 40;  ///< pairs used for the time offset
constexpr int kMaxShift_frames = 3;        ///< frames
constexpr double kExcerptOverlap = 0.8;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// A flight's images and camera poses.
struct FlightView {
  dataset::Dataset dataset;
  geometry::Trajectory poses;
};

struct FramePair {
  std::size_t real = 0, simulated = 0;  ///< frame indices
  double time_s = 0.0;
  double overlap = kNaN, ncc = kNaN, ssim = kNaN;
  double position_m = kNaN, rotation_deg = kNaN;
};

FlightView real_view(const fs::path& run, bool& is_true) {
  FlightView view{dataset::read_dataset(run / "real/dataset"), {}};
  is_true = view.dataset.groundtruth.has_value();
  view.poses = is_true ? *view.dataset.groundtruth : geometry::read_tum(run / "simulated/flight/poses.txt");
  return view;
}

FlightView simulated_view(const fs::path& folder) {
  FlightView view{dataset::read_dataset(folder / "dataset"), {}};
  view.poses = view.dataset.groundtruth.value();
  return view;
}

geometry::Trajectory frame_times(const dataset::Dataset& dataset) {
  geometry::Trajectory times;
  for (const dataset::Frame& frame : dataset.frames) times.poses.push_back({frame.time_s, SE3()});
  return times;
}

double frame_interval_s(const dataset::Dataset& dataset) {
  std::vector<double> gaps_s;
  for (std::size_t i = 1; i < dataset.frames.size(); ++i)
    gaps_s.push_back(dataset.frames[i].time_s - dataset.frames[i - 1].time_s);
  if (gaps_s.empty()) return 1.0;
  std::nth_element(gaps_s.begin(), gaps_s.begin() + static_cast<std::ptrdiff_t>(gaps_s.size() / 2), gaps_s.end());
  return gaps_s[gaps_s.size() / 2];
}

/// At most `most` evenly chosen items.
template <class Thing>
std::vector<Thing> subsample(const std::vector<Thing>& things, std::size_t most) {
  if (things.size() <= most) return things;
  std::vector<Thing> kept;
  for (std::size_t i = 0; i < most; ++i) kept.push_back(things[i * things.size() / most]);
  return kept;
}

std::vector<FramePair> pair_frames(const FlightView& real, const FlightView& simulated, const fs::path& run) {
  const double within_s = 0.5 * frame_interval_s(real.dataset);
  std::vector<FramePair> pairs;
  for (const auto& [r, s] : geometry::associate(frame_times(real.dataset), frame_times(simulated.dataset), within_s))
    pairs.push_back({.real = r, .simulated = s, .time_s = real.dataset.frames[r].time_s});
  if (pairs.empty()) throw InputError(run.string(), "the two flights have no images at the same time");
  return subsample(pairs, kMaxPairs);
}

/// The pixels inside the lens's image circle; empty: all.
GrayImage lens_mask(const imaging::Camera& camera) {
  GrayImage mask(camera.width(), camera.height(), 255);
  bool any_outside = false;
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) {
      if (camera.unproject(geometry::Vec2(x, y))) continue;
      mask(x, y) = 0;
      any_outside = true;
    }
  }
  return any_outside ? mask : GrayImage{};
}

/// Compares images of both flights; nothing if their sizes differ.
class PictureComparison {
 public:
  PictureComparison(const FlightView& real, const FlightView& simulated) : real_(real), simulated_(simulated) {
    const imaging::Camera &a = real.dataset.calibration.camera, &b = simulated.dataset.calibration.camera;
    same_size_ = a.width() == b.width() && a.height() == b.height();
    if (same_size_) mask_ = lens_mask(a);
  }
  bool can_compare() const { return same_size_; }
  imaging::ImageSimilarity operator()(std::size_t real, std::size_t simulated) const {
    return imaging::compute_image_similarity(imaging::read_gray(real_.dataset.frames[real].image),
                                             imaging::read_gray(simulated_.dataset.frames[simulated].image), mask_);
  }

 private:
  const FlightView &real_, &simulated_;
  GrayImage mask_;
  bool same_size_ = false;
};

void compare_poses(const FlightView& real, const FlightView& simulated, const render::ViewOverlap& overlap,
                   bool is_true, FramePair& pair) {
  const auto real_pose = geometry::interpolate(real.poses, pair.time_s);
  const auto flown = geometry::interpolate(simulated.poses, simulated.dataset.frames[pair.simulated].time_s);
  if (!real_pose || !flown) return;
  pair.overlap = overlap(*real_pose, *flown);
  if (!is_true) return;
  pair.position_m = (real_pose->translation - flown->translation).norm();
  pair.rotation_deg = real_pose->rotation.angularDistance(flown->rotation) * 180.0 / M_PI;
}

/// Mean similarity if the simulated flight's images are taken `shift` frames later.
double shifted_ncc(const PictureComparison& pictures, const std::vector<FramePair>& pairs, int shift,
                   std::size_t frames) {
  double sum = 0.0;
  int count = 0;
  for (const FramePair& pair : pairs) {
    const auto at = static_cast<std::ptrdiff_t>(pair.simulated) + shift;
    if (at < 0 || at >= static_cast<std::ptrdiff_t>(frames)) continue;
    const double ncc = pictures(pair.real, static_cast<std::size_t>(at)).ncc;
    if (!std::isfinite(ncc)) continue;
    sum += ncc;
    ++count;
  }
  return count > 0 ? sum / count : kNaN;
}

std::optional<double> best_offset_s(const PictureComparison& pictures, const std::vector<FramePair>& pairs,
                                    std::size_t frames, double interval_s) {
  const std::vector<FramePair> some = subsample(pairs, kShiftedPairs);
  std::vector<double> ncc;
  for (int shift = -kMaxShift_frames; shift <= kMaxShift_frames; ++shift)
    ncc.push_back(shifted_ncc(pictures, some, shift, frames));
  if (std::ranges::any_of(ncc, [](double value) { return std::isnan(value); })) return {};
  const auto best = std::ranges::max_element(ncc) - ncc.begin();
  if (best == 0 || best + 1 == static_cast<std::ptrdiff_t>(ncc.size())) return {};
  const double before = ncc[best - 1], at = ncc[best], after = ncc[best + 1];
  const double bend = before - 2 * at + after;
  const double peak = bend < 0 ? 0.5 * (before - after) / bend : 0.0;
  // The simulated images are most similar when taken `best` frames later, so they would have to be earlier by that.
  return -(static_cast<double>(best - kMaxShift_frames) + peak) * interval_s;
}

/// Median and tenth percentile of the known values; null if there are none.
json percentiles(const std::vector<FramePair>& pairs, double FramePair::*value) {
  std::vector<double> known;
  for (const FramePair& pair : pairs)
    if (std::isfinite(pair.*value)) known.push_back(pair.*value);
  if (known.empty()) return nullptr;
  std::sort(known.begin(), known.end());
  return {{"median", known[known.size() / 2]},
          {"p10", known[known.size() / 10]},
          {"p90", known[known.size() - 1 - known.size() / 10]}};
}

json best_excerpt(const std::vector<FramePair>& pairs) {
  std::optional<std::size_t> from;
  std::size_t best_from = 0, best_to = 0;
  bool found = false;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!(pairs[i].overlap >= kExcerptOverlap)) {
      from.reset();
      continue;
    }
    if (!from) from = i;
    if (found && i - *from <= best_to - best_from) continue;
    best_from = *from;
    best_to = i;
    found = true;
  }
  if (!found) return nullptr;
  return {{"from_s", pairs[best_from].time_s}, {"to_s", pairs[best_to].time_s}, {"overlap_at_least", kExcerptOverlap}};
}

/// One line per pair; unknown values are empty.
std::string to_csv(const std::vector<FramePair>& pairs) {
  std::string text = "time_s,real_frame,simulated_frame,overlap,ncc,ssim,position_m,rotation_deg\n";
  for (const FramePair& pair : pairs) {
    text += base::formatted("%.6f,%zu,%zu", pair.time_s, pair.real, pair.simulated);
    for (const double value : {pair.overlap, pair.ncc, pair.ssim, pair.position_m, pair.rotation_deg}) {
      text += ',';
      if (std::isfinite(value)) text += base::rounded_text(value, 6);
    }
    text += "\n";
  }
  return text;
}

scene::Scene load_truth_scene(const fs::path& truth) {
  std::vector<imaging::TexturedMesh> meshes(1);
  meshes[0].mesh = ground_truth::read_ground_truth(truth).mesh;
  return scene::Scene(std::move(meshes));
}

}  // namespace

json measure_reproduction(const fs::path& run, const Progress& progress) {
  bool is_true = false;
  const FlightView real = real_view(run, is_true), simulated = simulated_view(run / "simulated");
  std::vector<FramePair> pairs = pair_frames(real, simulated, run);
  const scene::Scene scene = load_truth_scene(run / "truth");
  const render::ViewOverlap overlap(scene, real.dataset.calibration.camera, simulated.dataset.calibration.camera);
  const PictureComparison pictures(real, simulated);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    compare_poses(real, simulated, overlap, is_true, pairs[i]);
    if (pictures.can_compare()) {
      const imaging::ImageSimilarity alike = pictures(pairs[i].real, pairs[i].simulated);
      pairs[i].ncc = alike.ncc;
      pairs[i].ssim = alike.ssim;
    }
    report_progress(progress, static_cast<std::int64_t>(i) + 1, static_cast<std::int64_t>(pairs.size()),
                    "comparing images");
  }
  const auto offset_s = pictures.can_compare() ? best_offset_s(pictures, pairs, simulated.dataset.frames.size(),
                                                               frame_interval_s(simulated.dataset))
                                               : std::nullopt;
  const json result{{"pairs", pairs.size()},
                    {"poses", is_true ? "true" : "estimated"},
                    {"overlap", percentiles(pairs, &FramePair::overlap)},
                    {"ncc", percentiles(pairs, &FramePair::ncc)},
                    {"ssim", percentiles(pairs, &FramePair::ssim)},
                    {"position_m", percentiles(pairs, &FramePair::position_m)},
                    {"rotation_deg", percentiles(pairs, &FramePair::rotation_deg)},
                    {"time_offset_s", offset_s ? json(*offset_s) : json(nullptr)},
                    {"excerpt", best_excerpt(pairs)}};
  base::write_file(run / "reproduction.csv", to_csv(pairs));
  base::write_file(run / "reproduction.json", result.dump(2) + "\n");
  return result;
}

}  // namespace tileflight::recording
