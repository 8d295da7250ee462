#include "tileflight/core/imaging/photometric.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::imaging {

namespace {

constexpr std::size_t kLevels = 256;
constexpr std::uintmax_t kMaxFileSize = std::uintmax_t{1} << 24;

std::vector<double> read_response(const std::filesystem::path& file) {
  const std::string text = base::read_text(file, kMaxFileSize);
  std::vector<double> values;
  for (const std::string_view field : base::split_fields(text, " \t\r\n")) {
    const double value = base::require_finite(file.string(), field);
    if (!values.empty() && value <= values.back())
      throw InputError(file.string(), "number " + std::to_string(values.size() + 1) + " does not increase");
    values.push_back(value);
  }
  if (values.size() < kLevels)
    throw InputError(file.string(), "must have at least 256 numbers, not " + std::to_string(values.size()));
  return values;
}

/// Resamples the table (longer for cameras of more than 8 bits) to 256 levels, rescaled to 0..255.
std::array<float, 256> resample_levels(const std::vector<double>& values) {
  std::array<float, 256> levels{};
  const double range = values.back() - values.front();
  for (std::size_t i = 0; i < kLevels; ++i) {
    const double at = static_cast<double>(i * (values.size() - 1)) / (kLevels - 1);
    const auto below = static_cast<std::size_t>(at);
    const double above = values[std::min(below + 1, values.size() - 1)];
    const double value = values[below] + (at - static_cast<double>(below)) * (above - values[below]);
    levels[i] = static_cast<float>(255.0 * (value - values.front()) / range);
  }
  return levels;
}

void require_increasing(const std::filesystem::path& file, const std::array<float, 256>& levels) {
  if (std::adjacent_find(levels.begin(), levels.end(), std::greater_equal<>()) != levels.end())
    throw InputError(file.string(), "two levels are too close together to invert the response");
}

/// Normalised by the brightest pixel. Black pixels carry no information and count as half a step.
FloatImage read_vignette(const std::filesystem::path& file) {
  const Gray16Image image = read_gray16(file);
  const std::uint16_t brightest = *std::max_element(image.pixels.begin(), image.pixels.end());
  if (brightest == 0) throw InputError(file.string(), "the vignette is black everywhere");
  FloatImage vignette(image.width, image.height);
  std::transform(image.pixels.begin(), image.pixels.end(), vignette.pixels.begin(), [&](std::uint16_t value) {
    return std::max(static_cast<float>(value), 0.5F) / static_cast<float>(brightest);
  });
  return vignette;
}

}  // namespace

PhotometricCalibration read_photometric(const std::filesystem::path& pcalib_file,
                                        const std::filesystem::path& vignette_file) {
  PhotometricCalibration calibration;
  std::iota(calibration.inverse_response.begin(), calibration.inverse_response.end(), 0.0F);
  if (!pcalib_file.empty()) {
    calibration.inverse_response = resample_levels(read_response(pcalib_file));
    require_increasing(pcalib_file, calibration.inverse_response);
  }
  if (!vignette_file.empty()) calibration.vignette = read_vignette(vignette_file);
  return calibration;
}

void write_pcalib(const std::filesystem::path& file, const std::array<float, 256>& inverse_response) {
  std::string text;
  for (const float value : inverse_response) {
    if (!text.empty()) text += ' ';
    base::append_number(text, value);
  }
  base::write_file(file, text + "\n");
}

void write_vignette(const std::filesystem::path& file, const FloatImage& vignette) {
  Gray16Image image(vignette.width, vignette.height);
  std::transform(vignette.pixels.begin(), vignette.pixels.end(), image.pixels.begin(), [](float value) {
    return static_cast<std::uint16_t>(std::clamp(std::lround(65535.0F * value), 1L, 65535L));
  });
  const std::vector<std::byte> bytes = encode_png(image);
  base::write_file(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace tileflight::imaging
