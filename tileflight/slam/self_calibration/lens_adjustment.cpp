#include "tileflight/slam/self_calibration/lens_adjustment.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/geometry/decompositions.h"
#include "tileflight/slam/keyframes/residual.h"

// Notation: the unknowns of a segment are those of the lens (kLensUnknowns), then six of each keyframe but the first,
// which is the frame of the segment. A track has three: its direction (two, in the plane across it) and rho.

namespace tileflight::self_calibration {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using geometry::Mat3;
using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;
using LensMatrix = Eigen::Matrix<double, kLensUnknowns, kLensUnknowns>;

// Chosen by hand.
constexpr double kHuberSigmas = 1.5;
constexpr double kLeastHuber_px = 0.05;
constexpr double kOutside_px = 20.0;  ///< error assigned to a point outside the lens's domain

struct Reprojection {
  bool is_inside = false;
  Vec2 error = Vec2::Zero();
  double length = kOutside_px;
  Eigen::Matrix<double, 2, kLensUnknowns> by_lens;
  Eigen::Matrix<double, 2, 6> by_pose;
  Eigen::Matrix<double, 2, 3> by_point;
};

/// Two unit vectors across a unit vector.
Eigen::Matrix<double, 3, 2> across(const Vec3& direction) {
  const Vec3 axis = std::abs(direction.z()) < 0.7 ? Vec3::UnitZ() : Vec3::UnitX();
  Eigen::Matrix<double, 3, 2> plane;
  plane.col(0) = direction.cross(axis).normalized();
  plane.col(1) = direction.cross(plane.col(0));
  return plane;
}

/// The lens of one state, with its camera made once.
class Projector {
 public:
  explicit Projector(const LensParameters& lens) : lens_(lens), camera_(lens.camera()) {}

  /// Share of the readout at a row, from the middle one.
  double share(double row) const { return (row - 0.5 * (lens_.height - 1)) / lens_.height; }

  /// The point in the camera of the row at which it was seen, and its motion in a readout's second.
  Vec3 in_row(const Vec3& X, double rho, const geometry::Vec6& velocity, double row, Vec3& by_readout) const {
    by_readout = share(row) * (rho * velocity.head<3>() + velocity.tail<3>().cross(X));
    return X + lens_.values[kReadout] * by_readout;
  }

  double error_px(const SE3& T, const geometry::Vec6& velocity, const StructurePoint& point, const Vec2& seen) const {
    Vec3 by_readout;
    const Vec3 X =
        in_row(T.rotation * point.direction + point.rho * T.translation, point.rho, velocity, seen.y(), by_readout);
    const auto pixel = camera_.project(X);
    return pixel ? std::min((*pixel - seen).norm(), kOutside_px) : kOutside_px;
  }

  Reprojection reproject(const SE3& T, const geometry::Vec6& velocity, const StructurePoint& point,
                         const Vec2& seen) const {
    Reprojection out;
    Vec3 by_readout;
    const Vec3 X =
        in_row(T.rotation * point.direction + point.rho * T.translation, point.rho, velocity, seen.y(), by_readout);
    Eigen::Matrix<double, 2, 3> by_X;
    const auto pixel = camera_.project(X, by_X);
    if (!pixel) return out;
    out.is_inside = true;
    out.error = *pixel - seen;
    out.length = out.error.norm();
    out.by_lens = pixel_by_lens(lens_, X, *pixel);
    out.by_lens.col(kReadout) = by_X * by_readout;
    Vec2 by_rho;
    keyframes::pixel_derivatives<double>(by_X, X, T.translation, point.rho, out.by_pose, by_rho);
    out.by_point << by_X * T.rotation.toRotationMatrix() * across(point.direction), by_rho;
    return out;
  }

