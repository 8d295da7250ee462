#include "tileflight/slam/inertial/align_to_gravity.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <numeric>
#include <span>
#include <string>

#include "tileflight/core/alignment/time_offset.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/geometry/transform.h"
#include "tileflight/slam/inertial/imu_check.h"
#include "tileflight/slam/inertial/imu_samples.h"
#include "tileflight/slam/inertial/inertial_start.h"

namespace tileflight::inertial {

namespace {

/// Result of compare_gyroscope(). Shares are of the variance of the gyroscope's mean rates from image to image.
struct GyroscopeComparison {
  bool determined = false;  ///< whether offset, factor and rotation are known
  double offset_s = 0.0;    ///< the unit's clock minus the camera's
  double sigma_s = 0.0;
  double rate_factor = 1.0;  ///< the gyroscope's rates over the camera's: 57.3 if they are in degrees
  Eigen::Quaterniond R_imu_camera = Eigen::Quaterniond::Identity();  ///< that fits best
  double explained_share = 0.0;  ///< by the camera's rates, turned by the given mounting
  double best_share = 0.0;       ///< by the camera's rates, turned by the rotation that fits best
  std::string reason;            ///< why it is not determined
};

using alignment::TimedVector;
using geometry::Mat3;
using geometry::Vec3;

/// The camera's mean rate from each pose to the next, in its own axes, at the middle of the interval.
std::vector<TimedVector> camera_rates(const geometry::Trajectory& path) {
  std::vector<TimedVector> rates;
  for (std::size_t i = 1; i < path.size(); ++i) {
    const geometry::StampedPose &a = path.poses[i - 1], &b = path.poses[i];
    const Vec3 turn = geometry::so3_log(a.T_local_camera.rotation.conjugate() * b.T_local_camera.rotation);
    rates.push_back({0.5 * (a.time_s + b.time_s), turn / (b.time_s - a.time_s)});
  }
  return rates;
}

std::vector<TimedVector> gyroscope_rates(std::span<const geometry::ImuSample> samples) {
  std::vector<TimedVector> rates;
  rates.reserve(samples.size());
  for (const geometry::ImuSample& sample : samples) rates.push_back({sample.time_s, sample.angular_rate_rad_s});
  return rates;
}

/// Length of the windows that both are averaged over: no shorter than the images are apart.
double window_s(const std::vector<TimedVector>& camera) {
  std::vector<double> intervals{0.1};
  for (std::size_t i = 1; i < camera.size(); ++i) intervals.push_back(camera[i].time_s - camera[i - 1].time_s);
  const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
  std::nth_element(intervals.begin(), middle, intervals.end());
  return std::max(0.1, *middle);
}

/// Pairs of mean rates, about their means.
struct RatePairs {
  Eigen::Matrix3Xd camera, gyroscope;
};

RatePairs pair_rates(const std::vector<TimedVector>& camera, std::span<const geometry::ImuSample> samples,
                     double offset_s, double window_s) {
  std::vector<Vec3> ours, theirs;
  auto from = samples.begin(), to = samples.begin();
  for (const TimedVector& rate : camera) {
    const double middle_s = rate.time_s + offset_s;
    while (from != samples.end() && from->time_s < middle_s - 0.5 * window_s) ++from;
    while (to != samples.end() && to->time_s <= middle_s + 0.5 * window_s) ++to;
    if (to - from < 2) continue;
    Vec3 sum = Vec3::Zero();
    for (auto sample = from; sample != to; ++sample) sum += sample->angular_rate_rad_s;
    ours.push_back(rate.value);
    theirs.push_back(sum / static_cast<double>(to - from));
  }
  const auto centred = [](const std::vector<Vec3>& list) {
    Eigen::Matrix3Xd m(3, list.size());
    for (std::size_t i = 0; i < list.size(); ++i) m.col(static_cast<Eigen::Index>(i)) = list[i];
    return Eigen::Matrix3Xd(m.colwise() - m.rowwise().mean());
  };
  return ours.empty() ? RatePairs{} : RatePairs{centred(ours), centred(theirs)};
}

double explained_share(const RatePairs& pairs, double factor, const Mat3& R_imu_camera) {
  const double whole = pairs.gyroscope.squaredNorm();
  return whole > 0.0 ? 1.0 - (pairs.gyroscope - factor * R_imu_camera * pairs.camera).squaredNorm() / whole : 0.0;
}

/// `path`: the camera's poses in any frame. `R_imu_camera`: the mounting as given.
GyroscopeComparison compare_gyroscope(const geometry::Trajectory& path, std::span<const geometry::ImuSample> samples,
                                      const Eigen::Quaterniond& R_imu_camera) {
  GyroscopeComparison comparison;
  comparison.R_imu_camera = R_imu_camera;
  const std::vector<TimedVector> camera = camera_rates(path);
  if (camera.size() < 2 || samples.size() < 2) {
    comparison.reason = "there are too few images";
    return comparison;
  }
  alignment::TimeOffsetOptions options;
  options.step_s = window_s(camera);
  options.estimate_scale = true;
  const alignment::TimeOffset found = alignment::estimate_time_offset(gyroscope_rates(samples), camera, options);
  comparison.reason = found.reason;
  comparison.determined = found.determined;
  if (!found.determined) return comparison;
  comparison.offset_s = found.offset_s;
  comparison.sigma_s = found.sigma_s;
  comparison.R_imu_camera = Eigen::Quaterniond(found.R_first_second).normalized();
  const RatePairs pairs = pair_rates(camera, samples, found.offset_s, options.step_s);
  if (pairs.camera.size() == 0 || !(pairs.camera.squaredNorm() > 0.0)) return comparison;
  comparison.rate_factor = std::sqrt(pairs.gyroscope.squaredNorm() / pairs.camera.squaredNorm());
  comparison.explained_share = explained_share(pairs, comparison.rate_factor, R_imu_camera.toRotationMatrix());
  comparison.best_share = explained_share(pairs, comparison.rate_factor, found.R_first_second);
  return comparison;
}

using Eigen::Index;
using Eigen::VectorXd;
using geometry::SE3;
using geometry::Vec3;

std::string number(double value, const char* format = "%.3g") {
  char digits[32];
  std::snprintf(digits, sizeof digits, format, value);
  return digits;
}

/// The result without a scale, for this reason.
void give_up(const std::string& reason, const std::string& remedy, const std::string& where,
             InertialAlignment& result) {
  result.metric = false;
  result.reason = reason;
  // Certain, but no reason against a verdict: alignment finds the scale, as it does for every monocular map.
  const std::string what =
      result.was_metric ? "the map is not level: " : "the map's scale is not known, its units are arbitrary: ";
  result.warnings.push_back({what + reason, where, Severity::kNote, remedy});
}

struct Clock {
  double offset_s = 0.0, sigma_s = 0.1;
};

/// The clocks' offset by the rotations, and whether units and mounting fit them. nullopt if they do not, which is said
/// in `result`.
std::optional<Clock> compare_rotations(const geometry::Trajectory& images, const InertialInput& input,
                                       const InertialLimits& limits, InertialAlignment& result) {
  const Eigen::Quaterniond& R_imu_camera = input.model.T_imu_camera.rotation;
  const GyroscopeComparison turns = compare_gyroscope(images, input.samples, R_imu_camera);
  if (!turns.determined) return Clock{};
  if (turns.rate_factor > 20.0 && turns.rate_factor < 160.0) {
    give_up(
        "the gyroscope's rates are " + number(turns.rate_factor) + " times the camera's: they are in degrees a second",
        "give them in radians a second", input.where, result);
    return std::nullopt;
  }
  const double turned_rad = turns.R_imu_camera.angularDistance(R_imu_camera);
  if (turns.best_share > 0.8 && turns.best_share - turns.explained_share > 0.2 &&
      turned_rad > limits.max_mounting_error_rad) {
    give_up("the unit is mounted otherwise than the calibration's T_cam_imu says: the rotations of both differ by " +
                number(turned_rad / geometry::kRadiansPerDegree) + " degrees",
            "correct T_cam_imu in camera.yaml, or the order and signs of the unit's axes", input.where, result);
    return std::nullopt;
  }
  return Clock{turns.offset_s, std::clamp(3.0 * turns.sigma_s, 0.002, 0.1)};
}

double covered_share(const VisualInertialProblem& problem) {
  double covered_s = 0.0;
  const auto& keyframes = problem.keyframes();
  for (std::size_t k = 0; k + 1 < keyframes.size(); ++k) {
    if (problem.has_samples(k)) covered_s += keyframes[k + 1].time_s - keyframes[k].time_s;
  }
  return covered_s / (keyframes.back().time_s - keyframes.front().time_s);
}

/// Levenberg and Marquardt's iteration until the cost hardly falls.
VisualInertialState optimized(const VisualInertialProblem& problem, VisualInertialState state) {
  constexpr int kMost = 60;
  double damping = 1e-6;
  SparseLeastSquares at = problem.linearize(state);
  for (int iteration = 0; iteration < kMost && damping < 1e6; ++iteration) {
    const auto step = at.step(damping);
    if (!step) {
      damping = std::max(10.0 * damping, 1e-6);
      continue;
    }
    VisualInertialState next = problem.moved(state, *step);
    SparseLeastSquares there = problem.linearize(next);
    if (!(there.cost() < at.cost())) {
      if (step->cwiseAbs().maxCoeff() < 1e-9) break;
      damping *= 10.0;
      continue;
    }
    const bool settled = at.cost() - there.cost() < 1e-9 * at.cost() + 1e-9;
    state = std::move(next);
    at = std::move(there);
    damping = std::max(0.1 * damping, 1e-12);
    if (settled) break;
  }
  return state;
}

struct Solution {
  std::shared_ptr<const VisualInertialProblem> problem;  ///< integrated at the offset of `state`
  VisualInertialState state;
  double cost = 0.0;
};

/// Solves the problem from `start`, and again with the samples integrated at the offset found, until that stays.
Solution solved(const VisualInertialProblem& problem, const VisualInertialState& start) {
  constexpr int kMost = 10;
  constexpr double kSame_s = 2e-5;
  auto at = std::make_shared<const VisualInertialProblem>(problem.integrated_at(start.time_offset_s));
  VisualInertialState state = optimized(*at, start);
  for (int round = 0; round < kMost && std::abs(state.time_offset_s - at->integration_offset_s()) > kSame_s; ++round) {
    auto next = std::make_shared<const VisualInertialProblem>(problem.integrated_at(state.time_offset_s));
    state = optimized(*next, at->carried_over(state, *next));
    at = std::move(next);
  }
  const double cost = at->linearize(state).cost();
  return {std::move(at), std::move(state), cost};
}

/// The least cost that iterations from closed-form starts lead to: at the clocks' offset that rotations show, and
/// without one, since a flight that hardly turns shows an offset that is off by far, and steps that count less where
/// they do not fit make a wrong scale a minimum, too. nullopt without any start. `rival`: the other minimum, where it
/// is another.
std::optional<Solution> best_solution(const VisualInertialProblem& problem, std::optional<Solution>& rival) {
  constexpr double kSame_s = 5e-3;
  std::vector<double> offsets_s = {problem.time_offset_s()};
  if (std::abs(offsets_s[0]) > kSame_s) offsets_s.push_back(0.0);
  std::optional<Solution> best;
  for (const double offset_s : offsets_s) {
    const auto start = inertial_start(problem, offset_s);
    if (!start) continue;
    Solution found = solved(problem, *start);
    if (best) rival = found.cost < best->cost ? *best : found;
    if (!best || found.cost < best->cost) best = std::move(found);
  }
  return best;
}

/// Whether another scale fits nearly as well.
bool is_ambiguous(const Solution& best, const std::optional<Solution>& rival, double sigma_log_scale) {
  constexpr double kSigmas = 3.0;
  if (!rival || rival->cost - best.cost > kSigmas * kSigmas) return false;
  const auto mean = [](const std::vector<double>& list) {
    return std::accumulate(list.begin(), list.end(), 0.0) / static_cast<double>(list.size());
  };
  return std::abs(mean(rival->state.log_scale) - mean(best.state.log_scale)) > kSigmas * sigma_log_scale;
}

/// Root mean square of the samples' residuals over their sigmas.
double residual_ratio(const VisualInertialProblem& problem, const VisualInertialState& state) {
  double sum = 0.0;
  int count = 0;
  for (std::size_t k = 0; k + 1 < state.states.size(); ++k) {
    const auto between = problem.preintegrate_step(k, problem.integration_offset_s(), state.states[k].bias);
    if (!between) continue;
    const auto r =
        inertial_residual(*between, state.states[k], state.states[k + 1], problem.model().gravity_m_s2).value;
    sum += r.dot(between->covariance.ldlt().solve(r));
    count += 9;
  }
  return count > 0 ? std::sqrt(sum / count) : 0.0;
}

/// See InertialAlignment::latest_covariance.
Mat12 latest_covariance(const VisualInertialProblem& problem, const VisualInertialState& state,
                        const Eigen::SparseMatrix<double>& information) {
  const Index at = VisualInertialProblem::kKeyframeSize * (problem.keyframe_count() - 1);
  const geometry::Mat3 R = state.states.back().T_world_imu.rotation.toRotationMatrix();
  Eigen::MatrixXd functions = Eigen::MatrixXd::Zero(problem.unknowns(), 12);
  functions.block<3, 2>(at + kRotation, 0) = R.topRows<2>().transpose();
  functions(at + kStateSize, 2) = 1.0;
  functions.block<3, 3>(at + kVelocity, 3) = R;
  functions.block<3, 3>(at + kRotation, 3) =
      geometry::skew(R.transpose() * state.states.back().velocity_m_s).transpose();
  functions.block<6, 6>(at + kGyroscopeBias, 6).setIdentity();
  return covariance_of(information, functions);
}

/// Standard deviation of the clocks' offset, at most that of the prior.
double sigma_of_offset(const VisualInertialProblem& problem, const Eigen::SparseMatrix<double>& information) {
  const double variance = variance_of(information, VectorXd::Unit(problem.unknowns(), problem.time_offset_column()));
  const double prior = 1.0 / (problem.time_offset_sigma_s() * problem.time_offset_sigma_s());
  return 1.0 / std::sqrt(std::max(1.0 / variance - problem.information_of_noise(), prior));
}

void set_uncertainties(const VisualInertialProblem& problem, const VisualInertialState& state,
                       InertialAlignment& result) {
  const auto information = problem.linearize(state).information();
  VectorXd mean = VectorXd::Zero(problem.unknowns());
  for (Index k = 0; k < problem.keyframe_count(); ++k)
    mean[VisualInertialProblem::kKeyframeSize * k + kStateSize] = 1.0 / static_cast<double>(problem.keyframe_count());
  result.sigma_log_scale = std::sqrt(variance_of(information, mean));
  result.sigma_time_offset_s = sigma_of_offset(problem, information);
  // The camera's vertical, which is the map's: the unit is tilted, or the camera is against it.
  const geometry::Mat3 R = state.states.front().T_world_imu.rotation.toRotationMatrix();
  const geometry::Mat3 R_camera = R * state.T_imu_camera.rotation.toRotationMatrix();
  double tilt = 0.0;  // variance about the two horizontal axes
  for (const Index axis : {0, 1}) {
    VectorXd about = VectorXd::Zero(problem.unknowns());
    about.segment<3>(kRotation) = R.row(axis);
    about.segment<3>(problem.time_offset_column() + 1) = R_camera.row(axis);
    tilt += variance_of(information, about);
  }
  result.sigma_up_rad = std::sqrt(tilt);
  result.latest_covariance = latest_covariance(problem, state, information);
}

/// Path, scales, velocities and biases, moved so that the first keyframe is at the origin.
void set_path(const VisualInertialState& state, InertialAlignment& result) {
  const Vec3 origin = (state.states.front().T_world_imu * state.T_imu_camera).translation;
  double sum = 0.0;
  for (std::size_t k = 0; k < state.states.size(); ++k) {
    SE3 T_world_camera = state.states[k].T_world_imu * state.T_imu_camera;
    T_world_camera.translation -= origin;
    result.T_world_camera.push_back(T_world_camera);
    result.scale.push_back(std::exp(state.log_scale[k]));
    result.velocity_m_s.push_back(state.states[k].velocity_m_s);
    result.bias.push_back(state.states[k].bias);
    sum += state.log_scale[k];
  }
  result.mean_scale = std::exp(sum / static_cast<double>(state.states.size()));
}

/// Whether the iteration ran away to where only the priors hold it, which make the scale look sure.
bool ran_away(const VisualInertialState& state) {
  constexpr double kFastest_m_s = 1000.0;
  return std::ranges::any_of(state.states, [](const ImuState& at) { return !(at.velocity_m_s.norm() < kFastest_m_s); });
}

/// Whether what was found deserves belief; sets `metric`.
void judge(const InertialInput& input, const InertialLimits& limits, InertialAlignment& result) {
  if (!(result.sigma_log_scale <= limits.max_sigma_log_scale)) {
    const std::string sigma = std::isfinite(result.sigma_log_scale) && result.sigma_log_scale < 1.0
                                  ? "its standard deviation is " + number(100.0 * result.sigma_log_scale) + " %"
                                  : "nothing determines it";
    give_up(
        "the flight's accelerations do not show it (" + sigma + ")",
        "fly with changes of speed and direction, since at constant velocity no accelerometer can measure a distance",
        input.where, result);
  } else if (result.residual_ratio > limits.max_residual_ratio) {
    give_up("the unit's readings do not fit the camera's path (residuals of " + number(result.residual_ratio) +
                " times their sigmas)",
            "check T_cam_imu, the clocks, and the noise that imu.yaml states", input.where, result);
  } else {
    result.metric = true;
  }
}

void require_common_time(const std::vector<VisualKeyframe>& keyframes, const InertialInput& input) {
  const double from_s = input.samples.front().time_s, to_s = input.samples.back().time_s;
  if (from_s < keyframes.back().time_s && to_s > keyframes.front().time_s) return;
  throw InputError(input.where, "its times, " + number(from_s, "%.3f") + " to " + number(to_s, "%.3f") +
                                    " s, and the images', " + number(keyframes.front().time_s, "%.3f") + " to " +
                                    number(keyframes.back().time_s, "%.3f") +
                                    " s, have nothing in common; give both in the same clock");
}

/// Says where the readings see another motion than the camera does: tracking went wrong there, and the vertical and the
/// mounting may have followed it. Of 16 flights the 15 that are tracked well have no step over 2 sigmas, the one that
/// began wrongly one of 74.
void compare_steps(const VisualInertialProblem& problem, const VisualInertialState& state, const std::string& where,
                   InertialAlignment& result) {
  constexpr double kSigmas = 8.0;
  int contradicted = 0;
  double largest = 0.0, from_s = 0.0, to_s = 0.0;
  for (std::size_t k = 0; k + 1 < problem.keyframes().size(); ++k) {
    if (!problem.has_samples(k)) continue;
    const double sigmas = problem.step_sigmas(k, state);
    largest = std::max(largest, sigmas);
    if (sigmas < kSigmas) continue;
    if (contradicted++ == 0) from_s = problem.keyframes()[k].time_s;
    to_s = problem.keyframes()[k + 1].time_s;
  }
  if (contradicted == 0) return;
  result.warnings.push_back({"the readings contradict the camera's motion in " + std::to_string(contradicted) + " of " +
                                 std::to_string(problem.keyframes().size() - 1) + " steps between " +
                                 number(from_s, "%.1f") + " and " + number(to_s, "%.1f") + " s, by up to " +
                                 number(largest, "%.0f") + " sigmas: tracking was wrong there, or the readings are",
                             where, Severity::kWarning,
                             "leave that part out (--from, --to), or look at the images there"});
}

/// Solves the problem with the clock known so far, and says what became of it.
void solve(const VisualInertialProblem& problem, const InertialInput& input, const InertialLimits& limits,
           InertialAlignment& result) {
  std::optional<Solution> rival;
  const std::optional<Solution> best = best_solution(problem, rival);
  if (!best)
    return give_up("no scale fits both the unit's readings and the camera's path",
                   "record more of the flight, with changes of speed and direction; check T_cam_imu", input.where,
                   result);
  const VisualInertialState& state = best->state;
  result.time_offset_s = state.time_offset_s;
  result.T_imu_camera = state.T_imu_camera;
  result.mounting_correction_rad = state.T_imu_camera.rotation.angularDistance(input.model.T_imu_camera.rotation);
  result.residual_ratio = residual_ratio(*best->problem, state);
  set_uncertainties(*best->problem, state, result);
  if (ran_away(state)) result.sigma_log_scale = std::numeric_limits<double>::infinity();
  judge(input, limits, result);
  if (result.metric && is_ambiguous(*best, rival, result.sigma_log_scale))
    give_up("two scales fit the unit's readings and the camera's path nearly alike",
            "fly with more changes of speed and direction, and turn", input.where, result);
  if (!result.metric) return;
  compare_steps(*best->problem, state, input.where, result);
  set_path(state, result);
}

}  // namespace

InertialAlignment reversed(InertialAlignment alignment) {
  const auto turn = [](auto& list) { std::reverse(list.begin(), list.end()); };
  turn(alignment.T_world_camera);
  turn(alignment.scale);
  turn(alignment.velocity_m_s);
  turn(alignment.bias);
  for (Vec3& velocity : alignment.velocity_m_s) velocity = -velocity;
  for (geometry::ImuBias& bias : alignment.bias) bias.gyroscope_rad_s = -bias.gyroscope_rad_s;
  alignment.time_offset_s = -alignment.time_offset_s;
  alignment.latest_covariance.setZero();
  return alignment;
}

InertialAlignment align_to_gravity(const std::vector<VisualKeyframe>& keyframes, const geometry::Trajectory& images,
                                   const InertialInput& input, const InertialLimits& limits) {
  const ImuCheck check = check_readings(input.samples, input.model.noise, input.where);
  InertialAlignment result;
  result.warnings = check.warnings;
  result.was_metric = !keyframes.empty() && keyframes.front().is_metric;
  if (keyframes.size() < 3) {
    give_up("there are only " + std::to_string(keyframes.size()) + " keyframes", "use more images", input.where,
            result);
    return result;
  }
  require_common_time(keyframes, input);
  const auto clock = compare_rotations(images, input, limits, result);
  if (!clock) return result;
  const VisualInertialProblem problem(keyframes, input.samples, check, input.model, clock->offset_s, clock->sigma_s);
  result.covered_share = covered_share(problem);
  if (result.covered_share < limits.min_covered_share) {
    give_up("the unit's readings cover only " + number(100.0 * result.covered_share, "%.0f") + " % of the flight",
            "record the unit without gaps", input.where, result);
    return result;
  }
  solve(problem, input, limits, result);
  return result;
}

}  // namespace tileflight::inertial
