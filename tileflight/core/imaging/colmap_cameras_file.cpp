// COLMAP's cameras.txt and cameras.bin: https://colmap.github.io/format.html#cameras-txt, models of
// https://colmap.github.io/cameras.html.
#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <numbers>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/calibration_checks.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::imaging {

namespace {

constexpr double kPixelCentre = 0.5;       ///< centre of the first pixel in COLMAP; 0 here
constexpr std::size_t kLeadingFields = 4;  ///< CAMERA_ID MODEL WIDTH HEIGHT

constexpr std::string_view kThinPrism = "THIN_PRISM_FISHEYE", kRadTanThinPrism = "RAD_TAN_THIN_PRISM_FISHEYE";

/// The leading parameters of a lens: fx fy cx cy, f cx cy, or none of them.
enum class Focal { kTwo, kOne, kNone };

struct ColmapLens {
  std::string_view name;
  Focal focal;
  std::string_view distortion;  ///< Kalibr's name, "division" or "eucm"; missing coefficients are 0
  std::size_t coefficients = 0;

  std::size_t parameters() const { return coefficients + (focal == Focal::kNone ? 0 : focal == Focal::kOne ? 3 : 4); }
};

/// The lenses stand in the order of COLMAP's model ids (src/colmap/sensor/models.h).
constexpr std::array<ColmapLens, 18> kLenses{{{"SIMPLE_PINHOLE", Focal::kOne, "none", 0},
                                              {"PINHOLE", Focal::kTwo, "none", 0},
                                              {"SIMPLE_RADIAL", Focal::kOne, "radtan", 1},
                                              {"RADIAL", Focal::kOne, "radtan", 2},
                                              {"OPENCV", Focal::kTwo, "radtan", 4},
                                              {"OPENCV_FISHEYE", Focal::kTwo, "equidistant", 4},
                                              {"FULL_OPENCV", Focal::kTwo, "radtan", 8},
                                              {"FOV", Focal::kTwo, "fov", 1},
                                              {"SIMPLE_RADIAL_FISHEYE", Focal::kOne, "equidistant", 1},
                                              {"RADIAL_FISHEYE", Focal::kOne, "equidistant", 2},
                                              {kThinPrism, Focal::kTwo, "equidistant", 8},
                                              {kRadTanThinPrism, Focal::kTwo, "equidistant", 12},
                                              {"SIMPLE_DIVISION", Focal::kOne, "division", 1},
                                              {"DIVISION", Focal::kTwo, "division", 1},
                                              {"SIMPLE_FISHEYE", Focal::kOne, "equidistant", 0},
                                              {"FISHEYE", Focal::kTwo, "equidistant", 0},
                                              {"EUCM", Focal::kTwo, "eucm", 2},
                                              {"EQUIRECTANGULAR", Focal::kNone, "equirectangular", 2}}};

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

/// PARAMS, with fx and fy where they are one.
std::vector<double> parameters_of(const Row& row, const ColmapLens& lens) {
  const std::size_t wanted = lens.parameters();
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
  if (lens.focal == Focal::kOne) values.insert(values.begin(), values.front());
  return values;
}

/// The four coefficients of OpenCV's fisheye, where all others are 0.
NamedDistortion plain_fisheye(const Row& row, std::span<const double> k, const std::array<std::size_t, 4>& places,
                              const std::string& others) {
  for (std::size_t i = 0; i < k.size(); ++i)
    if (k[i] != 0.0 && std::ranges::find(places, i) == places.end())
      throw InputError(row.where, std::string(row.fields[1]) + " with " + others +
                                      " other than 0 is not supported: undistort the images (colmap "
                                      "image_undistorter), or let COLMAP refine the camera as OPENCV_FISHEYE");
  return {"equidistant", {k[places[0]], k[places[1]], k[places[2]], k[places[3]]}};
}

NamedDistortion distortion_of(const Row& row, const ColmapLens& lens, std::span<const double> values) {
  NamedDistortion out{std::string(lens.distortion), {values.begin(), values.end()}};
  if (lens.name == kThinPrism) return plain_fisheye(row, values, {0, 1, 4, 5}, "p1, p2, sx1 or sy1");
  if (lens.name == kRadTanThinPrism) return plain_fisheye(row, values, {0, 1, 2, 3}, "k4, k5, p0, p1 or s0 to s3");
  if (lens.distortion == "division") {
    if (values[0] == 0.0) return {"none", {}};
    throw InputError(row.where, std::string(lens.name) +
                                    " is not supported: undistort the images (colmap image_undistorter), or let "
                                    "COLMAP refine the camera as RADIAL");
  }
  if (lens.distortion == "none" || lens.distortion == "fov") return out;
  if (out.coefficients.size() < 4) out.coefficients.resize(4, 0.0);
  return lens.distortion == "equidistant" ? out : parse_opencv_distortion(row.where, out.coefficients);
}

/// theta / (2 pi) and phi / pi are shares of the panorama's width and height, from its centre.
Camera panorama_of(const Row& row, std::span<const double> sides, int width, int height) {
  const std::array<double, 4> intrinsics{sides[0] / (2.0 * std::numbers::pi), sides[1] / std::numbers::pi,
                                         0.5 * sides[0] - kPixelCentre, 0.5 * sides[1] - kPixelCentre};
  return make_camera(row.where, {"none", intrinsics, {}, width, height, "equirectangular"});
}

Camera camera_of(const Row& row) {
  const ColmapLens& lens = lens_of(row);
  const std::vector<double> all = parameters_of(row, lens);
  const int width = side_of(row, 2, "WIDTH"), height = side_of(row, 3, "HEIGHT");
  if (lens.focal == Focal::kNone) return panorama_of(row, all, width, height);
  const std::array<double, 4> focal{all[0], all[1], all[2] - kPixelCentre, all[3] - kPixelCentre};
  const std::span<const double> coefficients = std::span(all).subspan(4);
  if (lens.distortion == "eucm")
    return make_camera(row.where, {"none", focal, {}, width, height, "eucm", coefficients});
  const NamedDistortion distortion = distortion_of(row, lens, coefficients);
  return make_camera(row.where, {distortion.name, focal, distortion.coefficients, width, height});
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
    for (std::size_t k = 0; k < lens.parameters(); ++k) {
      text += ' ';
      base::append_number(text, cameras.take<double>());
    }
    text += '\n';
  }
  return text;
}

}  // namespace

std::string colmap_text(std::string bytes, const std::string& file) {
  if (is_colmap_binary(bytes)) return text_of_binary(bytes, file);
  return bytes;
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
  Calibration calibration;
  calibration.assumes_T_cam_imu = true;
  calibration.camera = camera_of(chosen(rows, camera_id, name));
  return calibration;
}

}  // namespace tileflight::imaging