 private:
  LensParameters lens_;
  imaging::Camera camera_;
};

/// Calls visit(keyframe, pixel) for each keyframe with a pose in which a track is seen.
template <class Visit>
void for_each_view(const SegmentTrack& track, const SegmentStructure& structure, const Visit& visit) {
  for (std::size_t k = 0; k < structure.T_camera_segment.size(); ++k)
    if (track.points[k]) visit(k, track.points[k]->pixel);
}

double huber_cost(double e, double huber_px) { return e < huber_px ? e * e : huber_px * (2.0 * e - huber_px); }

double cost_of(const Segment& segment, const Projector& projector, double huber_px, const SegmentStructure& structure) {
  double cost = 0.0;
  for (std::size_t i = 0; i < segment.tracks.size(); ++i) {
    if (!structure.points[i].fits) continue;
    for_each_view(segment.tracks[i], structure, [&](std::size_t k, const Vec2& seen) {
      cost += huber_cost(
          projector.error_px(structure.T_camera_segment[k], structure.velocities[k], structure.points[i], seen),
          huber_px);
    });
  }
  return cost;
}

/// A track with its unknowns eliminated: what it tells of the others, whose places in the segment's unknowns are
/// `rows`.
struct ReducedTrack {
  std::vector<Eigen::Index> rows;
  MatrixXd coupling;  ///< of these and the track's three
  MatrixXd H;
  VectorXd b;
  Mat3 inverse = Mat3::Zero();  ///< of the track's own equations
  Vec3 own_b = Vec3::Zero();
};

ReducedTrack reduce(const SegmentTrack& track, const StructurePoint& point, const Projector& projector,
                    const SegmentStructure& structure, double huber_px, double damping) {
  ReducedTrack out;
  std::vector<std::pair<std::size_t, Reprojection>> views;
  for_each_view(track, structure, [&](std::size_t k, const Vec2& seen) {
    const auto r = projector.reproject(structure.T_camera_segment[k], structure.velocities[k], point, seen);
    if (r.is_inside) views.emplace_back(k, r);
  });
  for (int i = 0; i < kLensUnknowns; ++i) out.rows.push_back(i);
  for (const auto& [k, r] : views)
    for (std::size_t i = 0; k > 0 && i < 6; ++i)
      out.rows.push_back(static_cast<Eigen::Index>(kLensUnknowns + 6 * (k - 1) + i));
  const auto size = static_cast<Eigen::Index>(out.rows.size());
  out.H = MatrixXd::Zero(size, size);
  out.b = VectorXd::Zero(size);
  out.coupling = MatrixXd::Zero(size, 3);
  Mat3 own = Mat3::Zero();
  Eigen::Index at = kLensUnknowns;
  for (const auto& view : views) {
    const std::size_t k = view.first;
    const Reprojection& r = view.second;
    const double weight = r.length < huber_px ? 1.0 : huber_px / r.length;
    const auto add = [&](Eigen::Index row, const auto& by) {
      const auto n = by.cols();
      out.H.block(row, row, n, n) += weight * by.transpose() * by;
      out.b.segment(row, n) += weight * by.transpose() * r.error;
      out.coupling.middleRows(row, n) += weight * by.transpose() * r.by_point;
    };
    add(0, r.by_lens);
    own += weight * r.by_point.transpose() * r.by_point;
    out.own_b += weight * r.by_point.transpose() * r.error;
    if (k == 0) continue;
    add(at, r.by_pose);
    const Eigen::Matrix<double, kLensUnknowns, 6> mixed = weight * r.by_lens.transpose() * r.by_pose;
    out.H.block<kLensUnknowns, 6>(0, at) += mixed;
    out.H.block<6, kLensUnknowns>(at, 0) += mixed.transpose();
    at += 6;
  }
  own.diagonal() *= 1.0 + damping;
  own.diagonal().array() += 1e-9;
  out.inverse = own.inverse();
  const MatrixXd coupled = out.coupling * out.inverse;
  out.H -= coupled * out.coupling.transpose();
  out.b -= coupled * out.own_b;
  return out;
}

/// A segment's equations with its tracks eliminated, and the tracks for the way back.
struct ReducedSegment {
  MatrixXd H;
  VectorXd b;
  std::vector<ReducedTrack> tracks;
  MatrixXd inverse;        ///< of the poses' part
  MatrixXd lens_by_poses;  ///< the lens's coupling times this
  LensMatrix lens_H;       ///< with the poses eliminated, too
  LensVector lens_b;
};

ReducedSegment reduce(const Segment& segment, const Projector& projector, const SegmentStructure& structure,
                      double huber_px, double damping) {
  ReducedSegment out;
  const auto poses = static_cast<Eigen::Index>(6 * (structure.T_camera_segment.size() - 1));
  const Eigen::Index size = kLensUnknowns + poses;
  out.H = MatrixXd::Zero(size, size);
  out.b = VectorXd::Zero(size);
  out.tracks.resize(segment.tracks.size());
  for (std::size_t i = 0; i < segment.tracks.size(); ++i) {
    if (!structure.points[i].is_known) continue;
    out.tracks[i] = reduce(segment.tracks[i], structure.points[i], projector, structure, huber_px, damping);
    if (!structure.points[i].fits) continue;  // it has no say in the poses
    const ReducedTrack& track = out.tracks[i];
    for (Eigen::Index c = 0; c < track.H.cols(); ++c) {
      for (Eigen::Index r = 0; r < track.H.rows(); ++r) out.H(track.rows[r], track.rows[c]) += track.H(r, c);
      out.b[track.rows[c]] += track.b[c];
    }
  }
  MatrixXd own = out.H.bottomRightCorner(poses, poses);
  own.diagonal() *= 1.0 + damping;
  // Nothing decides on the scale of positions: the length of the last one is held.
  const Vec3 last = structure.T_camera_segment.back().translation.normalized();
  own.block<3, 3>(poses - 6, poses - 6) += own.diagonal().maxCoeff() * last * last.transpose();
  const VectorXd scale = (own.diagonal().array().abs() + 1e-12).sqrt().inverse();
  out.inverse = scale.asDiagonal() * geometry::symmetric_inverse(scale.asDiagonal() * own * scale.asDiagonal()) *
                scale.asDiagonal();
  const auto coupling = out.H.topRightCorner(kLensUnknowns, poses);
  out.lens_by_poses = coupling * out.inverse;
  out.lens_H = out.H.topLeftCorner<kLensUnknowns, kLensUnknowns>() - out.lens_by_poses * coupling.transpose();
  out.lens_b = out.b.head<kLensUnknowns>() - out.lens_by_poses * out.b.tail(poses);
  return out;
}

/// Moves a segment by the step that follows from the lens's.
void go_back(const ReducedSegment& reduced, const LensVector& lens_step, SegmentStructure& structure) {
  VectorXd step(reduced.b.size());
  step.head<kLensUnknowns>() = lens_step;
  const Eigen::Index poses = step.size() - kLensUnknowns;
  step.tail(poses) = -(reduced.inverse * reduced.b.tail(poses) + reduced.lens_by_poses.transpose() * lens_step);
  for (std::size_t k = 1; k < structure.T_camera_segment.size(); ++k) {
    const geometry::Vec6 twist = step.segment<6>(static_cast<Eigen::Index>(kLensUnknowns + 6 * (k - 1)));
    structure.T_camera_segment[k] = SE3::exp(twist) * structure.T_camera_segment[k];
  }
  for (std::size_t i = 0; i < structure.points.size(); ++i) {
    const ReducedTrack& track = reduced.tracks[i];
    if (track.rows.empty()) continue;
    VectorXd seen_step(track.rows.size());
    for (std::size_t r = 0; r < track.rows.size(); ++r) seen_step[static_cast<Eigen::Index>(r)] = step[track.rows[r]];
    const Vec3 own = -(track.inverse * (track.own_b + track.coupling.transpose() * seen_step));
    StructurePoint& point = structure.points[i];
    point.direction = (point.direction + across(point.direction) * own.head<2>()).normalized();
    point.rho += own[2];
  }
}

/// Holds what the prior adds: precision and gradient, in square pixels.
struct PriorTerm {
  LensVector precision = LensVector::Zero();
  LensVector gradient = LensVector::Zero();
  double cost = 0.0;
};

PriorTerm prior_term(const LensPrior& prior, double noise_px, const LensVector& values) {
  PriorTerm term;
  for (int i = 0; i < kLensUnknowns; ++i) {
    if (!prior.is_free[i]) continue;
    term.precision[i] = noise_px * noise_px / (prior.sigma[i] * prior.sigma[i]);
    term.gradient[i] = term.precision[i] * (values[i] - prior.mean[i]);
    term.cost += term.gradient[i] * (values[i] - prior.mean[i]);
  }
  return term;
}

/// Rows and columns of unknowns that are not free become those of the identity.
void hold(const LensPrior& prior, LensMatrix& H, LensVector& b) {
  for (int i = 0; i < kLensUnknowns; ++i) {
    if (prior.is_free[i]) continue;
    H.row(i).setZero();
    H.col(i).setZero();
    H(i, i) = 1.0;
    b[i] = 0.0;
  }
}

LensMatrix scaled_inverse(const LensMatrix& H) {
  const LensVector scale = (H.diagonal().array().abs() + 1e-12).sqrt().inverse();
  const MatrixXd inverse = geometry::symmetric_inverse(scale.asDiagonal() * H * scale.asDiagonal());
  return scale.asDiagonal() * inverse * scale.asDiagonal();
}

/// Errors of the corners that a member of StructurePoint names.
std::vector<double> errors_px(const std::vector<Segment>& segments, bool StructurePoint::*counts,
                              const FlightStructure& flight) {
  const Projector projector(flight.lens);
  std::vector<double> errors;
  for (std::size_t s = 0; s < segments.size(); ++s) {
    if (!flight.segments[s]) continue;
    const SegmentStructure& structure = *flight.segments[s];
    for (std::size_t i = 0; i < segments[s].tracks.size(); ++i) {
      if (!(structure.points[i].*counts)) continue;
      for_each_view(segments[s].tracks[i], structure, [&](std::size_t k, const Vec2& seen) {
        errors.push_back(
            projector.error_px(structure.T_camera_segment[k], structure.velocities[k], structure.points[i], seen));
      });
    }
  }
  return errors;
}

/// Standard deviation of a coordinate by the lengths of errors; zero for none.
double noise_of(const std::vector<double>& errors_px) {
  constexpr double kMedianOfRayleigh = 1.1774;  // of the length of a 2D normal deviate with unit sigma
  return errors_px.empty() ? 0.0 : base::upper_median(errors_px) / kMedianOfRayleigh;
}

FitQuality quality_of(const std::vector<Segment>& segments, const FlightStructure& flight) {
  const std::vector<double> errors = errors_px(segments, &StructurePoint::fits, flight);
  FitQuality quality{.points = 0, .pixels = errors.size(), .rms_px = 0.0, .noise_px = 0.0};
  for (const auto& structure : flight.segments)
    if (structure)
      quality.points += static_cast<std::size_t>(std::ranges::count_if(structure->points, &StructurePoint::fits));
  if (errors.empty()) return quality;
  for (const double e : errors) quality.rms_px += e * e;
  quality.rms_px = std::sqrt(quality.rms_px / static_cast<double>(errors.size()));
  quality.noise_px = noise_of(errors);
  return quality;
}

double huber_of(const FitQuality& quality) { return std::max(kLeastHuber_px, kHuberSigmas * quality.noise_px); }

double total_cost(const std::vector<Segment>& segments, const LensPrior& prior, double noise_px, double huber_px,
                  const FlightStructure& flight) {
  const Projector projector(flight.lens);
  std::vector<double> costs(segments.size(), 0.0);
  tbb::parallel_for(std::size_t{0}, segments.size(), [&](std::size_t s) {
    if (flight.segments[s]) costs[s] = cost_of(segments[s], projector, huber_px, *flight.segments[s]);
  });
  double cost = prior_term(prior, noise_px, flight.lens.values).cost;
  for (const double c : costs) cost += c;
  return cost;
}

std::vector<ReducedSegment> reduce_all(const std::vector<Segment>& segments, double huber_px, double damping,
                                       const FlightStructure& flight) {
  const Projector projector(flight.lens);
  std::vector<ReducedSegment> reduced(segments.size());
  tbb::parallel_for(std::size_t{0}, segments.size(), [&](std::size_t s) {
    if (flight.segments[s]) reduced[s] = reduce(segments[s], projector, *flight.segments[s], huber_px, damping);
  });
  return reduced;
}

FlightStructure step(const std::vector<Segment>& segments, const LensPrior& prior, double noise_px, double huber_px,
                     double damping, const FlightStructure& flight) {
  const std::vector<ReducedSegment> reduced = reduce_all(segments, huber_px, damping, flight);
  const PriorTerm term = prior_term(prior, noise_px, flight.lens.values);
  LensMatrix H = term.precision.asDiagonal();
  LensVector b = term.gradient;
  for (std::size_t s = 0; s < segments.size(); ++s) {
    if (!flight.segments[s]) continue;
    H += reduced[s].lens_H;
    b += reduced[s].lens_b;
  }
  H.diagonal() *= 1.0 + damping;
  hold(prior, H, b);
  const LensVector lens_step = -(scaled_inverse(H) * b);
  FlightStructure next = flight;
  next.lens.values += lens_step;
  tbb::parallel_for(std::size_t{0}, segments.size(), [&](std::size_t s) {
    if (next.segments[s]) go_back(reduced[s], lens_step, *next.segments[s]);
  });
  return next;
}

/// Contributions of parts of the images to the lens's equations. They would all be zero without errors.
struct Spread {
  LensMatrix squares = LensMatrix::Zero();
  std::size_t parts = 0;

