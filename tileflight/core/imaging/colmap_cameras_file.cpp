// COLMAP's cameras.txt: https://colmap.github.io/format.html#cameras-txt, models of
// https://colmap.github.io/cameras.html.
#include <algorithm>
#include <array>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/calibration_checks.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::imaging {

namespace {

constexpr double kPixelCentre = 0.5;       ///< centre of the first pixel in COLMAP; 0 here
constexpr std::size_t kLeadingFields = 4;  ///< CAMERA_ID MODEL WIDTH HEIGHT

struct ColmapLens {
  std::string_view name;
  bool one_focal = false;       ///< f cx cy instead of fx fy cx cy
  std::string_view distortion;  ///< Kalibr's name; missing coefficients are 0
  std::size_t coefficients = 0;
};

constexpr std::array<ColmapLens, 10> kLenses{{{"SIMPLE_PINHOLE", true, "none", 0},
                                              {"PINHOLE", false, "none", 0},
                                              {"SIMPLE_RADIAL", true, "radtan", 1},
                                              {"RADIAL", true, "radtan", 2},
                                              {"OPENCV", false, "radtan", 4},
                                              {"FULL_OPENCV", false, "radtan", 8},
                                              {"OPENCV_FISHEYE", false, "equidistant", 4},
                                              {"SIMPLE_RADIAL_FISHEYE", true, "equidistant", 1},
                                              {"RADIAL_FISHEYE", true, "equidistant", 2},
                                              {"FOV", false, "fov", 1}}};

struct Row : base::TextRow {
  std::int64_t camera_id;
};

std::vector<Row> rows_of(std::string_view text, const std::string& file) {
  std::vector<Row> rows;
  base::for_each_row(text, file, " \t", [&](const base::TextRow& row) {
    const auto id = base::parse_number<std::int64_t>(row.fields.front());
    if (!id) throw InputError(row.where, "\"" + std::string(row.fields.front()) + "\" is not a CAMERA_ID, a number");
    rows.push_back({row, *id});
  });
  return rows;
}

std::string ids_of(const std::vector<Row>& rows) {
  constexpr std::size_t kShown = 8;
  std::string text;
  for (std::size_t i = 0; i < std::min(rows.size(), kShown); ++i)
    text += (i > 0 ? ", " : "") + std::to_string(rows[i].camera_id);
  return text + (rows.size() > kShown ? ", …" : "");
}

const Row& chosen(const std::vector<Row>& rows, std::optional<std::int64_t> camera_id, const std::string& file) {
  if (rows.empty()) throw InputError(file, "has no camera: a line must be CAMERA_ID MODEL WIDTH HEIGHT PARAMS");
  if (!camera_id && rows.size() == 1) return rows.front();
  if (!camera_id)
    throw InputError(file, "has " + std::to_string(rows.size()) + " cameras (" + ids_of(rows) +
                               "): keep only the line of the camera that took the images");
  const auto is_it = [&](const Row& row) { return row.camera_id == *camera_id; };
  const auto found = std::find_if(rows.begin(), rows.end(), is_it);
  if (found == rows.end())
    throw InputError(file, "has no camera " + std::to_string(*camera_id) + ", only " + ids_of(rows));
  if (std::any_of(found + 1, rows.end(), is_it))
    throw InputError(file, "has camera " + std::to_string(*camera_id) + " twice: keep one");
  return *found;
}

const ColmapLens& lens_of(const Row& row) {
  if (row.fields.size() < kLeadingFields)
    throw InputError(row.where, "must be CAMERA_ID MODEL WIDTH HEIGHT PARAMS, separated by blanks");
  const auto lens = std::find_if(kLenses.begin(), kLenses.end(),
                                 [&](const ColmapLens& known) { return known.name == row.fields[1]; });
  if (lens != kLenses.end()) return *lens;
  std::string names;
  for (const ColmapLens& known : kLenses) names += (names.empty() ? "" : ", ") + std::string(known.name);
  throw InputError(row.where,
                   "camera model \"" + std::string(row.fields[1]) + "\" is not supported: use one of " + names);
}

int side_of(const Row& row, std::size_t field, const char* name) {
  const auto side = base::parse_number<int>(row.fields[field]);
  if (side && *side >= 1 && *side <= kMaxImageSide_px) return *side;
  throw InputError(row.where, std::string(name) + " must be whole pixels from 1 to " +
                                  std::to_string(kMaxImageSide_px) + ", not \"" + std::string(row.fields[field]) +
                                  "\"");
}

/// PARAMS with fx and fy.
std::vector<double> parameters_of(const Row& row, const ColmapLens& lens) {
  const std::size_t wanted = (lens.one_focal ? 3 : 4) + lens.coefficients;
  const std::size_t found = row.fields.size() - kLeadingFields;
  if (wanted != found)
    throw InputError(row.where, std::string(lens.name) + " must have " + std::to_string(wanted) + " parameters, not " +
                                    std::to_string(found));
  std::vector<double> values;
  for (std::size_t i = kLeadingFields; i < row.fields.size(); ++i) {
    const auto value = base::parse_number<double>(row.fields[i]);
    if (!value) throw InputError(row.where, "\"" + std::string(row.fields[i]) + "\" is not a number");
    values.push_back(*value);
  }
  if (lens.one_focal) values.insert(values.begin(), values.front());
  return values;
}

NamedDistortion distortion_of(const Row& row, const ColmapLens& lens, std::span<const double> values) {
  NamedDistortion out{std::string(lens.distortion), {values.begin(), values.end()}};
  if (lens.distortion == "none" || lens.distortion == "fov") return out;
  if (out.coefficients.size() < 4) out.coefficients.resize(4, 0.0);
  return lens.distortion == "equidistant" ? out : parse_opencv_distortion(row.where, out.coefficients);
}

}  // namespace

Calibration read_colmap_cameras(const std::filesystem::path& file, std::optional<std::int64_t> camera_id) {
  const std::string name = file.string();
  const std::string text = base::read_text(file, kMaxCalibrationBytes);
  const std::vector<Row> rows = rows_of(text, name);
  const Row& row = chosen(rows, camera_id, name);
  const ColmapLens& lens = lens_of(row);
  const std::vector<double> all = parameters_of(row, lens);
  const std::array<double, 4> focal{all[0], all[1], all[2] - kPixelCentre, all[3] - kPixelCentre};
  const NamedDistortion distortion = distortion_of(row, lens, std::span(all).subspan(4));
  Calibration calibration;
  calibration.camera = make_camera(row.where, {distortion.name, focal, distortion.coefficients,
                                               side_of(row, 2, "WIDTH"), side_of(row, 3, "HEIGHT")});
  return calibration;
}

}  // namespace tileflight::imaging
