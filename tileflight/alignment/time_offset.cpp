#include "tileflight/alignment/time_offset.h"

#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <optional>

namespace tileflight::alignment {
namespace {

using geometry::Mat3;
using geometry::Vec3;

/// The valley around the best offset is looked at for so many steps at least and at most to either side, as long as no
/// more than this share of its height is climbed, at so many places to either side.
constexpr double kLeastReach = 2.0, kMostReach = 20.0, kGround = 0.3;
constexpr int kFitSteps = 8;
constexpr double kLeastLeft = 0.02;
/// A gap in a signal longer than this many windows is not bridged.
constexpr double kLongestGap = 3.0;

/// The integral of a signal over time, so that its average over any window is a difference. Linear between samples.
class Averaged {
 public:
  explicit Averaged(const std::vector<TimedVector>& signal) : signal_(signal), integral_(signal.size(), Vec3::Zero()) {
    for (std::size_t i = 1; i < signal.size(); ++i) {
      integral_[i] =
          integral_[i - 1] + 0.5 * (signal[i].time_s - signal[i - 1].time_s) * (signal[i].value + signal[i - 1].value);
    }
  }

  double start_s() const { return signal_.front().time_s; }
  double end_s() const { return signal_.back().time_s; }

  /// Mean over the window around a time; nullopt where the signal does not cover it or has a gap.
  std::optional<Vec3> mean(double time_s, double window_s) const {
    const double from_s = time_s - 0.5 * window_s, to_s = time_s + 0.5 * window_s;
    if (from_s < start_s() || to_s > end_s()) return std::nullopt;
    const std::size_t i = interval(from_s), j = interval(to_s);
    for (std::size_t k = i; k <= j; ++k) {
      if (signal_[k + 1].time_s - signal_[k].time_s > kLongestGap * window_s) return std::nullopt;
    }
    return Vec3((integral_at(to_s, j) - integral_at(from_s, i)) / window_s);
  }

 private:
  std::size_t interval(double time_s) const {
    const auto above = std::upper_bound(signal_.begin() + 1, signal_.end() - 1, time_s,
                                        [](double t, const TimedVector& sample) { return t < sample.time_s; });
    return static_cast<std::size_t>(above - signal_.begin()) - 1;
  }
  Vec3 integral_at(double time_s, std::size_t i) const {
    const TimedVector &a = signal_[i], &b = signal_[i + 1];
    const double share = (time_s - a.time_s) / (b.time_s - a.time_s);
    const Vec3 value = a.value + share * (b.value - a.value);
    return integral_[i] + 0.5 * (time_s - a.time_s) * (a.value + value);
  }

