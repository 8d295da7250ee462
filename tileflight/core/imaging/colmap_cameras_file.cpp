// COLMAP's cameras.txt and cameras.bin: https://colmap.github.io/format.html#cameras-txt, models of
// https://colmap.github.io/cameras.html.
#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/calibration_checks.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::imaging {

namespace {

constexpr double kPixelCentre = 0.5;       ///< centre of the first pixel in COLMAP; 0 here
constexpr std::size_t kLeadingFields = 4;  ///< CAMERA_ID MODEL WIDTH HEIGHT

constexpr std::string_view kThinPrism = "THIN_PRISM_FISHEYE";

struct ColmapLens {
  std::string_view name;
  bool one_focal = false;       ///< f cx cy instead of fx fy cx cy
  std::string_view distortion;  ///< Kalibr's name; missing coefficients are 0
  std::size_t coefficients = 0;
};

/// The lenses stand in the order of COLMAP's model ids (https://colmap.github.io/format.html#cameras-txt).
constexpr std::array<ColmapLens, 11> kLenses{{{"SIMPLE_PINHOLE", true, "none", 0},
                                              {"PINHOLE", false, "none", 0},
                                              {"SIMPLE_RADIAL", true, "radtan", 1},
                                              {"RADIAL", true, "radtan", 2},
                                              {"OPENCV", false, "radtan", 4},
                                              {"OPENCV_FISHEYE", false, "equidistant", 4},
                                              {"FULL_OPENCV", false, "radtan", 8},
                                              {"FOV", false, "fov", 1},
                                              {"SIMPLE_RADIAL_FISHEYE", true, "equidistant", 1},
                                              {"RADIAL_FISHEYE", true, "equidistant", 2},
                                              {kThinPrism, false, "equidistant", 8}}};

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

/// k1 k2 p1 p2 k3 k4 sx1 sy1; without p and s the lens is OpenCV's fisheye.
NamedDistortion thin_prism_distortion(const Row& row, std::span<const double> k) {
  if (k[2] == 0.0 && k[3] == 0.0 && k[6] == 0.0 && k[7] == 0.0) return {"equidistant", {k[0], k[1], k[4], k[5]}};
  throw InputError(row.where,
                   std::string(kThinPrism) +
                       " with p1, p2, sx1 or sy1 other than 0 is not supported: undistort the images (colmap "
                       "image_undistorter), or let COLMAP refine the camera as OPENCV_FISHEYE");
}

NamedDistortion distortion_of(const Row& row, const ColmapLens& lens, std::span<const double> values) {
  NamedDistortion out{std::string(lens.distortion), {values.begin(), values.end()}};
  if (lens.name == kThinPrism) return thin_prism_distortion(row, values);
  if (lens.distortion == "none" || lens.distortion == "fov") return out;
  if (out.coefficients.size() < 4) out.coefficients.resize(4, 0.0);
  return lens.distortion == "equidistant" ? out : parse_opencv_distortion(row.where, out.coefficients);
}

}  // namespace

namespace {

/// Reads little-endian values from the front of a text.
class BinaryCameras {
 public:
  BinaryCameras(std::string_view bytes, std::string file) : rest_(bytes), file_(std::move(file)) {}

  template <class Number>
  Number take() {
    if (rest_.size() < sizeof(Number)) throw InputError(file_, "ends within a camera: copy the file again");
    Number value{};
    std::memcpy(&value, rest_.data(), sizeof(Number));
    rest_.remove_prefix(sizeof(Number));
    return value;
  }

 private:
  std::string_view rest_;
  std::string file_;
};

/// The content of cameras.bin as that of cameras.txt.
std::string text_of_binary(std::string_view bytes, const std::string& file) {
  BinaryCameras cameras(bytes, file);
  std::string text;
  const auto count = cameras.take<std::uint64_t>();
  for (std::uint64_t i = 0; i < count; ++i) {
    const auto id = cameras.take<std::uint32_t>();
    const auto model = cameras.take<std::int32_t>();
    if (model < 0 || static_cast<std::size_t>(model) >= kLenses.size())
      throw InputError(file, "camera " + std::to_string(id) + ": the camera model of number " + std::to_string(model) +
                                 " is not supported");
    const ColmapLens& lens = kLenses[static_cast<std::size_t>(model)];
    text += std::to_string(id) + " " + std::string(lens.name);
    for (int side = 0; side < 2; ++side) text += " " + std::to_string(cameras.take<std::uint64_t>());
    for (std::size_t k = 0; k < (lens.one_focal ? 3 : 4) + lens.coefficients; ++k) {
      text += ' ';
      base::append_number(text, cameras.take<double>());
    }
    text += '\n';
  }
  return text;
}

}  // namespace

std::string colmap_text(std::string bytes, const std::string& file) {
  return is_colmap_binary(bytes) ? text_of_binary(bytes, file) : bytes;
}

bool is_colmap_binary(std::string_view bytes) {
  // the number of cameras, then an id, a model and two sides: eight bytes each but the two in the middle
  constexpr std::size_t kHead = 32;
  constexpr std::uint64_t kMostCameras = 1U << 20, kMostModels = 32;
  if (bytes.size() < kHead) return false;
  std::uint64_t count = 0, width = 0;
  std::int32_t model = 0;
  std::memcpy(&count, bytes.data(), sizeof(count));
  std::memcpy(&model, bytes.data() + 12, sizeof(model));
  std::memcpy(&width, bytes.data() + 16, sizeof(width));
  return count > 0 && count < kMostCameras && model >= 0 && model < static_cast<std::int32_t>(kMostModels) &&
         width > 0 && width <= static_cast<std::uint64_t>(kMaxImageSide_px);
}

Calibration read_colmap_cameras(const std::filesystem::path& file, std::optional<std::int64_t> camera_id) {
  const std::string name = file.string();
  const std::string text = colmap_text(base::read_text(file, kMaxCalibrationBytes), name);
  const std::vector<Row> rows = rows_of(text, name);
  const Row& row = chosen(rows, camera_id, name);
  const ColmapLens& lens = lens_of(row);
  const std::vector<double> all = parameters_of(row, lens);
  const std::array<double, 4> focal{all[0], all[1], all[2] - kPixelCentre, all[3] - kPixelCentre};
  const NamedDistortion distortion = distortion_of(row, lens, std::span(all).subspan(4));
  Calibration calibration;
  calibration.assumes_T_cam_imu = true;
  calibration.camera = make_camera(row.where, {distortion.name, focal, distortion.coefficients,
                                               side_of(row, 2, "WIDTH"), side_of(row, 3, "HEIGHT")});
  return calibration;
}

}  // namespace tileflight::imaging
