#include "tileflight/data/dataset/attitude_csv.h"

#include <cmath>

#include "tileflight/core/base/input_error.h"
#include "tileflight/data/dataset/number_table.h"

namespace tileflight::dataset {
namespace {

const std::vector<std::string> kColumns = {"t", "qx", "qy", "qz", "qw", "tilt_sigma_deg", "yaw_sigma_deg"};

CameraAttitude parse_attitude(const std::vector<double>& row, const std::string& where) {
  for (const double value : row)
    if (!std::isfinite(value)) throw InputError(where, "a number is not finite");
  const Eigen::Quaterniond q(row[4], row[1], row[2], row[3]);
  constexpr double kUnit = 0.01;
  if (!(std::abs(q.norm() - 1.0) < kUnit)) throw InputError(where, "the quaternion does not have length 1");
  if (!(row[5] > 0.0 && row[6] > 0.0)) throw InputError(where, "a standard deviation must be above zero");
  return {row[0], q.normalized(), row[5], row[6]};
}

}  // namespace

std::vector<CameraAttitude> read_attitude_csv(const std::filesystem::path& file) {
  const NumberTable table = read_number_table(file);
  if (table.columns != kColumns)
    throw InputError(file.string(), "expected the columns t,qx,qy,qz,qw,tilt_sigma_deg,yaw_sigma_deg");
  std::vector<CameraAttitude> attitudes;
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const std::string where = file.string() + ": row " + std::to_string(i + 1);
    attitudes.push_back(parse_attitude(table.rows[i], where));
    if (i > 0 && !(attitudes[i].time_s > attitudes[i - 1].time_s))
      throw InputError(where, "the time is not after the one before it");
  }
  return attitudes;
}

void write_attitude_csv(const std::filesystem::path& file, const std::vector<CameraAttitude>& attitudes) {
  NumberTable table{kColumns, {}};
  for (const CameraAttitude& a : attitudes) {
    const Eigen::Quaterniond& q = a.R_enu_camera;
    table.rows.push_back({a.time_s, q.x(), q.y(), q.z(), q.w(), a.tilt_sigma_deg, a.yaw_sigma_deg});
  }
  write_number_table(file, table);
}

}  // namespace tileflight::dataset