  const std::vector<TimedVector>& signal_;
  std::vector<Vec3> integral_;
};

using Polynomial = Eigen::Matrix<double, 5, 1>;  ///< coefficients of 1, x, .. x^4

/// Where a polynomial is least between -1 and 1.
double lowest(const Polynomial& p) {
  double best_x = 0.0, least = HUGE_VAL;
  for (int i = -5000; i <= 5000; ++i) {
    const double x = i / 5000.0, value = p[0] + x * (p[1] + x * (p[2] + x * (p[3] + x * p[4])));
    if (value < least) least = value, best_x = x;
  }
  return best_x;
}

using Samples = std::vector<std::optional<Vec3>>;

Samples sampled(const Averaged& signal, double start_s, std::size_t count, double step_s) {
  Samples samples(count);
  for (std::size_t i = 0; i < count; ++i) samples[i] = signal.mean(start_s + step_s * static_cast<double>(i), step_s);
  return samples;
}

/// How well the second signal explains the first at one offset.
struct Match {
  double offset_s = 0.0;
  std::size_t samples = 0;
  double left = 0.0, total = 0.0;  ///< sums of squares about the mean: after and before
  Mat3 R_first_second = Mat3::Identity();
  double scale = 1.0;
  Vec3 first_mean = Vec3::Zero(), second_mean = Vec3::Zero();
};

/// Of first[i] and second[i + shift], where both are there.
Match match(const Samples& first, const Samples& second, std::ptrdiff_t shift, bool estimate_scale) {
  Match m;
  Mat3 product = Mat3::Zero();
  double first_squares = 0.0, second_squares = 0.0;
  const auto size = static_cast<std::ptrdiff_t>(second.size());
  for (std::size_t i = 0; i < first.size(); ++i) {
    const std::ptrdiff_t j = static_cast<std::ptrdiff_t>(i) + shift;
    if (j < 0 || j >= size || !first[i] || !second[static_cast<std::size_t>(j)]) continue;
    const Vec3 &a = *first[i], &b = *second[static_cast<std::size_t>(j)];
    ++m.samples;
    m.first_mean += a;
    m.second_mean += b;
    product += a * b.transpose();
    first_squares += a.squaredNorm();
    second_squares += b.squaredNorm();
  }
  if (m.samples == 0) return m;
  const auto n = static_cast<double>(m.samples);
  m.first_mean /= n;
  m.second_mean /= n;
  product -= n * m.first_mean * m.second_mean.transpose();
  m.total = std::max(0.0, first_squares - n * m.first_mean.squaredNorm());
  const double other = std::max(0.0, second_squares - n * m.second_mean.squaredNorm());
  const Eigen::JacobiSVD<Mat3> svd(product, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Vec3 signs(1.0, 1.0, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0);
  m.R_first_second = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  const double along = signs.dot(svd.singularValues());
  if (estimate_scale) m.scale = other > 0.0 ? along / other : 0.0;
  m.left = std::max(0.0, m.total - 2.0 * m.scale * along + m.scale * m.scale * other);
  return m;
}

double explained(const Match& m) { return m.total > 0.0 ? 1.0 - m.left / m.total : 0.0; }

/// A signal's correlation with itself, by lag in steps, up to half its length.
std::vector<double> autocorrelation(const Samples& samples) {
  Vec3 mean = Vec3::Zero();
  double count = 0.0;
  for (const auto& value : samples) {
    if (value) mean += *value, count += 1.0;
  }
  if (count > 0.0) mean /= count;
  std::vector<double> products(samples.size() / 2 + 1, 0.0);
  for (std::size_t lag = 0; lag < products.size(); ++lag) {
    for (std::size_t i = lag; i < samples.size(); ++i) {
      if (samples[i] && samples[i - lag]) products[lag] += (*samples[i] - mean).dot(*samples[i - lag] - mean);
    }
  }
  const double variance = products[0];
  for (double& product : products) product = variance > 0.0 ? product / variance : 0.0;
  return products;
}

/// Correlation of a signal with itself one sample later, between 0 and 1.
double correlation_in_time(const Samples& samples) {
  const std::vector<double> correlation = autocorrelation(samples);
  return correlation.size() > 1 ? std::clamp(correlation[1], 0.0, 0.999) : 0.0;
}

/// In how many directions a signal changes, 1 to 3: the participation ratio of its variances along its axes.
double directions(const Samples& samples) {
  Mat3 moment = Mat3::Zero();
  Vec3 sum = Vec3::Zero();
  double count = 0.0;
  for (const auto& value : samples) {
    if (!value) continue;
    moment += *value * value->transpose();
    sum += *value;
    count += 1.0;
  }
  if (count == 0.0) return 1.0;
  const Mat3 variance = moment / count - sum * sum.transpose() / (count * count);
  const double squared = variance.squaredNorm();
  return squared > 0.0 ? variance.trace() * variance.trace() / squared : 1.0;
}

/// Share of the samples of two correlated signals that count for their correlation with one another: 1 / (1 + 2 sum of
/// the products of their autocorrelations).
double independent_share(const Samples& first, const Samples& second) {
  const std::vector<double> a = autocorrelation(first), b = autocorrelation(second);
  double sum = 0.0;
  for (std::size_t lag = 1; lag < std::min(a.size(), b.size()); ++lag) sum += a[lag] * b[lag];
  return 1.0 / std::max(1.0, 1.0 + 2.0 * sum);
}

/// What is left of the first signal at a match.
Samples residuals(const Samples& first, const Samples& second, std::ptrdiff_t shift, const Match& m) {
  Samples left(first.size());
  for (std::size_t i = 0; i < first.size(); ++i) {
    const std::ptrdiff_t j = static_cast<std::ptrdiff_t>(i) + shift;
    if (j < 0 || j >= static_cast<std::ptrdiff_t>(second.size())) continue;
    const auto& b = second[static_cast<std::size_t>(j)];
    if (first[i] && b) left[i] = (*first[i] - m.first_mean) - m.scale * (m.R_first_second * (*b - m.second_mean));
  }
  return left;
}

/// Log likelihood ratio of a match against no relation. Smoothed signals of few bends may match to any digit by chance:
/// more than most is not believed.
double gain(const Match& m, double independent_share) {
  const double share = std::max(kLeastLeft, 1.0 - std::max(0.0, explained(m)));
  return -0.5 * independent_share * static_cast<double>(m.samples) * std::log(share);
}

class Search {
 public:
  Search(const std::vector<TimedVector>& first, const std::vector<TimedVector>& second,
         const TimeOffsetOptions& options)
      : options_(options), first_signal_(first), second_signal_(second) {
    const double step_s = options.step_s;
    first_start_s_ = first_signal_.start_s() + 0.5 * step_s;
    second_start_s_ = second_signal_.start_s() + 0.5 * step_s;
    first_ = sampled(first_signal_, first_start_s_, count(first_signal_), step_s);
    second_ = sampled(second_signal_, second_start_s_, count(second_signal_), step_s);
    independent_share_ = directions(first_) * independent_share(first_, second_);
  }

  TimeOffset run() {
    const std::vector<Match> coarse = all_matches();
    if (coarse.empty()) return refused({}, "the two have too little time in common");
    std::vector<double> gains;
    for (const Match& m : coarse) gains.push_back(gain(m, independent_share_));
    const auto best = static_cast<std::size_t>(std::max_element(gains.begin(), gains.end()) - gains.begin());
    TimeOffset result = refined(coarse[best]);
    const bool is_alone = second_peak(gains, best) <= gains[best] - options_.least_lead;
    if (!is_alone && result.explained > 0.5)
      return refused(result, "another offset is nearly as good: the motion repeats itself");
    if (!is_alone || gains[best] < options_.least_gain)
      return refused(result, "the motion is too even: the two do not tell of one another");
    if (best == 0 || best + 1 == coarse.size()) return refused(result, "the best offset leaves the least overlap");
    if (result.sigma_s > options_.step_s * kLongestGap) return refused(result, "the motion changes too slowly");
    result.determined = true;
    return result;
  }

 private:
  std::size_t count(const Averaged& signal) const {
    return static_cast<std::size_t>(std::max(0.0, (signal.end_s() - signal.start_s()) / options_.step_s));
  }
  static TimeOffset refused(TimeOffset result, const std::string& reason) {
    result.determined = false;
    result.reason = reason;
    return result;
  }

  /// Offset of the clocks where first[i] lies beside second[i + shift].
  double offset_s(std::ptrdiff_t shift) const {
    return first_start_s_ - second_start_s_ - options_.step_s * static_cast<double>(shift);
  }

  std::vector<Match> all_matches() const {
    const double shorter_s = options_.step_s * static_cast<double>(std::min(first_.size(), second_.size()));
    const auto least = static_cast<std::size_t>(std::max(options_.least_overlap_s, 0.5 * shorter_s) / options_.step_s);
    std::vector<Match> matches;
    const auto begin = -static_cast<std::ptrdiff_t>(first_.size()), end = static_cast<std::ptrdiff_t>(second_.size());
    for (std::ptrdiff_t shift = begin; shift < end; ++shift) {
      const std::ptrdiff_t overlap =
          std::min(end, static_cast<std::ptrdiff_t>(first_.size()) + shift) - std::max<std::ptrdiff_t>(0, shift);
      if (overlap < static_cast<std::ptrdiff_t>(least)) continue;
      Match m = match(first_, second_, shift, options_.estimate_scale);
      if (m.samples < least) continue;
      m.offset_s = offset_s(shift);
      matches.push_back(m);
    }
    return matches;
  }

  /// The best gain beyond the best peak's own flanks.
  static double second_peak(const std::vector<double>& gains, std::size_t best) {
    std::size_t from = best, to = best;
    while (from > 0 && gains[from - 1] <= gains[from]) --from;
    while (to + 1 < gains.size() && gains[to + 1] <= gains[to]) ++to;
    double second = 0.0;
    for (std::size_t i = 0; i < gains.size(); ++i) {
      if (i < from || i > to) second = std::max(second, gains[i]);
    }
    return second;
  }

  /// The match at an offset between the steps: the second signal averaged where it then belongs.
  Match match_at(double offset, Samples* left) const {
    Samples second(first_.size());
    for (std::size_t i = 0; i < first_.size(); ++i)
      second[i] =
          second_signal_.mean(first_start_s_ + options_.step_s * static_cast<double>(i) - offset, options_.step_s);
    Match m = match(first_, second, 0, options_.estimate_scale);
    m.offset_s = offset;
    if (left != nullptr) *left = residuals(first_, second, 0, m);
    return m;
  }

  double left_at(double offset) const { return 1.0 - explained(match_at(offset, nullptr)); }

  /// How far to either side the valley of the share that is left is still near its ground.
  double reach_s(double center, double least) const {
    double reach = kLeastReach * options_.step_s;
    const double limit = least + kGround * (1.0 - least);
    while (reach < kMostReach * options_.step_s && left_at(center - reach) < limit && left_at(center + reach) < limit)
      reach += options_.step_s;
    return reach;
  }

  /// The share that is left around an offset as a polynomial of x = (offset - center) / reach, by least squares: noise
  /// makes the bottom of the valley rough, its ground as a whole tells where the least is.
  Polynomial polynomial(double center, double reach) const {
    Eigen::Matrix<double, 2 * kFitSteps + 1, 5> powers;
    Eigen::Matrix<double, 2 * kFitSteps + 1, 1> left;
    for (int i = -kFitSteps; i <= kFitSteps; ++i) {
      const double x = static_cast<double>(i) / kFitSteps;
      powers.row(i + kFitSteps) << 1.0, x, x * x, x * x * x, x * x * x * x;
      left[i + kFitSteps] = left_at(center + x * reach);
    }
    return powers.householderQr().solve(left);
  }

  /// The valley's lowest place, and its bend there: half the second derivative of the share by time. For squares,
  /// sum(t) = sum(t0) + k (t - t0)^2, the variance of t0 is that of a residual over k.
  TimeOffset refined(const Match& coarse) const {
    double center = coarse.offset_s, bend = 0.0;
    for (int round = 0; round < 2; ++round) {
      const double reach = reach_s(center, left_at(center));
      const Polynomial p = polynomial(center, reach);
      const double x = lowest(p);
      bend = (p[2] + 3.0 * p[3] * x + 6.0 * p[4] * x * x) / (reach * reach);
      center += x * reach;
    }
    TimeOffset result;
    result.offset_s = center;
    Samples left;
    const Match best = match_at(result.offset_s, &left);
    result.explained = explained(best);
    result.R_first_second = best.R_first_second;
    result.scale = best.scale;
    const double rho = correlation_in_time(left), n = static_cast<double>(best.samples);
    result.independent = 3.0 * n * (1.0 - rho) / (1.0 + rho);
    result.sigma_s =
        bend > 0.0 ? std::sqrt((1.0 - result.explained) / (bend * std::max(1.0, result.independent))) : HUGE_VAL;
    return result;
  }

  TimeOffsetOptions options_;
  Averaged first_signal_, second_signal_;
  double first_start_s_ = 0.0, second_start_s_ = 0.0;
  Samples first_, second_;
  double independent_share_ = 1.0;
};

}  // namespace

TimeOffset estimate_time_offset(const std::vector<TimedVector>& first, const std::vector<TimedVector>& second,
                                const TimeOffsetOptions& options) {
  if (first.size() < 2 || second.size() < 2) {
    TimeOffset result;
    result.reason = "one of the two has fewer than two samples";
    return result;
  }
  return Search(first, second, options).run();
}

}  // namespace tileflight::alignment
