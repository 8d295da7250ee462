#pragma once

#include <array>
#include <filesystem>

#include "tileflight/core/imaging/image.h"

namespace tileflight::imaging {

/// TUM monoVO's photometric model: I = G(t V(x) B(x)). Engel, Usenko, Cremers, "A photometrically calibrated benchmark
/// for monocular visual odometry", arXiv 1607.02555, eq. 1.
struct PhotometricCalibration {
  std::array<float, 256> inverse_response{};  ///< G^-1: 8-bit value to irradiance, 0..255, strictly increasing
  FloatImage vignette;                        ///< V in (0, 1], same size as the image; empty: none known
};

/// Reads a photometric calibration. `pcalib.txt`: one line of at least 256 strictly increasing numbers (rescaled to
/// 0..255); `vignette.png`: 8 or 16 bit grey. Either path may be empty: identity. Throws InputError (file, cause).
PhotometricCalibration read_photometric(const std::filesystem::path& pcalib_file,
                                        const std::filesystem::path& vignette_file);
void write_pcalib(const std::filesystem::path& file, const std::array<float, 256>& inverse_response);
void write_vignette(const std::filesystem::path& file, const FloatImage& vignette);

}  // namespace tileflight::imaging
