#include "tileflight/core/alignment/time_offset.h"

#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <optional>

namespace tileflight::alignment {
namespace {

using geometry::Mat3;
using geometry::Vec3;

/// Fit of the minimum around the best offset: reach on either side in steps (limits), share of the valley's depth that
/// it may climb, and samples on either side. Chosen by hand.
constexpr double kMinReach = 2.0, kMaxReach = 20.0, kValleyShare = 0.3;
constexpr int kFitSteps = 8;
constexpr double kMinResidualShare = 0.02;
/// Gaps longer than this many windows are not interpolated.
constexpr double kLongestGap = 3.0;

/// Integral of a signal over time, so that the mean over any window is a difference. Linear between samples.
class WindowedMean {
 public:
  explicit WindowedMean(const std::vector<TimedVector>& signal)
      : signal_(signal), integral_(signal.size(), Vec3::Zero()) {
    for (std::size_t i = 1; i < signal.size(); ++i) {
      integral_[i] =
          integral_[i - 1] + 0.5 * (signal[i].time_s - signal[i - 1].time_s) * (signal[i].value + signal[i - 1].value);
    }
  }

  double start_s() const { return signal_.front().time_s; }
  double end_s() const { return signal_.back().time_s; }

  /// Mean over the window around a time; nullopt if the signal does not cover it or has a gap.
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

/// Location of a polynomial's minimum in [-1, 1].
double argmin(const Polynomial& p) {
  double best_x = 0.0, least = HUGE_VAL;
  for (int i = -5000; i <= 5000; ++i) {
    const double x = i / 5000.0, value = p[0] + x * (p[1] + x * (p[2] + x * (p[3] + x * p[4])));
    if (value < least) least = value, best_x = x;
  }
  return best_x;
}

using Samples = std::vector<std::optional<Vec3>>;

Samples resample(const WindowedMean& signal, double start_s, std::size_t count, double step_s) {
  Samples samples(count);
  for (std::size_t i = 0; i < count; ++i) samples[i] = signal.mean(start_s + step_s * static_cast<double>(i), step_s);
  return samples;
}

/// Fit of the second signal to the first at one offset.
struct OffsetMatch {
  double offset_s = 0.0;
  std::size_t samples = 0;
  double residual = 0.0, total = 0.0;  ///< sums of squares about the mean, after and before the fit
  Mat3 R_first_second = Mat3::Identity();
  double scale = 1.0;
  Vec3 first_mean = Vec3::Zero(), second_mean = Vec3::Zero();
};

/// Match of first[i] with second[i + shift], where both exist.
OffsetMatch match_at_shift(const Samples& first, const Samples& second, std::ptrdiff_t shift, bool estimate_scale) {
  OffsetMatch m;
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
  m.residual = std::max(0.0, m.total - 2.0 * m.scale * along + m.scale * m.scale * other);
  return m;
}

double explained_share(const OffsetMatch& m) { return m.total > 0.0 ? 1.0 - m.residual / m.total : 0.0; }

/// Autocorrelation of a signal by lag in steps, up to half its length.
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

/// Autocorrelation of a signal at lag one, clamped to 0..1.
double correlation_in_time(const Samples& samples) {
  const std::vector<double> correlation = autocorrelation(samples);
  return correlation.size() > 1 ? std::clamp(correlation[1], 0.0, 0.999) : 0.0;
}

/// Effective number of directions in which a signal varies, 1 to 3: the participation ratio of its variances along its
/// axes.
double count_directions(const Samples& samples) {
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

/// Effective share of independent samples for the correlation of two autocorrelated signals: 1 / (1 + 2 sum of the
/// products of their autocorrelations).
double independent_share(const Samples& first, const Samples& second) {
  const std::vector<double> a = autocorrelation(first), b = autocorrelation(second);
  double sum = 0.0;
  for (std::size_t lag = 1; lag < std::min(a.size(), b.size()); ++lag) sum += a[lag] * b[lag];
  return 1.0 / std::max(1.0, 1.0 + 2.0 * sum);
}

/// Residual of the first signal at a match.
Samples residuals(const Samples& first, const Samples& second, std::ptrdiff_t shift, const OffsetMatch& m) {
  Samples left(first.size());
  for (std::size_t i = 0; i < first.size(); ++i) {
    const std::ptrdiff_t j = static_cast<std::ptrdiff_t>(i) + shift;
    if (j < 0 || j >= static_cast<std::ptrdiff_t>(second.size())) continue;
    const auto& b = second[static_cast<std::size_t>(j)];
    if (first[i] && b) left[i] = (*first[i] - m.first_mean) - m.scale * (m.R_first_second * (*b - m.second_mean));
  }
  return left;
}

/// Log likelihood ratio of a match against no relation. Smooth signals with little structure may match arbitrarily well
/// by chance, so the residual share is limited from below.
double log_likelihood_gain(const OffsetMatch& m, double independent_share) {
  const double share = std::max(kMinResidualShare, 1.0 - std::max(0.0, explained_share(m)));
  return -0.5 * independent_share * static_cast<double>(m.samples) * std::log(share);
}

class OffsetSearch {
 public:
  OffsetSearch(const std::vector<TimedVector>& first, const std::vector<TimedVector>& second,
               const TimeOffsetOptions& options)
      : options_(options), first_signal_(first), second_signal_(second) {
    const double step_s = options.step_s;
    first_start_s_ = first_signal_.start_s() + 0.5 * step_s;
    second_start_s_ = second_signal_.start_s() + 0.5 * step_s;
    first_ = resample(first_signal_, first_start_s_, count(first_signal_), step_s);
    second_ = resample(second_signal_, second_start_s_, count(second_signal_), step_s);
    independent_share_ = count_directions(first_) * independent_share(first_, second_);
  }

  TimeOffset run() {
    const std::vector<OffsetMatch> coarse = all_matches();
    if (coarse.empty()) return reject({}, "the two signals overlap too little in time");
    std::vector<double> gains;
    for (const OffsetMatch& m : coarse) gains.push_back(log_likelihood_gain(m, independent_share_));
    const auto best = static_cast<std::size_t>(std::max_element(gains.begin(), gains.end()) - gains.begin());
    TimeOffset result = refine(coarse[best]);
    const bool is_alone = second_peak(gains, best) <= gains[best] - options_.min_log_likelihood_lead;
    if (!is_alone && result.explained_variance > 0.5)
      return reject(result, "another offset fits nearly as well because the motion repeats");
    if (!is_alone || gains[best] < options_.min_log_likelihood_gain)
      return reject(result, "the motion is too uniform to match the two signals");
    if (best == 0 || best + 1 == coarse.size())
      return reject(result, "the best offset lies at the edge of the search range");
    if (result.sigma_s > options_.step_s * kLongestGap) return reject(result, "the motion changes too slowly");
    result.determined = true;
    return result;
  }

 private:
  std::size_t count(const WindowedMean& signal) const {
    return static_cast<std::size_t>(std::max(0.0, (signal.end_s() - signal.start_s()) / options_.step_s));
  }
  static TimeOffset reject(TimeOffset result, const std::string& reason) {
    result.determined = false;
    result.reason = reason;
    return result;
  }

  /// Offset of the clocks where first[i] lies beside second[i + shift].
  double offset_s(std::ptrdiff_t shift) const {
    return first_start_s_ - second_start_s_ - options_.step_s * static_cast<double>(shift);
  }

  std::vector<OffsetMatch> all_matches() const {
    const double shorter_s = options_.step_s * static_cast<double>(std::min(first_.size(), second_.size()));
    const auto least = static_cast<std::size_t>(std::max(options_.min_overlap_s, 0.5 * shorter_s) / options_.step_s);
    std::vector<OffsetMatch> matches;
    const auto begin = -static_cast<std::ptrdiff_t>(first_.size()), end = static_cast<std::ptrdiff_t>(second_.size());
    for (std::ptrdiff_t shift = begin; shift < end; ++shift) {
      const std::ptrdiff_t overlap =
          std::min(end, static_cast<std::ptrdiff_t>(first_.size()) + shift) - std::max<std::ptrdiff_t>(0, shift);
      if (overlap < static_cast<std::ptrdiff_t>(least)) continue;
      OffsetMatch m = match_at_shift(first_, second_, shift, options_.estimate_scale);
      if (m.samples < least) continue;
      m.offset_s = offset_s(shift);
      matches.push_back(m);
    }
    return matches;
  }

  /// Largest gain outside the flanks of the best peak.
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

  /// Match at an offset between steps, with the second signal averaged over the shifted windows.
  OffsetMatch match_at(double offset, Samples* left) const {
    Samples second(first_.size());
    for (std::size_t i = 0; i < first_.size(); ++i)
      second[i] =
          second_signal_.mean(first_start_s_ + options_.step_s * static_cast<double>(i) - offset, options_.step_s);
    OffsetMatch m = match_at_shift(first_, second, 0, options_.estimate_scale);
    m.offset_s = offset;
    if (left != nullptr) *left = residuals(first_, second, 0, m);
    return m;
  }

  double residual_share_at(double offset) const { return 1.0 - explained_share(match_at(offset, nullptr)); }

  /// Half width of the minimum of the residual share.
  double reach_s(double center, double least) const {
    double reach = kMinReach * options_.step_s;
    const double limit = least + kValleyShare * (1.0 - least);
    while (reach < kMaxReach * options_.step_s && residual_share_at(center - reach) < limit &&
           residual_share_at(center + reach) < limit)
      reach += options_.step_s;
    return reach;
  }

  /// Least-squares polynomial of the residual share in x = (offset - center) / reach. Noise makes the bottom of the
  /// minimum rough, so its location is taken from the fit.
  Polynomial fit_polynomial(double center, double reach) const {
    Eigen::Matrix<double, 2 * kFitSteps + 1, 5> powers;
    Eigen::Matrix<double, 2 * kFitSteps + 1, 1> left;
    for (int i = -kFitSteps; i <= kFitSteps; ++i) {
      const double x = static_cast<double>(i) / kFitSteps;
      powers.row(i + kFitSteps) << 1.0, x, x * x, x * x * x, x * x * x * x;
      left[i + kFitSteps] = residual_share_at(center + x * reach);
    }
    return powers.householderQr().solve(left);
  }

  /// Location of the minimum, and its curvature: half the second derivative of the share by time. For squares, sum(t) =
  /// sum(t0) + k (t - t0)^2, the variance of t0 is that of a residual over k.
  TimeOffset refine(const OffsetMatch& coarse) const {
    double center = coarse.offset_s, bend = 0.0;
    for (int round = 0; round < 2; ++round) {
      const double reach = reach_s(center, residual_share_at(center));
      const Polynomial p = fit_polynomial(center, reach);
      const double x = argmin(p);
      bend = (p[2] + 3.0 * p[3] * x + 6.0 * p[4] * x * x) / (reach * reach);
      center += x * reach;
    }
    TimeOffset result;
    result.offset_s = center;
    Samples left;
    const OffsetMatch best = match_at(result.offset_s, &left);
    result.explained_variance = explained_share(best);
    result.R_first_second = best.R_first_second;
    result.scale = best.scale;
    const double rho = correlation_in_time(left), n = static_cast<double>(best.samples);
    result.independent_samples = 3.0 * n * (1.0 - rho) / (1.0 + rho);
    result.sigma_s =
        bend > 0.0 ? std::sqrt((1.0 - result.explained_variance) / (bend * std::max(1.0, result.independent_samples)))
                   : HUGE_VAL;
    return result;
  }

  TimeOffsetOptions options_;
  WindowedMean first_signal_, second_signal_;
  double first_start_s_ = 0.0, second_start_s_ = 0.0;
  Samples first_, second_;
  double independent_share_ = 1.0;
};

}  // namespace

TimeOffset estimate_time_offset(const std::vector<TimedVector>& first, const std::vector<TimedVector>& second,
                                const TimeOffsetOptions& options) {
  if (first.size() < 2 || second.size() < 2) {
    TimeOffset result;
    result.reason = "one of the two signals has fewer than two samples";
    return result;
  }
  return OffsetSearch(first, second, options).run();
}

}  // namespace tileflight::alignment