  void add(const LensVector& contribution) {
    squares += contribution * contribution.transpose();
    ++parts;
  }
  /// Variances of the unknowns by the inverse of their equations; zero for too few parts.
  LensVector variance(const LensMatrix& inverse) const {
    constexpr std::size_t kFewestParts = 4;
    if (parts < kFewestParts) return LensVector::Zero();
    return (inverse * squares * inverse).diagonal() * static_cast<double>(parts) / static_cast<double>(parts - 1);
  }
};

std::size_t first_keyframe(const SegmentTrack& track) {
  return static_cast<std::size_t>(
      std::ranges::find_if(track.points, [](const auto& point) { return point.has_value(); }) - track.points.begin());
}

/// Tells whether a lens may be projected with: a focal length between a tenth of the width and a hundred times it.
bool is_sane(const LensParameters& lens) {
  const double share = lens.values[kLogFocal] - std::log(static_cast<double>(lens.width));
  return lens.values.allFinite() && share > std::log(0.1) && share < std::log(100.0);
}

}  // namespace

FitQuality adjust(const std::vector<Segment>& segments, const LensPrior& prior, double noise_px, int iterations,
                  FlightStructure& flight) {
  // Damping schedule, chosen by hand.
  double damping = 1e-4;
  const double huber_px = huber_of(quality_of(segments, flight));
  double cost = total_cost(segments, prior, noise_px, huber_px, flight);
  for (int i = 0; i < iterations && damping < 1e6; ++i) {
    FlightStructure next = step(segments, prior, noise_px, huber_px, damping, flight);
    const double next_cost = is_sane(next.lens) ? total_cost(segments, prior, noise_px, huber_px, next) : cost;
    if (!(next_cost < cost)) {
      damping *= 8.0;
      continue;
    }
    const bool settled = cost - next_cost < 1e-6 * cost;
    flight = std::move(next);
    cost = next_cost;
    damping *= 0.2;
    if (settled) break;
  }
  return quality_of(segments, flight);
}

