#include "tileflight/evaluation/scoring/align_result.h"

#include <nlohmann/json.hpp>

#include "tileflight/core/alignment/transform_file.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::scoring {

namespace {

using nlohmann::json;

json to_json(const registration::PictureAgreement& p) {
  return {{"tried", p.tried},
          {"located", p.located},
          {"agreeing", p.inliers},
          {"correlation", p.correlation},
          {"residual", p.inlier_rms_m},
          {"path_error", p.path_error_m},
          {"path_length", p.path_length_m},
          {"worst", p.worst_m},
          {"worst_time", p.worst_time_s}};
}

json to_json(const registration::RayAgreement& rays) {
  return {{"rays", rays.rays},
          {"score", rays.score},
          {"agreeing", rays.agreeing_share},
          {"blocked", rays.blocked_share},
          {"floating", rays.floating_share}};
}

json to_json(const RegisteredFlight& registered) {
  const registration::RegistrationResult& r = registered.registration;
  alignment::IcpResult result;
  result.T_target_source = r.T_local_map;
  result.rmse_m = r.surface.rmse_m;
  result.fitness = r.surface.fitness;
  result.correspondences = r.surface.matched;
  result.iterations = r.surface.iterations;
  result.converged = r.surface.converged;
  result.method = r.method;
  result.points = r.surface.points;
  result.constraint = r.surface.constraint;
  json object = alignment::to_json(result);
  object["uncertainty"] = {{"rms_motion_sigma", r.sigma_m}};
  object["start"] = r.start;
  object["starts_tried"] = r.starts_tried;
  object["moved_from_start"] = r.moved_from_start_m;
  object["rays"] = r.rays ? to_json(*r.rays) : json(nullptr);
  object["pictures"] = r.pictures ? to_json(*r.pictures) : json(nullptr);
  object["noise"] = r.surface.noise_factor;
  object["agreeing"] = r.surface.inlier_share;
  if (r.runner_up_distance_m) object["rival"] = {{"apart", *r.runner_up_distance_m}, {"score", r.runner_up_score}};
  object["published"] = alignment::to_json(registered.published);
  return object;
}

json to_json(const IcpAlignment& icp) {
  json object = alignment::to_json(icp.aligned);
  if (icp.to_surface) object["to_surface"] = alignment::to_json(*icp.to_surface);
  if (!icp.regions.aligned_on.empty() || !icp.regions.held_out.empty())
    object["regions"] = alignment::to_json(icp.regions);
  object["start"] = icp.start;
  return object;
}

}  // namespace

const geometry::Sim3& AlignResult::T_local_map() const {
  if (const auto* registered = std::get_if<RegisteredFlight>(&found)) return registered->registration.T_local_map;
  return std::get<IcpAlignment>(found).aligned.result.T_target_source;
}

json to_json(const AlignResult& result) {
  json object = std::visit([](const auto& found) { return to_json(found); }, result.found);
  if (result.holds_scale) object["scale_error"] = result.scale_error ? json(*result.scale_error) : json(nullptr);
  if (result.blocks > 1) object["truth_blocks"] = {{"read", result.blocks_read}, {"of", result.blocks}};
  object["warnings"] = to_json(result.warnings);
  return object;
}

ScoringTransform read_scoring_transform(const std::filesystem::path& transform_json) {
  const json object = base::read_json(transform_json);
  const std::string where = transform_json.string();
  const geometry::Sim3 T_local_map = alignment::alignment_from_json(object, where).T_target_source;
  const auto transform_at = [&](const char* key) {
    const auto found = object.find(key);
    return found == object.end() ? T_local_map
                                 : alignment::alignment_from_json(*found, where + ": " + key).T_target_source;
  };
  ScoringTransform transform{.T_published_map = transform_at("published"), .T_surface_map = transform_at("to_surface")};
  for (const char* place : {"/to_surface/uncertainty/rms_motion_sigma", "/uncertainty/rms_motion_sigma"}) {
    const json::json_pointer pointer(place);
    if (transform.sigma_m || !object.contains(pointer) || !object.at(pointer).is_number()) continue;
    transform.sigma_m = object.at(pointer).get<double>();
  }
  if (object.contains("regions")) transform.regions = alignment::regions_from_json(object["regions"], where);
  base::StrictSection section(object, where);
  transform.warnings = tileflight::read_warnings(section);
  return transform;
}

}  // namespace tileflight::scoring
