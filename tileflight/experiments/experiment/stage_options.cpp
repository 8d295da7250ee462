#include "tileflight/experiments/experiment/stage_options.h"

#include <cmath>
#include <numbers>

#include "tileflight/core/alignment/transform_file.h"

namespace tileflight::experiment {
namespace {

constexpr double kRadiansOfDegree = std::numbers::pi / 180.0;

int read_at_least(StrictSection& section, const std::string& key, int min, int fallback) {
  const int value = section.integer(key).value_or(fallback);
  if (value < min) throw section.error(key, "must be at least " + std::to_string(min));
  return value;
}

/// `method: all-evidence`, or one of ICP's methods.
void read_method(StrictSection& section, alignment::AlignMapOptions& options) {
  using alignment::IcpMethod;
  const auto word =
      section.choice("method", {"all-evidence", "point-to-point", "point-to-plane", "point-to-mesh", "generalized"});
  if (!word) return;
  options.use_all_evidence = *word == "all-evidence";
  if (*word == "generalized") options.icp.method = IcpMethod::kGeneralized;
  if (*word == "point-to-point") options.icp.method = IcpMethod::kPointToPoint;
  if (*word == "point-to-plane") options.icp.method = IcpMethod::kPointToPlane;
  if (*word == "point-to-mesh") options.icp.method = IcpMethod::kPointToMesh;
}

/// `key: [{center: [x, y, z], size: [east, north, up]}]`, metres, local frame.
std::vector<geometry::Box3> read_regions(StrictSection& section, const std::string& key) {
  std::vector<geometry::Box3> regions;
  for (StrictSection& region : section.sections(key)) {
    const auto center = region.numbers("center", 3, 3);
    const auto size = region.numbers("size", 3, 3);
    if (!center) throw region.error("center", "is missing");
    if (!size) throw region.error("size", "is missing");
    const geometry::Vec3 c((*center)[0], (*center)[1], (*center)[2]);
    const geometry::Vec3 half = 0.5 * geometry::Vec3((*size)[0], (*size)[1], (*size)[2]);
    if (half.minCoeff() <= 0) throw region.error("size", "must be positive");
    regions.emplace_back(c - half, c + half);
    region.require_all_keys_used();
  }
  return regions;
}

double read_ratio_margin(StrictSection& section, const std::string& key, double fallback) {
  const double value = section.positive_number(key).value_or(fallback);
  if (!(value > 1.0))
    throw section.error(key, "must be above 1: ratios between its inverse and itself count as equivalent");
  return value;
}

}  // namespace

namespace {

alignment::RobustKernel read_kernel(StrictSection& section, alignment::RobustKernel kernel) {
  using alignment::KernelType;
  kernel.scale_m = section.positive_number("kernel_scale").value_or(kernel.scale_m);
  const auto word = section.choice("kernel", {"none", "huber", "tukey", "geman-mcclure"});
  if (word && *word != "none") {
    kernel.kind = *word == "huber"   ? KernelType::kHuber
                  : *word == "tukey" ? KernelType::kTukey
                                     : KernelType::kGemanMcClure;
  }
  return kernel;
}

/// `start: auto | as-it-is | geometry | true-poses`, or the path of a transform.json.
void read_start(StrictSection& section, alignment::AlignMapOptions& options) {
  const std::string word = section.text("start").value_or("auto");
  if (word == "auto") return;
  if (word == "as-it-is") {
    options.start = alignment::AlignmentStart::kAsItIs;
  } else if (word == "geometry") {
    options.start = alignment::AlignmentStart::kGeometry;
  } else if (word == "true-poses") {
    options.start = alignment::AlignmentStart::kTruePoses;
  } else {
    options.start = alignment::AlignmentStart::kGiven;
    options.given_start = alignment::read_transform(*section.path("start")).T_target_source;
  }
}

std::vector<double> read_scale_seeds(StrictSection& section, const std::vector<double>& fallback) {
  const auto seeds = section.numbers("scale_seeds", 1, 16);
  if (!seeds) return fallback;
  for (const double seed : *seeds) {
    if (!(seed > 0.0)) throw section.error("scale_seeds", "must be positive");
  }
  return *seeds;
}

}  // namespace

alignment::AlignMapOptions read_alignment_options(StrictSection& section) {
  alignment::AlignMapOptions options;
  if (section.choice("preset", {"paper", "default"}).value_or("default") == "paper")
    options = alignment::paper_options();
  read_start(section, options);
  options.icp.kernel = read_kernel(section, options.icp.kernel);
  options.icp.kept_share = section.positive_number("kept_share").value_or(options.icp.kept_share);
  if (options.icp.kept_share > 1.0) throw section.error("kept_share", "must be at most 1");
  options.scale_seeds = read_scale_seeds(section, options.scale_seeds);
  read_method(section, options);
  options.icp.radius_m = section.positive_number("radius").value_or(options.icp.radius_m);
  options.icp.rms_change_m = section.positive_number("rms_change").value_or(options.icp.rms_change_m);
  options.icp.max_iterations = read_at_least(section, "max_iterations", 1, options.icp.max_iterations);
  if (section.choice("scale", {"estimated", "fixed"}).value_or("estimated") == "fixed") {
    options.icp.scale = alignment::ScaleMode::kFixed;
  }
  options.icp.max_scale_change = section.positive_number("max_scale_change").value_or(options.icp.max_scale_change);
  if (options.icp.max_scale_change < 1) throw section.error("max_scale_change", "must be at least 1");
  options.icp.regions = read_regions(section, "regions");
  options.held_out = read_regions(section, "held_out");
  options.find_regions = section.boolean("find_regions").value_or(false);
  if (options.find_regions && !(options.icp.regions.empty() && options.held_out.empty()))
    throw section.error("find_regions", "finds the regions itself; leave out `regions` and `held_out`, or this key");
  if (const auto radii = section.numbers("coarse_radii", 0, 16)) options.coarse_radii_m = *radii;
  options.trajectory.estimate_time_offset =
      section.boolean("estimate_time_offset").value_or(options.trajectory.estimate_time_offset);
  section.require_all_keys_used();
  return options;
}

odometry::OdometryOptions read_odometry_options(StrictSection& section) {
  odometry::OdometryOptions options;
  options.selection.points_per_keyframe =
      read_at_least(section, "points_per_keyframe", 50, options.selection.points_per_keyframe);
  options.window.active_points = read_at_least(section, "active_points", 100, options.window.active_points);
  options.window.min_keyframes = read_at_least(section, "min_keyframes", 3, options.window.min_keyframes);
  options.window.max_keyframes =
      read_at_least(section, "max_keyframes", options.window.min_keyframes, options.window.max_keyframes);
  options.window.iterations = read_at_least(section, "iterations", 1, options.window.iterations);
  options.map.min_observations = read_at_least(section, "min_observations", 1, options.map.min_observations);
  options.map.max_relative_sigma =
      section.positive_number("max_relative_deviation").value_or(options.map.max_relative_sigma);
  if (const auto deg = section.number("min_parallax")) {
    if (!(*deg >= 0.0)) throw section.error("min_parallax", "must not be negative");
    options.map.min_parallax_rad = *deg * kRadiansOfDegree;
  }
  options.loops.enabled = section.boolean("loop_closure").value_or(options.loops.enabled);
  options.window.refine_intrinsics = !section.boolean("fixed_intrinsics").value_or(!options.window.refine_intrinsics);
  options.estimate_line_delay = section.boolean("estimate_line_delay").value_or(options.estimate_line_delay);
  options.map.dense = section.boolean("dense").value_or(options.map.dense);
  options.initialization.seed =
      static_cast<std::uint32_t>(read_at_least(section, "seed", 0, static_cast<int>(options.initialization.seed)));
  return options;
}

scoring::EvaluationSettings read_evaluation_settings(StrictSection& section) {
  scoring::EvaluationSettings settings;
  settings.cutoff_m = section.positive_number("cutoff").value_or(settings.cutoff_m);
  if (const auto v = section.numbers("thresholds", 1, 16)) settings.thresholds_m = *v;
  settings.equivalence_margin_m = section.positive_number("equivalence_margin").value_or(settings.equivalence_margin_m);
  settings.ratio_margin = read_ratio_margin(section, "ratio_margin", settings.ratio_margin);
  settings.share_margin = section.positive_number("share_margin").value_or(settings.share_margin);
  settings.completeness_margin = read_ratio_margin(section, "completeness_margin", settings.completeness_margin);
  settings.lacking_margin = section.positive_number("lacking_margin").value_or(settings.lacking_margin);
  settings.path_margin_m = section.positive_number("path_margin").value_or(settings.path_margin_m);
  settings.completeness_samples_per_m2 =
      section.positive_number("completeness_samples_per_m2").value_or(settings.completeness_samples_per_m2);
  settings.entropy_radius_m = section.positive_number("entropy_radius").value_or(settings.entropy_radius_m);
  settings.wasserstein_voxel_m = section.positive_number("wasserstein_voxel").value_or(settings.wasserstein_voxel_m);
  settings.wasserstein_min_points =
      section.integer("wasserstein_min_points", settings.wasserstein_min_points, 2, 1'000'000);
  settings.agreement_cell_m = section.positive_number("agreement_cell").value_or(settings.agreement_cell_m);
  section.require_all_keys_used();
  return settings;
}

alignment::AlignMapOptions read_alignment_file(const std::filesystem::path& file) {
  StrictSection root = StrictSection::load(file);
  auto section = root.section("alignment");
  return section ? read_alignment_options(*section) : alignment::AlignMapOptions{};
}

scoring::EvaluationSettings read_evaluation_file(const std::filesystem::path& file) {
  StrictSection root = StrictSection::load(file);
  auto section = root.section("evaluation");
  return section ? read_evaluation_settings(*section) : scoring::EvaluationSettings{};
}

}  // namespace tileflight::experiment
