#include "tileflight/core/geometry/projection.h"

#include <proj.h>

#include <cmath>
#include <utility>

namespace tileflight::geometry {

void Projection::Deleter::operator()(pj_ctx* context) const { proj_context_destroy(context); }
void Projection::Deleter::operator()(PJconsts* transformation) const { proj_destroy(transformation); }

Projection::Projection() : context_(proj_context_create()) {
  proj_log_func(context_.get(), nullptr, [](void*, int, const char*) {});
  proj_context_set_enable_network(context_.get(), 0);
}

std::optional<Projection> Projection::to_geodetic(const std::string& reference_system) {
  Projection result;
  PJ_CONTEXT* const context = result.context_.get();
  const std::unique_ptr<PJ, Deleter> plain(
      proj_create_crs_to_crs(context, reference_system.c_str(), "EPSG:4979", nullptr));
  // EPSG:4979 begins with the latitude; longitude first is PROJ's order for drawing.
  if (plain) result.transformation_.reset(proj_normalize_for_visualization(context, plain.get()));
  if (!result.transformation_) return std::nullopt;
  return result;
}

std::optional<Projection> Projection::from_definition(const std::string& definition) {
  Projection result;
  result.transformation_.reset(proj_create(result.context_.get(), definition.c_str()));
  if (!result.transformation_) return std::nullopt;
  return result;
}

std::optional<Vec3> Projection::operator()(const Vec3& coordinates) const {
  const PJ_COORD in = proj_coord(coordinates.x(), coordinates.y(), coordinates.z(), HUGE_VAL);
  const PJ_COORD out = proj_trans(transformation_.get(), PJ_FWD, in);
  const Vec3 result(out.xyz.x, out.xyz.y, out.xyz.z);
  if (!result.allFinite()) return std::nullopt;
  return result;
}

}  // namespace tileflight::geometry
