#include "tileflight/data/dataset/ingest_rig.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/data/dataset/dataset_metadata.h"
#include "tileflight/data/dataset/rig.h"

namespace tileflight::dataset {

namespace {

/// A camera is as fast as another one if their periods differ by no more.
constexpr double kSamePeriod = 1.2;
/// A gap between two images, or beyond the end of a camera, of more periods means that an image is missing.
constexpr double kGap = 1.5;

double median_of(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// Returns the median time between two images; 0 for a single image.
double period_of(const std::vector<double>& times_s) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < times_s.size(); ++i) steps.push_back(times_s[i] - times_s[i - 1]);
  return median_of(std::move(steps));
}

double nearest(const std::vector<double>& times_s, double time_s) {
  const auto after = std::ranges::lower_bound(times_s, time_s);
  if (after == times_s.end()) return times_s.back();
  if (after == times_s.begin() || *after - time_s < time_s - *(after - 1)) return *after;
  return *(after - 1);
}

std::string milliseconds(double seconds) { return base::trimmed_text(1e3 * seconds, 3) + " ms"; }
std::string seconds_text(double seconds) { return base::trimmed_text(seconds, 3) + " s"; }

struct Span {
  double first = 0.0, last = 0.0;
  bool holds(double time_s) const { return time_s >= first && time_s <= last; }
};

/// Returns the time while both cameras run, and somewhat longer: a partner may be a little outside.
Span common_span(const std::vector<double>& a, const std::vector<double>& b, double margin_s) {
  return {std::max(a.front(), b.front()) - margin_s, std::min(a.back(), b.back()) + margin_s};
}

CameraSynchronisation match(const CameraTimes& camera, const CameraTimes& first, double tolerance_s) {
  CameraSynchronisation result{.name = camera.name, .frames = camera.times_s.size()};
  const bool is_slower = period_of(camera.times_s) > period_of(first.times_s);
  const std::vector<double>& slow = is_slower ? camera.times_s : first.times_s;
  const std::vector<double>& fast = is_slower ? first.times_s : camera.times_s;
  const Span both = common_span(slow, fast, std::max(tolerance_s, 0.5 * period_of(fast)));
  std::vector<double> offsets_s;
  for (const double time_s : slow) {
    if (!both.holds(time_s)) continue;
    const double later_s = nearest(fast, time_s) - time_s;
    offsets_s.push_back(is_slower ? -later_s : later_s);
    if (std::abs(later_s) > tolerance_s) continue;
    ++result.matched;
    result.largest_skew_s = std::max(result.largest_skew_s, std::abs(later_s));
  }
  if (offsets_s.empty())
    throw InputError("camera " + camera.name,
                     "takes no image while " + first.name + " does (" + seconds_text(camera.times_s.front()) + " to " +
                         seconds_text(camera.times_s.back()) + " against " + seconds_text(first.times_s.front()) +
                         " to " + seconds_text(first.times_s.back()) + "): check their times");
  result.pairs = offsets_s.size();
  result.offset_s = median_of(std::move(offsets_s));
  return result;
}

bool is_synchronised(const CameraSynchronisation& camera) { return 2 * camera.matched >= camera.pairs; }

/// Returns how much later the camera starts and stops than the first, if both differ by the same time and both cameras
/// have as many images; else 0.
double shift_of_ends(const CameraTimes& camera, const CameraTimes& first, double tolerance_s) {
  if (camera.times_s.size() != first.times_s.size() || camera.times_s.size() < 2) return 0.0;
  const double period_s = period_of(first.times_s);
  const double begin_s = camera.times_s.front() - first.times_s.front();
  const double end_s = camera.times_s.back() - first.times_s.back();
  const bool is_same = std::abs(begin_s - end_s) <= std::max(tolerance_s, 0.1 * period_s);
  return is_same && std::abs(begin_s) > 0.5 * period_s ? begin_s : 0.0;
}

bool is_as_fast(const CameraTimes& a, const CameraTimes& b) {
  const double one_s = period_of(a.times_s), other_s = period_of(b.times_s);
  return std::max(one_s, other_s) <= kSamePeriod * std::min(one_s, other_s);
}

/// The other cameras of its rate.
std::vector<const CameraTimes*> companions(const std::vector<CameraTimes>& cameras, std::size_t camera) {
  std::vector<const CameraTimes*> found;
  for (std::size_t other = 0; other < cameras.size(); ++other)
    if (other != camera && is_as_fast(cameras[other], cameras[camera])) found.push_back(&cameras[other]);
  return found;
}

/// Returns the times at which other cameras took an image while this camera ran and took none.
std::vector<double> missing_by_others(const std::vector<double>& own, const std::vector<const CameraTimes*>& others,
                                      double tolerance_s) {
  std::vector<double> missing;
  for (const CameraTimes* other : others) {
    for (const double time_s : other->times_s) {
      const bool is_within = time_s > own.front() && time_s < own.back();
      if (is_within && std::abs(nearest(own, time_s) - time_s) > tolerance_s) missing.push_back(time_s);
    }
  }
  std::ranges::sort(missing);
  const auto same = [&](double a, double b) { return b - a <= tolerance_s; };
  missing.erase(std::unique(missing.begin(), missing.end(), same), missing.end());
  return missing;
}

std::vector<double> missing_in_gaps(const std::vector<double>& times_s) {
  const double period_s = period_of(times_s);
  std::vector<double> missing;
  for (std::size_t i = 1; i < times_s.size(); ++i) {
    const double step_s = times_s[i] - times_s[i - 1];
    if (step_s <= kGap * period_s) continue;
    const auto steps = static_cast<int>(std::min(1e6, std::round(step_s / period_s)));
    for (int k = 1; k < steps; ++k) missing.push_back(times_s[i - 1] + period_s * k);
  }
  return missing;
}

class Check {
 public:
  Check(const std::vector<CameraTimes>& cameras, double tolerance_s) : cameras_(cameras) {
    result_.tolerance_s = tolerance_s;
    for (const CameraTimes& camera : cameras) result_.cameras.push_back(match(camera, cameras.front(), tolerance_s));
    bool is_one_clock = true;
    for (std::size_t i = 1; i < cameras.size(); ++i) is_one_clock = check_clock(i) && is_one_clock;
    // If the clocks differ, single images cannot be compared.
    for (std::size_t i = 0; i < cameras.size() && is_one_clock; ++i) {
      check_missing(i);
      check_ends(i);
    }
  }