FitQuality select_corners(const std::vector<Segment>& segments, double sigmas, double least_px,
                          FlightStructure& flight) {
  const double limit_px = std::max(least_px, sigmas * noise_of(errors_px(segments, &StructurePoint::is_known, flight)));
  const Projector projector(flight.lens);
  for (std::size_t s = 0; s < segments.size(); ++s) {
    if (!flight.segments[s]) continue;
    SegmentStructure& structure = *flight.segments[s];
    for (std::size_t i = 0; i < segments[s].tracks.size(); ++i) {
      StructurePoint& point = structure.points[i];
      if (!point.is_known) continue;
      double largest = point.direction.allFinite() && std::isfinite(point.rho) ? 0.0 : kOutside_px;
      std::size_t views = 0;
      for_each_view(segments[s].tracks[i], structure, [&](std::size_t k, const Vec2& seen) {
        ++views;
        largest =
            std::max(largest, projector.error_px(structure.T_camera_segment[k], structure.velocities[k], point, seen));
      });
      constexpr std::size_t kFewestViews = 3;
      point.fits = views >= kFewestViews && largest < limit_px;
    }
  }
  return quality_of(segments, flight);
}

double truncated_cost_px2(const std::vector<Segment>& segments, double limit_px, const FlightStructure& flight) {
  const Projector projector(flight.lens);
  double cost = 0.0;
  std::size_t pixels = 0;
  for (std::size_t s = 0; s < segments.size(); ++s) {
    for (std::size_t i = 0; i < segments[s].tracks.size(); ++i) {
      const auto& points = segments[s].tracks[i].points;
      const auto& structure = flight.segments[s];
      for (std::size_t k = 0; k < points.size(); ++k) {
        if (!points[k]) continue;
        ++pixels;
        const bool has_pose = structure && structure->points[i].fits && k < structure->T_camera_segment.size();
        const double e = has_pose ? projector.error_px(structure->T_camera_segment[k], structure->velocities[k],
                                                       structure->points[i], points[k]->pixel)
                                  : limit_px;
        cost += std::min(e * e, limit_px * limit_px);
      }
    }
  }
  return pixels == 0 ? 0.0 : cost / static_cast<double>(pixels);
}

