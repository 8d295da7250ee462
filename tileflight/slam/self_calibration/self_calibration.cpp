#include "tileflight/slam/self_calibration/self_calibration.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/slam/self_calibration/lens_adjustment.h"

namespace tileflight::self_calibration {
namespace {

// Chosen by hand.
constexpr double kFirstNoise_px = 0.5;
constexpr double kDetermined = 0.7;  // the motion shows an unknown if its sigma is below this share of the prior's
constexpr double kFitSigmas = 3.5, kLeastLimit_px = 0.1;  // a corner's largest error
constexpr double kUnknownFocalSigma = 1.0;
constexpr double kUsualFov_deg = 70.0;
constexpr std::size_t kSegmentsOfTrial = 3, kTracksOfTrial = 150;
constexpr double kTrialLimit_px = 3.0, kFinalLimit_px = 2.0;

/// States where an adjustment begins, and the prior that belongs to it.
struct Start {
  LensParameters lens;
  LensPrior prior;
};

LensPrior prior_of(const LensParameters& lens, double focal_sigma) {
  return {.mean = lens.values, .sigma = usual_spread(lens.model, lens.width, focal_sigma), .is_free = {}};
}

/// The guess as a lens of a model, for images of full size; nullopt: nothing is known of the focal length.
std::optional<LensParameters> guessed_lens(const LensGuess& guess, LensModel model, int width, int height) {
  if (guess.calibration) return lens_of(*guess.calibration, model, width, height);
  if (guess.horizontal_fov_deg) return undistorted_lens(model, width, height, *guess.horizontal_fov_deg);
  return std::nullopt;
}

std::vector<LensModel> models_of(const LensGuess& guess) {
  if (guess.model) return {*guess.model};
  if (guess.calibration) return {model_of(guess.calibration->camera)};
  return {LensModel::kPinhole, LensModel::kFisheye};
}

std::vector<Start> starts_of(const LensGuess& guess, LensModel model, const FollowedFlight& flight) {
  const double factor = 1.0 / static_cast<double>(1 << flight.halvings);
  std::vector<Start> starts;
  const auto known = guessed_lens(guess, model, flight.full_width, flight.full_height);
  if (!known) {
    const std::vector<double> ladder_deg =
        model == LensModel::kPinhole ? std::vector<double>{50, 70, 90, 120} : std::vector<double>{70, 90, 120, 155};
    for (const double fov_deg : ladder_deg) {
      const LensParameters lens = undistorted_lens(model, flight.width, flight.height, fov_deg);
      starts.push_back({lens, prior_of(lens, kUnknownFocalSigma)});
    }
    return starts;
  }
  const LensParameters lens = known->resized(factor, flight.width, flight.height);
  constexpr double kSigmas = 1.7;  // to both sides
  for (const double change : {1.0, 0.85, 1.2, 0.7, 1.4}) {
    if (std::abs(std::log(change)) > kSigmas * guess.focal_sigma) continue;
    starts.push_back({lens, prior_of(lens, guess.focal_sigma)});
    starts.back().lens.values[kLogFocal] += std::log(change);
  }
  return starts;
}

std::array<bool, kLensUnknowns> free_unknowns(std::initializer_list<int> unknowns) {
  std::array<bool, kLensUnknowns> free{};
  for (const int i : unknowns) free[i] = true;
  return free;
}

const auto kNone = free_unknowns({});
const auto kFocalAndBend = free_unknowns({kLogFocal, kFirstDistortion});
const auto kAllButReadout = free_unknowns({0, 1, 2, 3, 4, 5, 6, 7});

/// Returns a structure of each segment for a lens.
FlightStructure make_structure(const FollowedFlight& flight, const LensParameters& lens) {
  FlightStructure structure{lens, {}};
  structure.segments.resize(flight.segments.size());
  const imaging::Camera camera = lens.camera();
  tbb::parallel_for(std::size_t{0}, flight.segments.size(),
                    [&](std::size_t s) { structure.segments[s] = start_structure(camera, flight.segments[s]); });
  return structure;
}

/// Adjusts structure and lens, with more and more unknowns of the lens free, and leaves out corners that do not fit.
void adjust_by_steps(const FollowedFlight& flight, LensPrior prior, bool all, FlightStructure& structure) {
  const auto adjust_free = [&](const std::array<bool, kLensUnknowns>& free, int iterations) {
    prior.is_free = free;
    adjust(flight.segments, prior, kFirstNoise_px, iterations, structure);
  };
  adjust_free(kNone, 4);
  adjust_free(kFocalAndBend, 10);
  select_corners(flight.segments, 5.0, 1.5, structure);
  adjust_free(all ? kAllButReadout : kFocalAndBend, 12);
  if (!all) return;
  select_corners(flight.segments, 4.0, 0.8, structure);
  adjust_free(kAllButReadout, 12);
}

struct Trial {
  Start start;
  LensParameters lens;
  double cost_px2 = 0.0;
};

/// Returns some of the segments and some of their tracks, evenly chosen.
FollowedFlight thinned(const FollowedFlight& flight) {
  FollowedFlight result = flight;
  result.segments.clear();
  const std::size_t stride = (flight.segments.size() + kSegmentsOfTrial - 1) / kSegmentsOfTrial;
  for (std::size_t s = 0; s < flight.segments.size(); s += stride) {
    Segment segment{flight.segments[s].keyframes, {}};
    const std::vector<SegmentTrack>& tracks = flight.segments[s].tracks;
    const std::size_t step = (tracks.size() + kTracksOfTrial - 1) / kTracksOfTrial;
    for (std::size_t i = 0; i < tracks.size(); i += step) segment.tracks.push_back(tracks[i]);
    result.segments.push_back(std::move(segment));
  }
  return result;
}

/// Returns the start whose lens explains a part of the flight best.
Trial best_trial(const FollowedFlight& flight, const std::vector<Start>& starts, const Progress& progress) {
  const FollowedFlight part = thinned(flight);
  std::optional<Trial> best;
  for (std::size_t i = 0; i < starts.size(); ++i) {
    report_progress(progress, static_cast<std::int64_t>(i), static_cast<std::int64_t>(starts.size()), "trying lenses");
    FlightStructure structure = make_structure(part, starts[i].lens);
    adjust_by_steps(part, starts[i].prior, false, structure);
    const double cost_px2 = truncated_cost_px2(part.segments, kTrialLimit_px, structure);
    if (!best || cost_px2 < best->cost_px2) best = Trial{starts[i], structure.lens, cost_px2};
  }
  return *best;
}

/// A lens of one model, fitted to all segments.
struct ModelFit {
  LensPrior prior;
  FlightStructure structure;
  double cost_px2 = 0.0;
  LensVector held_sigma = LensVector::Zero();   ///< of unknowns that are held at the guess
  std::array<bool, kLensUnknowns> is_unseen{};  ///< of these, the ones that the motion does not show
};

ModelFit fit_model(const FollowedFlight& flight, const Trial& trial) {
  ModelFit fit{.prior = trial.start.prior, .structure = {trial.lens, {}}, .cost_px2 = 0.0};
  constexpr int kRounds = 2;  // the second begins with the lens that the first found
  for (int round = 0; round < kRounds; ++round) {
    fit.structure = make_structure(flight, fit.structure.lens);
    adjust_by_steps(flight, fit.prior, true, fit.structure);
  }
  fit.cost_px2 = truncated_cost_px2(flight.segments, kFinalLimit_px, fit.structure);
  return fit;
}

/// Leaves out corners that do not fit, and returns the noise of those that do.
double noise_px(const FollowedFlight& flight, FlightStructure& structure) {
  constexpr double kLeast_px = 0.05;
  return std::max(kLeast_px, select_corners(flight.segments, kFitSigmas, kLeastLimit_px, structure).noise_px);
}

/// Adjusts with the velocities of the keyframes known, by which rows have poses of their own.
void adjust_readout(const FollowedFlight& flight, bool estimate, ModelFit& fit) {
  constexpr int kRounds = 3;
  fit.prior.is_free = kAllButReadout;
  fit.prior.is_free[kReadout] = estimate;
  if (!estimate) fit.held_sigma[kReadout] = fit.prior.sigma[kReadout];
  for (int round = 0; round < kRounds; ++round) {
    const imaging::Camera camera = fit.structure.lens.camera();
    tbb::parallel_for(std::size_t{0}, flight.segments.size(), [&](std::size_t s) {
      auto& structure = fit.structure.segments[s];
      if (structure) estimate_velocities(camera, flight.segments[s], *structure);
    });
    const double noise = noise_px(flight, fit.structure);
    adjust(flight.segments, fit.prior, noise, 10, fit.structure);
  }
}

/// Holds an unknown at the guess.
void hold(int unknown, double sigma, ModelFit& fit) {
  fit.prior.is_free[unknown] = false;
  fit.structure.lens.values[unknown] = fit.prior.mean[unknown];
  fit.held_sigma[unknown] = sigma;
}

/// Holds unknowns that the motion does not show; if there are none, one that does not differ from the guess. Returns
/// whether there was one.
bool hold_some(const LensUncertainty& uncertainty, ModelFit& fit) {
  bool has_held = false;
  for (int i = kLogFocal + 1; i < kLensUnknowns; ++i) {
    if (!fit.prior.is_free[i] || uncertainty.sigma[i] < kDetermined * fit.prior.sigma[i]) continue;
    fit.is_unseen[i] = has_held = true;
    hold(i, fit.prior.sigma[i], fit);
  }
  if (has_held) return true;
  // The least important ones first: each one that is free blurs the others. Pixels are square and lenses centred, so
  // that a difference must be clear; a distortion is left out only if it may as well be none.
  constexpr double kClear = 3.0, kFaint = 1.5;  // sigmas
  const double tangential = fit.structure.lens.model == LensModel::kPinhole ? kClear : kFaint;
  for (const auto& [i, sigmas] : {std::pair<int, double>{kReadout, kClear},
                                  {kFirstDistortion + 3, tangential},
                                  {kFirstDistortion + 2, tangential},
                                  {kFirstDistortion + 1, kFaint},
                                  {kLogAspect, kClear}}) {
    if (!fit.prior.is_free[i]) continue;
    const double difference = std::abs(fit.structure.lens.values[i] - fit.prior.mean[i]);
    if (difference > sigmas * uncertainty.sigma[i]) continue;
    hold(i, uncertainty.sigma[i], fit);
    return true;
  }
  return false;
}

/// Adjusts with fewer and fewer unknowns of the lens free, and returns their standard deviations.
LensUncertainty adjust_what_is_shown(const FollowedFlight& flight, ModelFit& fit) {
  LensUncertainty uncertainty;
  do {
    const double noise = noise_px(flight, fit.structure);
    adjust(flight.segments, fit.prior, noise, 15, fit.structure);
    uncertainty = lens_uncertainty(flight.segments, fit.prior, noise, fit.structure);
  } while (hold_some(uncertainty, fit));
  return uncertainty;
}

/// Largest rotation of a keyframe from the first of its segment.
double turn_deg(const FlightStructure& structure) {
  double largest_rad = 0.0;
  for (const auto& segment : structure.segments) {
    if (!segment) continue;
    for (const geometry::SE3& T : segment->T_camera_segment)
      largest_rad = std::max(largest_rad, geometry::so3_log(T.rotation).norm());
  }
  return largest_rad / geometry::kRadiansPerDegree;
}

std::vector<std::string> unknown_names(LensModel model) {
  if (model == LensModel::kPinhole) return {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "line_delay"};
  return {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4", "line_delay"};
}

/// Describes the lens's unknowns as parameters of images of full size.
std::vector<ParameterEstimate> parameters_of(const FollowedFlight& flight, const ModelFit& fit,
                                             const LensUncertainty& uncertainty) {
  const double factor = static_cast<double>(1 << flight.halvings);
  const auto full = [&](const LensVector& values) {
    LensParameters lens = fit.structure.lens;
    lens.values = values;
    LensVector result = lens.resized(factor, flight.full_width, flight.full_height).values;
    result[kLogAspect] = std::exp(result[kLogFocal] + result[kLogAspect]);
    result[kLogFocal] = std::exp(result[kLogFocal]);
    result[kReadout] /= flight.full_height;
    return result;
  };
  const LensVector value = full(fit.structure.lens.values), guess = full(fit.prior.mean);
  LensVector sigma = uncertainty.sigma;
  for (int i = 0; i < kLensUnknowns; ++i)
    if (!fit.prior.is_free[i]) sigma[i] = fit.held_sigma[i];
  sigma[kLogAspect] = value[kLogAspect] * std::hypot(sigma[kLogFocal], sigma[kLogAspect]);
  sigma[kLogFocal] *= value[kLogFocal];
  sigma[kCenterX] *= factor;
  sigma[kCenterY] *= factor;
  sigma[kReadout] /= flight.full_height;
  const std::vector<std::string> names = unknown_names(fit.structure.lens.model);
  std::vector<ParameterEstimate> parameters;
  for (int i = 0; i < kLensUnknowns; ++i)
    parameters.push_back({names[static_cast<std::size_t>(i)], value[i], sigma[i], guess[i], !fit.prior.is_free[i]});
  return parameters;
}

/// The calibration that stays if nothing better is found.
imaging::Calibration guessed_calibration(const LensGuess& guess, const FollowedFlight& flight) {
  const LensModel model = models_of(guess).front();
  if (guess.calibration) {
    imaging::Calibration kept = *guess.calibration;
    kept.line_delay_s *= static_cast<double>(kept.camera.height()) / flight.full_height;
    kept.camera = kept.camera.scaled_to(flight.full_width, flight.full_height);
    return kept;
  }
  return undistorted_lens(model, flight.full_width, flight.full_height,
                          guess.horizontal_fov_deg.value_or(kUsualFov_deg))
      .calibration();
}

constexpr const char* kRemedy =
    "calibrate the camera with a target or give its profile; a part of the flight shows a lens if the camera turns, "
    "most of all about its viewing direction, and passes near things and far ones (--from, --to)";

/// Fits both models where the guess does not name one, and returns the better one.
ModelFit better_fit(const FollowedFlight& flight, const LensGuess& guess, const Progress& progress,
                    double& other_cost_px2) {
  constexpr double kMuchBetter = 0.98;  // a pinhole is kept unless the fisheye fits better
  std::optional<ModelFit> best;
  for (const LensModel model : models_of(guess)) {
    const Trial trial = best_trial(flight, starts_of(guess, model, flight), progress);
    report_progress(progress, 0, 0, "adjusting the lens");
    ModelFit fit = fit_model(flight, trial);
    const bool is_better = !best || fit.cost_px2 < kMuchBetter * best->cost_px2;
    if (best) other_cost_px2 = is_better ? best->cost_px2 : fit.cost_px2;
    if (is_better) best = std::move(fit);
  }
  return *best;
}

std::string percent(double share) { return base::trimmed_text(100.0 * share, 2) + " %"; }

void warn_of_weak_motion(const FollowedFlight& flight, const ModelFit& fit, const LensUncertainty& uncertainty,
                         LensEstimate& result) {
  constexpr double kWide = 0.01, kDisagree = 5.0, kFewFit = 0.5;
  if (result.focal_sigma > kWide)
    result.warnings.push_back({"the focal length is known to " + percent(result.focal_sigma) +
                                   " only (the camera turned by at most " + base::trimmed_text(result.turn_deg, 1) +
                                   " degrees in a part of the flight)",
                               "lens", Severity::kWarning, kRemedy});
  std::vector<std::string> held;
  for (int i = kLogAspect; i < kReadout; ++i)
    if (fit.is_unseen[i]) held.push_back(i == kLogAspect ? "fy / fx" : result.parameters[i].name);
  if (!held.empty())
    result.warnings.push_back(
        {"the motion does not show " + base::joined(held) + ": held at the guess", "lens", Severity::kNote, ""});
  if (uncertainty.segment_sigma[kLogFocal] > kDisagree * uncertainty.independent_sigma[kLogFocal])
    result.warnings.push_back(
        {"the parts of the flight disagree on the focal length by " +
             percent(uncertainty.segment_sigma[kLogFocal] * std::sqrt(static_cast<double>(result.segments))) +
             ", more than the noise of the corners explains",
         "lens", Severity::kNote, "stabilization or a zoom changes the lens in flight: switch it off"});
  std::size_t all = 0;
  for (std::size_t s = 0; s < flight.segments.size(); ++s)
    if (fit.structure.segments[s]) all += flight.segments[s].tracks.size();
  if (static_cast<double>(result.tracks) < kFewFit * static_cast<double>(all))
    result.warnings.push_back(
        {"only " + std::to_string(result.tracks) + " of " + std::to_string(all) + " corners fit a rigid scene", "lens",
         Severity::kWarning, "mask what does not move with the scene (--mask)"});
}

}  // namespace

LensEstimate estimate_lens(const FollowedFlight& flight, const LensGuess& guess, bool estimate_line_delay,
                           const Progress& progress) {
  const double factor = static_cast<double>(1 << flight.halvings);
  LensEstimate result;
  result.calibration = guessed_calibration(guess, flight);
  double other_cost_px2 = 0.0;
  ModelFit fit = better_fit(flight, guess, progress, other_cost_px2);
  for (const auto& segment : fit.structure.segments) {
    if (!segment) continue;
    ++result.segments;
    result.images += segment->T_camera_segment.size();
  }
  result.model = fit.structure.lens.model;
  if (result.segments == 0) {
    result.warnings.push_back({"the lens is the guess: no part of the flight has corners that move as a rigid scene's",
                               "lens", Severity::kWarning, kRemedy});
    return result;
  }
  adjust_readout(flight, estimate_line_delay && flight.has_times, fit);
  const LensUncertainty uncertainty = adjust_what_is_shown(flight, fit);
  const FitQuality quality = select_corners(flight.segments, kFitSigmas, kLeastLimit_px, fit.structure);
  result.parameters = parameters_of(flight, fit, uncertainty);
  result.focal_sigma = uncertainty.sigma[kLogFocal];
  result.rms_px = quality.rms_px * factor;
  result.other_model_rms_px = std::sqrt(other_cost_px2) * factor;
  result.tracks = quality.points;
  result.turn_deg = turn_deg(fit.structure);
  constexpr double kUseless = 0.1;
  result.is_estimated = result.focal_sigma < std::min(kUseless, kDetermined * fit.prior.sigma[kLogFocal]);
  if (result.is_estimated) {
    result.calibration = fit.structure.lens.resized(factor, flight.full_width, flight.full_height).calibration();
    if (guess.calibration) result.calibration.T_cam_imu = guess.calibration->T_cam_imu;
    if (guess.calibration) result.calibration.assumes_T_cam_imu = guess.calibration->assumes_T_cam_imu;
  } else {
    result.warnings.push_back({"the lens is the guess: the motion shows the focal length to " +
                                   percent(result.focal_sigma) + " only (the camera turned by at most " +
                                   base::trimmed_text(result.turn_deg, 1) + " degrees in a part of the flight)",
                               "lens", Severity::kWarning, kRemedy});
    return result;
  }
  warn_of_weak_motion(flight, fit, uncertainty, result);
  return result;
}

LensEstimate estimate_lens(const std::filesystem::path& images, const LensGuess& guess,
                           const LensEstimateOptions& options, const Progress& progress) {
  LensGuess complete = guess;
  if (!guess.calibration && !guess.horizontal_fov_deg && is_dataset(images))
    complete.calibration = dataset::read_dataset(images).calibration;
  return estimate_lens(follow_flight(images, options.images, options.segments, progress), complete,
                       options.estimate_line_delay, progress);
}

nlohmann::json to_json(const LensEstimate& estimate) {
  nlohmann::json parameters = nlohmann::json::array();
  for (const ParameterEstimate& p : estimate.parameters)
    parameters.push_back(
        {{"name", p.name}, {"value", p.value}, {"sigma", p.sigma}, {"guess", p.guess}, {"held", p.is_held}});
  return {{"model", to_string(estimate.model)}, {"estimated", estimate.is_estimated},
          {"parameters", parameters},           {"focal_sigma", estimate.focal_sigma},
          {"rms_px", estimate.rms_px},          {"segments", estimate.segments},
          {"images", estimate.images},          {"tracks", estimate.tracks},
          {"turn_deg", estimate.turn_deg},      {"warnings", to_json(estimate.warnings)}};
}

}  // namespace tileflight::self_calibration