  Synchronisation take() && { return std::move(result_); }

 private:
  void add_fault(std::string line) { result_.faults.push_back(std::move(line)); }
  std::string tolerance_text() const { return milliseconds(result_.tolerance_s); }

  /// False if it is not that of the first.
  bool check_clock(std::size_t number) {
    const CameraSynchronisation& camera = result_.cameras[number];
    const std::string& first = cameras_.front().name;
    const std::string remedy = "; give the camchain a timeshift_cam_imu";
    if (!is_synchronised(camera)) {
      add_fault(camera.name + " is not synchronised with " + first + ": its images are " +
                milliseconds(std::abs(camera.offset_s)) + (camera.offset_s < 0 ? " earlier" : " later") +
                " (median), " + std::to_string(camera.matched) + " of " + std::to_string(camera.pairs) +
                " are within " + tolerance_text() + remedy + ", or a larger tolerance");
      return false;
    }
    const double shift_s = shift_of_ends(cameras_[number], cameras_.front(), result_.tolerance_s);
    if (shift_s == 0.0) return true;
    add_fault(camera.name + " begins and ends " + milliseconds(std::abs(shift_s)) +
              (shift_s < 0 ? " before " : " after ") + first + " with as many images, so its time stamps may be " +
              (shift_s < 0 ? "early" : "late") + remedy);
    return false;
  }

