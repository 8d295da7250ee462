#include "tileflight/core/alignment/transform_file.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/json_numbers.h"

namespace tileflight::alignment {

using geometry::Mat4;
using nlohmann::json;

namespace {

json rows_of(const Mat4& matrix) {
  json rows = json::array();
  for (int r = 0; r < 4; ++r) rows.push_back({matrix(r, 0), matrix(r, 1), matrix(r, 2), matrix(r, 3)});
  return rows;
}

Mat4 matrix_from(const json& rows, const std::string& where) {
  Mat4 matrix;
  const InputError wrong(where, "key 'matrix' must be 4 rows of 4 numbers");
  if (!rows.is_array() || rows.size() != 4) throw wrong;
  for (int r = 0; r < 4; ++r) {
    const json& row = rows[static_cast<std::size_t>(r)];
    if (!row.is_array() || row.size() != 4) throw wrong;
    for (int c = 0; c < 4; ++c) {
      const json& value = row[static_cast<std::size_t>(c)];
      if (!value.is_number()) throw wrong;
      matrix(r, c) = value.get<double>();
    }
  }
  return matrix;
}

/// Value of an optional key; throws if it has another type.
template <class T>
T value_or(const json& object, const char* key, const T& fallback, const std::string& where) {
  const auto found = object.find(key);
  if (found == object.end() || found->is_null()) return fallback;
  try {
    return found->get<T>();
  } catch (const json::exception&) {
    throw InputError(where, std::string("key '") + key + "' has the wrong type");
  }
}

geometry::Sim3 similarity_from(const Mat4& matrix, const std::string& where) {
  try {
    return geometry::Sim3::from_matrix(matrix);
  } catch (const InputError& e) {
    throw InputError(where, std::string("key 'matrix': ") + e.what());
  }
}

json to_json(const AlignmentUncertainty& u) {
  constexpr double kDegrees = 57.29577951308232;
  json rows = json::array();
  for (Eigen::Index r = 0; r < 7; ++r) {
    const geometry::Vec7 row = u.covariance.row(r).transpose();
    rows.push_back(std::vector<double>(row.begin(), row.end()));
  }
  return {{"translation_sigma", geometry::json_numbers(u.translation_sigma_m)},
          {"rotation_sigma_deg", geometry::json_numbers(kDegrees * u.rotation_sigma_rad)},
          {"scale_sigma", u.scale_sigma},
          {"rms_motion_sigma", u.rms_motion_sigma_m},
          {"covariance", rows}};
}

}  // namespace

json to_json(const IcpResult& result) {
  return {{"matrix", rows_of(result.T_target_source.matrix())},
          {"scale", result.T_target_source.scale},
          {"rmse", result.rmse_m},
          {"fitness", result.fitness},
          {"iterations", result.iterations},
          {"converged", result.converged},
          {"method", result.method},
          {"note", result.note},
          {"points", result.points},
          {"correspondences", result.correspondences},
          {"left_to_move", result.remaining_motion_m},
          {"constraint_strengths", result.constraint.eigenvalues},
          {"uncertainty", result.uncertainty ? to_json(*result.uncertainty) : json(nullptr)}};
}

IcpResult alignment_from_json(const json& object, const std::string& where) {
  if (!object.is_object()) throw InputError(where, "must be a JSON object");
  if (!object.contains("matrix")) throw InputError(where, "key 'matrix' is missing");
  IcpResult result;
  result.T_target_source = similarity_from(matrix_from(object.at("matrix"), where), where);
  const double matrix_scale = result.T_target_source.scale;
  const double scale = value_or(object, "scale", matrix_scale, where);
  constexpr double kTolerance = 1e-6;
  if (!(std::abs(scale - matrix_scale) <= kTolerance * matrix_scale)) {
    throw InputError(where, "key 'scale' does not agree with 'matrix', whose scale is " + std::to_string(matrix_scale));
  }
  result.rmse_m = value_or(object, "rmse", result.rmse_m, where);
  result.fitness = value_or(object, "fitness", result.fitness, where);
  result.iterations = value_or(object, "iterations", result.iterations, where);
  result.converged = value_or(object, "converged", result.converged, where);
  result.method = value_or(object, "method", result.method, where);
  result.note = value_or(object, "note", result.note, where);
  result.points = value_or(object, "points", result.points, where);
  result.correspondences = value_or(object, "correspondences", result.correspondences, where);
  result.remaining_motion_m = value_or(object, "left_to_move", result.remaining_motion_m, where);
  result.constraint.eigenvalues = value_or(object, "constraint_strengths", result.constraint.eigenvalues, where);
  return result;
}

IcpResult read_transform(const std::filesystem::path& file) {
  const json object = base::read_json(file);
  return alignment_from_json(object, file.string());
}

}  // namespace tileflight::alignment
