#include "tileflight/data/dataset/synchronisation.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::dataset {
namespace {

/// A camera is as fast as another one if their periods differ by no more.
constexpr double kSamePeriod = 1.2;
/// Periods between two pictures, or beyond the end of a camera, from which on one is missing.
constexpr double kGap = 1.5;

double median_of(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// Median time between two pictures; 0 for a single one.
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

/// While both run, and somewhat longer: a partner may be a little outside.
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
    throw InputError("camera " + camera.name, "takes no picture while " + first.name + " does (" +
                                                  seconds_text(camera.times_s.front()) + " to " +
                                                  seconds_text(camera.times_s.back()) + " against " +
                                                  seconds_text(first.times_s.front()) + " to " +
                                                  seconds_text(first.times_s.back()) + "): check their times");
  result.pairs = offsets_s.size();
  result.offset_s = median_of(std::move(offsets_s));
  return result;
}

bool is_synchronised(const CameraSynchronisation& camera) { return 2 * camera.matched >= camera.pairs; }

/// How much later both ends are than the first camera's, if that is the same for both and of as many pictures; else 0.
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

/// What the others took while this camera ran and has nothing of.
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
    // With clocks apart, nothing can be said of single pictures.
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
      add_fault(camera.name + " is not synchronised with " + first + ": its pictures are " +
                milliseconds(std::abs(camera.offset_s)) + (camera.offset_s < 0 ? " earlier" : " later") +
                " (median), " + std::to_string(camera.matched) + " of " + std::to_string(camera.pairs) +
                " are within " + tolerance_text() + remedy + ", or a larger tolerance");
      return false;
    }
    const double shift_s = shift_of_ends(cameras_[number], cameras_.front(), result_.tolerance_s);
    if (shift_s == 0.0) return true;
    add_fault(camera.name + " begins and ends " + milliseconds(std::abs(shift_s)) +
              (shift_s < 0 ? " before " : " after ") + first + " with as many pictures, so its time stamps may be " +
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
              (missing.size() == 1 ? " picture is" : " pictures are") + " missing, " +
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
                " after the first picture of the rig");
    }
    if (all.last - own.back() > most_s) {
      camera.stops_early_s = all.last - own.back();
      add_fault(camera.name + " stops at " + seconds_text(own.back()) + ", " + seconds_text(camera.stops_early_s) +
                " before the last picture of the rig");
    }
  }

  const std::vector<CameraTimes>& cameras_;
  Synchronisation result_;
};

}  // namespace

Synchronisation check_synchronisation(const std::vector<CameraTimes>& cameras, double tolerance_s) {
  return Check(cameras, tolerance_s).take();
}

}  // namespace tileflight::dataset