  void check_missing(std::size_t number) {
    const std::vector<double>& own = cameras_[number].times_s;
    const std::vector<const CameraTimes*> others = companions(cameras_, number);
    const std::vector<double> missing =
        others.empty() ? missing_in_gaps(own) : missing_by_others(own, others, result_.tolerance_s);
    result_.cameras[number].missing = missing.size();
    if (missing.empty()) return;
    add_fault(cameras_[number].name + ": " + std::to_string(missing.size()) +
              (missing.size() == 1 ? " image is" : " images are") + " missing, " +
              (missing.size() == 1 ? "at " : "the first at ") + seconds_text(missing.front()));
  }

  void check_ends(std::size_t number) {
    Span all{cameras_.front().times_s.front(), cameras_.front().times_s.back()};
    for (const CameraTimes& camera : cameras_)
      all = {std::min(all.first, camera.times_s.front()), std::max(all.last, camera.times_s.back())};
    const std::vector<double>& own = cameras_[number].times_s;
    const double most_s = kGap * period_of(own);
    CameraSynchronisation& camera = result_.cameras[number];
    if (own.front() - all.first > most_s) {
      camera.starts_late_s = own.front() - all.first;
      add_fault(camera.name + " starts at " + seconds_text(own.front()) + ", " + seconds_text(camera.starts_late_s) +
                " after the first image of the rig");
    }
    if (all.last - own.back() > most_s) {
      camera.stops_early_s = all.last - own.back();
      add_fault(camera.name + " stops at " + seconds_text(own.back()) + ", " + seconds_text(camera.stops_early_s) +
                " before the last image of the rig");
    }
  }

  const std::vector<CameraTimes>& cameras_;
  Synchronisation result_;
};

}  // namespace

Synchronisation check_synchronisation(const std::vector<CameraTimes>& cameras, double tolerance_s) {
  return Check(cameras, tolerance_s).take();
}

namespace {

namespace fs = std::filesystem;

std::vector<std::string> names_of(const RigIngestOptions& options) {
  std::vector<std::string> names;
  for (const IngestedCamera& camera : options.cameras) names.push_back(camera.name);
  return names;
}

/// Returns the folder of a camera's files within the dataset.
fs::path folder_of(const RigIngestOptions& options, std::size_t camera) {
  return camera == 0 ? fs::path(".") : fs::path("cameras") / options.cameras[camera].name;
}

/// `times_s`: increasing, not empty.
double distance_to_nearest(const std::vector<double>& times_s, double time_s) {
  const auto after = std::ranges::lower_bound(times_s, time_s);
  const double later_s = after == times_s.end() ? INFINITY : *after - time_s;
  return after == times_s.begin() ? later_s : std::min(later_s, time_s - *(after - 1));
}

std::vector<double> on_body_clock(std::vector<double> times_s, double timeshift_s) {
  for (double& time_s : times_s) time_s += timeshift_s;
  return times_s;
}

/// Returns the options of ingest() for one camera.
IngestOptions options_of(const RigIngestOptions& rig, std::size_t number, const fs::path& built) {
  const IngestedCamera& first = rig.cameras.front();
  const IngestedCamera& camera = rig.cameras[number];
  IngestOptions options = rig.common;
  options.video_or_images = camera.video_or_images;
  options.image_times = camera.image_times;
  options.camera_id = camera.name;
  options.lens = camera.calibration;
  options.timeshift_s = camera.timeshift_s;
  options.part_folder = (built / folder_of(rig, number)).lexically_normal();
  options.description["camera"] = camera.name;
  options.description["cameras"] = base::joined(names_of(rig));
  if (number == 0) return options;
  options.T_truth_camera = first.T_body_camera.inverse() * camera.T_body_camera;
  options.groundtruth_offset_s = first.timeshift_s - camera.timeshift_s;
  options.gps.clear();
  options.attitudes.clear();
  options.ranges.clear();
  options.imu.clear();
  options.excerpt.every = 1;
  return options;
}

std::vector<IngestResult> ingest_cameras(const RigIngestOptions& rig, const fs::path& built, const Progress& progress) {
  std::vector<IngestResult> results;
  std::vector<double> wanted_s;  // on the body's clock
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    IngestOptions options = options_of(rig, i, built);
    if (i > 0 && rig.common.excerpt.every > 1)
      options.is_wanted = [&wanted_s, shift_s = options.timeshift_s](double time_s, double period_s) {
        return distance_to_nearest(wanted_s, time_s + shift_s) < 0.5 * period_s;
      };
    results.push_back(ingest(options, built, progress));
    if (i == 0) wanted_s = on_body_clock(results.front().times_s, options.timeshift_s);
  }
  return results;
}

