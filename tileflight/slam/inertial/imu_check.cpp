#include "tileflight/slam/inertial/imu_check.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/order_statistics.h"

namespace tileflight::inertial {
namespace {

using Vec6 = geometry::Vec6;

constexpr double kGapIntervals = 3.0;  // of the median
constexpr double kFrozen_s = 0.1;
constexpr std::size_t kSaturatedReadings = 4;
// Smallest ranges on the market: 125 deg/s and 2 g. A value that repeats itself below them is no end of a range.
constexpr double kSmallestRateRange = 2.0, kSmallestForceRange = 15.0;

std::string text(double value) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%.4g", value);
  return digits;
}

Vec6 values(const geometry::ImuSample& sample) {
  Vec6 v;
  v << sample.angular_rate_rad_s, sample.specific_force_m_s2;
  return v;
}

void require_numbers(const std::vector<geometry::ImuSample>& samples, const std::string& where) {
  if (samples.size() < 2) throw InputError(where, "has fewer than two readings of the inertial unit");
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const std::string which = where + ": reading " + std::to_string(i + 1);
    if (!std::isfinite(samples[i].time_s) || !values(samples[i]).allFinite())
      throw InputError(which, "has a number that is not finite");
    if (i > 0 && !(samples[i].time_s > samples[i - 1].time_s))
      throw InputError(which, "its time is not after the one before it");
  }
}

/// The size of the specific force tells its unit: a vehicle's is near that of gravity most of the time.
void require_gravity(const std::vector<geometry::ImuSample>& samples, const std::string& where) {
  std::vector<double> sizes;
  for (const geometry::ImuSample& sample : samples) sizes.push_back(sample.specific_force_m_s2.norm());
  const double size = base::upper_median(std::move(sizes));
  if (size > 0.7 && size < 1.4)
    throw InputError(where, "the specific force is " + text(size) +
                                " in size at the median: it is in g; give it in m/s^2 (1 g = 9.80665 m/s^2)");
  if (size < 5.0)
    throw InputError(where, "the specific force is " + text(size) +
                                " m/s^2 in size at the median: gravity was taken from it; give what the accelerometer "
                                "reads, 9.8 m/s^2 upwards at rest");
  if (size > 20.0)
    throw InputError(where, "the specific force is " + text(size) +
                                " in size at the median, far from gravity's 9.8 m/s^2: check its unit");
}

void require_change(const std::vector<geometry::ImuSample>& samples, const std::string& where) {
  const Vec6 first = values(samples.front());
  for (const geometry::ImuSample& sample : samples)
    if (values(sample) != first) return;
  throw InputError(where, "all readings are the same: the inertial unit did not work");
}

/// Makes one span of those that touch.
std::vector<UnusableSpan> merged(std::vector<UnusableSpan> spans) {
  std::sort(spans.begin(), spans.end(), [](const auto& a, const auto& b) { return a.from_s < b.from_s; });
  std::vector<UnusableSpan> whole;
  for (const UnusableSpan& span : spans) {
    if (!whole.empty() && span.from_s <= whole.back().to_s)
      whole.back().to_s = std::max(whole.back().to_s, span.to_s);
    else
      whole.push_back(span);
  }
  return whole;
}

/// The span around readings `first` to `last`.
UnusableSpan span_around(const std::vector<geometry::ImuSample>& samples, std::size_t first, std::size_t last) {
  return {samples[first == 0 ? 0 : first - 1].time_s, samples[std::min(last + 1, samples.size() - 1)].time_s};
}

std::vector<UnusableSpan> find_gaps(const std::vector<geometry::ImuSample>& samples, double interval_s) {
  std::vector<UnusableSpan> gaps;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    if (samples[i].time_s - samples[i - 1].time_s > kGapIntervals * interval_s)
      gaps.push_back({samples[i - 1].time_s, samples[i].time_s});
  }
  return gaps;
}

