#include "tileflight/evaluation/metrics/error_budget.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/strict_section.h"

namespace tileflight::metrics {

using nlohmann::json;

namespace {

std::optional<double> finite_or_none(double value) {
  return std::isfinite(value) ? std::optional<double>(value) : std::nullopt;
}

ErrorSource tiles_part(const std::optional<double>& geometric_error_m) {
  ErrorSource part{geometric_error_m, "stated", "largest geometric error of the tiles used, as stated by the tileset"};
  if (geometric_error_m && *geometric_error_m == 0.0)
    part.explanation += "; 0 marks its finest level and does not tell how accurate that level is";
  return part;
}

ErrorSource alignment_part(const std::optional<double>& sigma_m) {
  if (!sigma_m)
    return {std::nullopt, "estimated", "the transform has no uncertainty; its error is part of the remainder"};
  return {sigma_m, "estimated", "RMS displacement of the map's points by the transform's own uncertainty"};
}

ErrorSource path_part(const std::optional<double>& to_true_poses_m, bool by_reference) {
  if (!to_true_poses_m) return {std::nullopt, "bound", "not known without true poses"};
  if (by_reference)
    return {to_true_poses_m, "bound",
            "distance of the map's points from their positions under the poses that were located in the tiles: "
            "alignment, drift and the reference's own error together"};
  return {to_true_poses_m, "bound",
          "distance of the map's points from their positions under the true poses: alignment and drift together"};
}

void add_total(const std::vector<double>& surface_m, ErrorBudget& budget) {
  double squares = 0.0, within = 0.0;
  for (const double d : surface_m) {
    if (!(d <= budget.within_m)) continue;
    squares += d * d;
    within += 1.0;
  }
  if (!surface_m.empty()) budget.share_within = within / static_cast<double>(surface_m.size());
  if (within > 0.0) budget.total_m = std::sqrt(squares / within);
}

/// If the alignment's uncertainty exceeds the total, no remainder for the odometry can be determined.
ErrorSource odometry_part(const std::optional<double>& total_m, const std::optional<double>& alignment_m) {
  const char* how =
      "root of the squared total minus the squared alignment; includes the tiles' errors and changes of the place";
  if (!total_m) return {std::nullopt, "remainder", "no map point is near the surface"};
  const double taken_m = alignment_m.value_or(0.0);
  return {std::sqrt(std::max(0.0, *total_m * *total_m - taken_m * taken_m)), "remainder", how};
}

json to_json(const ErrorSource& part) {
  return {
      {"metres", part.value_m ? json(*part.value_m) : json(nullptr)}, {"kind", part.kind}, {"how", part.explanation}};
}

ErrorSource read_part(base::StrictSection reader) {
  ErrorSource part{finite_or_none(reader.required_number("metres")), reader.required_text("kind"),
                   reader.required_text("how")};
  reader.require_all_keys_used();
  return part;
}

}  // namespace

ErrorBudget error_budget(const ErrorBudgetInputs& inputs) {
  ErrorBudget budget;
  budget.within_m = inputs.within_m;
  budget.voxel = {finite_or_none(inputs.floor_rmse_m), "measured",
                  "RMS distance of points on the true surface to the voxel centres; not in distances to the surface"};
  budget.tiles = tiles_part(inputs.geometric_error_m);
  budget.alignment = alignment_part(inputs.alignment_sigma_m);
  budget.path = path_part(inputs.rms_to_true_poses_m, inputs.reference_sigma_m.has_value());
  if (inputs.reference_sigma_m)
    budget.reference = {inputs.reference_sigma_m, "estimated",
                        "RMS of the standard deviations of the positions that were located in the tiles; in the path's "
                        "part, not in distances to the surface"};
  add_total(inputs.surface_m, budget);
  budget.odometry = odometry_part(budget.total_m, inputs.alignment_sigma_m);
  budget.not_separated = {
      "tiles and odometry: both move the map's points away from the triangles",
      "alignment and drift: the similarity that best fits a bent map differs from the one that best fits its path"};
  if (!inputs.alignment_sigma_m) budget.not_separated.push_back("alignment and odometry: no covariance");
  return budget;
}

json to_json(const ErrorBudget& b) {
  return {{"voxel", to_json(b.voxel)},
          {"tiles", to_json(b.tiles)},
          {"alignment", to_json(b.alignment)},
          {"path", to_json(b.path)},
          {"odometry", to_json(b.odometry)},
          {"reference", b.reference ? to_json(*b.reference) : json(nullptr)},
          {"total", b.total_m ? json(*b.total_m) : json(nullptr)},
          {"within", b.within_m},
          {"share_within", b.share_within},
          {"not_separated", b.not_separated}};
}

ErrorBudget read_error_budget(base::StrictSection reader) {
  ErrorBudget b;
  b.voxel = read_part(reader.required_section("voxel"));
  b.tiles = read_part(reader.required_section("tiles"));
  b.alignment = read_part(reader.required_section("alignment"));
  b.path = read_part(reader.required_section("path"));
  b.odometry = read_part(reader.required_section("odometry"));
  if (const auto reference = reader.section("reference")) b.reference = read_part(*reference);
  b.total_m = finite_or_none(reader.required_number("total"));
  b.within_m = reader.required_number("within");
  b.share_within = reader.required_number("share_within");
  b.not_separated = reader.required_texts("not_separated");
  reader.require_all_keys_used();
  return b;
}

}  // namespace tileflight::metrics
