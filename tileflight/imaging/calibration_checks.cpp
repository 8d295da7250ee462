#include "tileflight/imaging/calibration_checks.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tileflight/geometry/input_error.h"
#include "tileflight/geometry/text_fields.h"

namespace tileflight::imaging {

namespace {

void require_count(const std::string& file, const std::string& what, std::size_t wanted, std::size_t found) {
  if (wanted == found) return;
  throw InputError(file, what + " must have " + std::to_string(wanted) + " numbers, not " + std::to_string(found));
}

void require_finite(const std::string& file, const std::string& what, std::span<const double> values) {
  if (std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); })) return;
  throw InputError(file, what + " must be finite numbers");
}

std::size_t coefficient_count(const std::string& file, const std::string& distortion) {
  if (distortion == "radtan" || distortion == "equidistant") return 4;
  if (distortion == "fov") return 1;
  if (distortion == "none") return 0;
  throw InputError(file, "distortion model \"" + distortion + "\" is not known: use radtan, equidistant, fov or none");
}

std::array<double, 4> four(std::span<const double> values) { return {values[0], values[1], values[2], values[3]}; }

}  // namespace

Camera checked_camera(const std::string& file, const LensNumbers& numbers) {
  const std::size_t wanted = coefficient_count(file, numbers.distortion);
  const std::span<const double> k = numbers.distortion_coefficients;
  const std::span<const double> f = numbers.focal;
  require_count(file, "intrinsics", 4, f.size());
  require_finite(file, "intrinsics", f);
  require_count(file, "distortion coefficients of \"" + numbers.distortion + "\"", wanted, k.size());
  require_finite(file, "distortion coefficients", k);
  if (!(f[0] > 0.0 && f[1] > 0.0)) throw InputError(file, "focal lengths must be above 0 pixels");
  if (numbers.width <= 0 || numbers.height <= 0 || numbers.width > kMaxImageSide_px ||
      numbers.height > kMaxImageSide_px)
    throw InputError(file, "resolution must be two numbers from 1 to " + std::to_string(kMaxImageSide_px));
  if (numbers.distortion == "fov" && !(k[0] >= 0.0 && k[0] < std::numbers::pi))
    throw InputError(file, "the field-of-view parameter must be from 0 to below pi radians");

  if (numbers.distortion == "equidistant")
    return {KannalaBrandt{f[0], f[1], f[2], f[3], four(k)}, numbers.width, numbers.height};
  if (numbers.distortion == "fov") return {FovModel{f[0], f[1], f[2], f[3], k[0]}, numbers.width, numbers.height};
  const std::array<double, 4> d = k.empty() ? std::array<double, 4>{} : four(k);
  return {PinholeRadtan{f[0], f[1], f[2], f[3], d}, numbers.width, numbers.height};
}

std::string number_text(double value) {
  std::string text;
  geometry::append_number(text, value);
  // "1e-08" is a word to YAML 1.1 readers (PyYAML, so Kalibr's own tools); "1.0e-08" is a number to all.
  const std::size_t exponent = text.find('e');
  if (exponent != std::string::npos && text.find('.') == std::string::npos) text.insert(exponent, ".0");
  return text;
}

}  // namespace tileflight::imaging
