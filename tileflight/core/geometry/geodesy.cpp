#include "tileflight/core/geometry/geodesy.h"

#include <proj.h>

#include <GeographicLib/Geocentric.hpp>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/core/base/input_error.h"

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

namespace {

constexpr double kRadPerDeg = 0.017453292519943295;

void check_latitude_longitude(double latitude_deg, double longitude_deg) {
  const std::string where = "latitude " + std::to_string(latitude_deg) + ", longitude " + std::to_string(longitude_deg);
  if (!std::isfinite(latitude_deg) || !std::isfinite(longitude_deg)) throw InputError(where, "is not finite");
  if (std::abs(latitude_deg) > 90.0) throw InputError(where, "the latitude must lie between -90 and 90 degrees");
  if (std::abs(longitude_deg) > 360.0) throw InputError(where, "the longitude must lie between -180 and 180 degrees");
}

/// East-north-up axes at `origin` as columns in ECEF, and its position.
SE3 make_T_ecef_local(const Geodetic& origin) {
  check_latitude_longitude(origin.latitude_deg, origin.longitude_deg);
  if (!std::isfinite(origin.height.m)) throw InputError("origin", "the height is not finite");
  Vec3 ecef_m;
  std::vector<double> axes(9);  // row-major: columns are east, north, up
  GeographicLib::Geocentric::WGS84().Forward(origin.latitude_deg, origin.longitude_deg, origin.height.m, ecef_m.x(),
                                             ecef_m.y(), ecef_m.z(), axes);
  const Mat3 rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(axes.data());
  return {rotation, ecef_m};
}

}  // namespace

Vec3 ecef_from_geodetic(const Geodetic& place) {
  check_latitude_longitude(place.latitude_deg, place.longitude_deg);
  Vec3 ecef_m;
  GeographicLib::Geocentric::WGS84().Forward(place.latitude_deg, place.longitude_deg, place.height.m, ecef_m.x(),
                                             ecef_m.y(), ecef_m.z());
  return ecef_m;
}

Geodetic geodetic_from_ecef(const Vec3& ecef_m) {
  if (!ecef_m.allFinite()) throw InputError("earth-centred position", "is not finite");
  Geodetic place;
  GeographicLib::Geocentric::WGS84().Reverse(ecef_m.x(), ecef_m.y(), ecef_m.z(), place.latitude_deg,
                                             place.longitude_deg, place.height.m);
  return place;
}

EllipsoidalHeight ellipsoidal_from_orthometric(double latitude_deg, double longitude_deg, OrthometricHeight height) {
  check_latitude_longitude(latitude_deg, longitude_deg);
  if (!std::isfinite(height.m)) throw InputError("height above sea level", "is not finite");
  // The multiplier 1 adds the grid's undulation to the height (PROJ manual, vgridshift).
  const auto add_undulation = Projection::from_definition("+proj=vgridshift +grids=egm96_15.gtx +multiplier=1");
  std::optional<Vec3> raised;
  if (add_undulation) raised = (*add_undulation)({longitude_deg * kRadPerDeg, latitude_deg * kRadPerDeg, height.m});
  // The grid covers the whole Earth: if there is no value, the grid is not installed.
  if (!raised) {
    throw InputError("geoid grid egm96_15.gtx",
                     "is not installed, so heights above sea level cannot be converted: install the package proj-data "
                     "or give heights above the ellipsoid");
  }
  return {raised->z()};
}

OrthometricHeight orthometric_from_ellipsoidal(const Geodetic& place) {
  if (!std::isfinite(place.height.m)) throw InputError("height above the ellipsoid", "is not finite");
  // The undulation depends only on latitude and longitude.
  const double undulation_m = ellipsoidal_from_orthometric(place.latitude_deg, place.longitude_deg, {0.0}).m;
  return {place.height.m - undulation_m};
}

LocalFrame::LocalFrame(const Geodetic& origin)
    : origin_(origin), T_ecef_local_(make_T_ecef_local(origin)), T_local_ecef_(T_ecef_local_.inverse()) {}

Vec3 LocalFrame::local_from_geodetic(const Geodetic& place) const {
  // Subtract first: rotating Earth-sized coordinates would lose precision.
  return T_local_ecef_.rotation * (ecef_from_geodetic(place) - T_ecef_local_.translation);
}

Geodetic LocalFrame::geodetic_from_local(const Vec3& local_m) const {
  return geodetic_from_ecef(T_ecef_local_ * local_m);
}

}  // namespace tileflight::geometry