/// Runs of readings for which `same` holds from one to the next, of at least `least` readings.
template <class Same>
std::vector<UnusableSpan> find_runs(const std::vector<geometry::ImuSample>& samples, std::size_t least,
                                    const Same& same) {
  std::vector<UnusableSpan> runs;
  for (std::size_t first = 0, i = 1; i <= samples.size(); ++i) {
    if (i < samples.size() && same(samples[i - 1], samples[i])) continue;
    if (i - first >= least) runs.push_back(span_around(samples, first, i - 1));
    first = i;
  }
  return runs;
}

std::vector<UnusableSpan> find_saturation(const std::vector<geometry::ImuSample>& samples) {
  Vec6 largest = Vec6::Zero();
  for (const geometry::ImuSample& sample : samples) largest = largest.cwiseMax(values(sample).cwiseAbs());
  std::vector<UnusableSpan> saturated;
  for (int axis = 0; axis < 6; ++axis) {
    if (largest[axis] < (axis < 3 ? kSmallestRateRange : kSmallestForceRange)) continue;
    const auto at_end = [&](const geometry::ImuSample& sample) {
      return std::abs(values(sample)[axis]) == largest[axis];
    };
    const auto found =
        find_runs(samples, kSaturatedReadings, [&](const geometry::ImuSample& a, const geometry::ImuSample& b) {
          return at_end(a) && values(a)[axis] == values(b)[axis];
        });
    saturated.insert(saturated.end(), found.begin(), found.end());
  }
  return merged(std::move(saturated));
}

double total_s(const std::vector<UnusableSpan>& spans) {
  double sum_s = 0.0;
  for (const UnusableSpan& span : spans) sum_s += span.to_s - span.from_s;
  return sum_s;
}

void report(const std::string& what, const std::string& remedy, const std::string& where,
            const std::vector<UnusableSpan>& spans, ImuCheck& check) {
  if (spans.empty()) return;
  check.warnings.push_back({what + " " + std::to_string(spans.size()) + " times, " + text(total_s(spans)) +
                                " s in all, first at " + text(spans.front().from_s) +
                                " s; the images alone bridge these parts",
                            where, Severity::kNote, remedy});
  check.unusable.insert(check.unusable.end(), spans.begin(), spans.end());
}

}  // namespace

bool ImuCheck::covers(double from_s, double to_s) const {
  return std::none_of(unusable.begin(), unusable.end(),
                      [&](const UnusableSpan& span) { return span.from_s < to_s && span.to_s > from_s; });
}

ImuCheck check_readings(const std::vector<geometry::ImuSample>& samples, const ImuNoise& noise,
                        const std::string& where) {
  require_numbers(samples, where);
  require_change(samples, where);
  require_gravity(samples, where);
  std::vector<double> intervals;
  for (std::size_t i = 1; i < samples.size(); ++i) intervals.push_back(samples[i].time_s - samples[i - 1].time_s);
  const double interval_s = base::upper_median(std::move(intervals));
  ImuCheck check{.rate_hz = 1.0 / interval_s, .unusable = {}, .warnings = {}};
  report("the inertial unit's readings stop", "record without gaps", where, find_gaps(samples, interval_s), check);
  if (noise.gyroscope_noise_density > 0.0 && noise.accelerometer_noise_density > 0.0) {
    const auto frozen = static_cast<std::size_t>(std::max(4.0, std::ceil(kFrozen_s * check.rate_hz)));
    report("the inertial unit repeats the same reading", "check the unit's connection", where,
           find_runs(samples, frozen,
                     [](const geometry::ImuSample& a, const geometry::ImuSample& b) { return values(a) == values(b); }),
           check);
    report("the inertial unit saturates", "use a unit of a larger range, or fly more gently", where,
           find_saturation(samples), check);
  }
  check.unusable = merged(std::move(check.unusable));
  return check;
}

}  // namespace tileflight::inertial