Synchronisation synchronisation_of(const RigIngestOptions& rig, const std::vector<IngestResult>& results) {
  std::vector<CameraTimes> times;
  for (std::size_t i = 0; i < results.size(); ++i)
    times.push_back({rig.cameras[i].name, on_body_clock(results[i].times_s, rig.cameras[i].timeshift_s)});
  return check_synchronisation(times, rig.sync_tolerance_s);
}

void write_chain(const RigIngestOptions& rig, const std::vector<IngestResult>& results, const fs::path& folder) {
  std::vector<imaging::ChainCamera> chain;
  for (std::size_t i = 0; i < results.size(); ++i) {
    const IngestedCamera& camera = rig.cameras[i];
    chain.push_back({camera.name, folder_of(rig, i), results[i].calibration, camera.T_body_camera, camera.timeshift_s});
  }
  imaging::write_camchain(folder / "camchain.yaml", chain);
}

/// Adds to the dataset.yaml of the rig what is known of its cameras' times.
void describe(const Synchronisation& found, const fs::path& folder) {
  std::map<std::string, std::string> about = read_metadata(folder / "dataset.yaml");
  about["synchronisation.tolerance_s"] = base::fixed_text(found.tolerance_s);
  for (const CameraSynchronisation& camera : found.cameras) {
    const std::string key = "synchronisation." + camera.name + ".";
    about[key + "matched"] = std::to_string(camera.matched) + " of " + std::to_string(camera.pairs);
    about[key + "largest_skew_s"] = base::rounded_text(camera.largest_skew_s, 9);
    about[key + "missing"] = std::to_string(camera.missing);
  }
  if (!found.faults.empty()) about["synchronisation.faults"] = base::joined(found.faults, "; ");
  base::write_file(folder / "dataset.yaml", format_metadata(about));
}

base::OutputFolder output_of(const RigIngestOptions& rig, const fs::path& folder) {
  base::OutputFolder output{
      .folder = folder, .command = "ingest", .replace = rig.common.replace, .inputs = rig.common.inputs};
  for (const IngestedCamera& camera : rig.cameras) output.inputs.push_back(camera.video_or_images);
  for (const fs::path& input : {rig.common.calibration, rig.common.imu, rig.common.imu_noise, rig.common.groundtruth})
    output.inputs.push_back(input);
  return output;
}

}  // namespace

RigIngestResult ingest_rig(const RigIngestOptions& options, const fs::path& dataset_folder, const Progress& progress) {
  if (const auto fault = fault_of_camera_names(names_of(options)))
    throw InputError(options.common.calibration.string(), *fault);
  RigIngestResult result;
  base::write_folder(output_of(options, dataset_folder), [&](const fs::path& built) {
    result.cameras = ingest_cameras(options, built, progress);
    result.synchronisation = synchronisation_of(options, result.cameras);
    write_chain(options, result.cameras, built);
    describe(result.synchronisation, built);
  });
  return result;
}

}  // namespace tileflight::dataset