LensUncertainty lens_uncertainty(const std::vector<Segment>& segments, const LensPrior& prior, double noise_px,
                                 const FlightStructure& flight) {
  const FitQuality quality = quality_of(segments, flight);
  const std::vector<ReducedSegment> reduced = reduce_all(segments, huber_of(quality), 0.0, flight);
  const PriorTerm term = prior_term(prior, noise_px, flight.lens.values);
  LensMatrix H = term.precision.asDiagonal();
  Spread by_group, by_segment;
  for (std::size_t s = 0; s < segments.size(); ++s) {
    if (!flight.segments[s]) continue;
    H += reduced[s].lens_H;
    by_segment.add(reduced[s].lens_b);
    std::vector<LensVector> groups(segments[s].keyframes.size(), LensVector::Zero());
    for (std::size_t i = 0; i < segments[s].tracks.size(); ++i) {
      const ReducedTrack& track = reduced[s].tracks[i];
      if (!flight.segments[s]->points[i].fits) continue;
      LensVector own = track.b.head<kLensUnknowns>();
      for (std::size_t r = kLensUnknowns; r < track.rows.size(); ++r)
        own -= reduced[s].lens_by_poses.col(track.rows[r] - kLensUnknowns) * track.b[static_cast<Eigen::Index>(r)];
      groups[first_keyframe(segments[s].tracks[i])] += own;
    }
    for (const LensVector& group : groups)
      if (!group.isZero(0.0)) by_group.add(group);
  }
  LensVector unused = LensVector::Zero();
  hold(prior, H, unused);
  const LensMatrix inverse = scaled_inverse(H);
  // Each pixel has two coordinates, each corner three unknowns.
  const double coordinates = 2.0 * static_cast<double>(quality.pixels);
  const double freedom = std::max(1.0, coordinates - 3.0 * static_cast<double>(quality.points));
  const double variance = quality.rms_px * quality.rms_px * static_cast<double>(quality.pixels) / freedom;
  const LensVector group_variance = by_group.variance(inverse), segment_variance = by_segment.variance(inverse);
  LensUncertainty result;
  for (int i = 0; i < kLensUnknowns; ++i) {
    if (!prior.is_free[i]) continue;
    result.independent_sigma[i] = std::sqrt(std::max(0.0, inverse(i, i) * variance));
    result.segment_sigma[i] = std::sqrt(segment_variance[i]);
    result.sigma[i] = std::max({result.independent_sigma[i], std::sqrt(group_variance[i]), result.segment_sigma[i]});
  }
  return result;
}

}  // namespace tileflight::self_calibration
