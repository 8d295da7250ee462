#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

#include "tileflight/core/imaging/image.h"

namespace tileflight::imaging {

/// Writes an OpenEXR file of several 32-bit float channels (lossless ZIP compression). `pixels`: height x width x
/// channels, channels interleaved. Throws InputError (file, cause) if it cannot be written.
void write_exr_channels(const std::filesystem::path& file, int width, int height, std::span<const float> pixels,
                        std::span<const std::string> channels);

/// Overload for an image whose pixels are arrays of channel values.
template <std::size_t N>
void write_exr_channels(const std::filesystem::path& file, const Image<std::array<float, N>>& image,
                        const std::array<std::string, N>& channels) {
  static_assert(sizeof(std::array<float, N>) == N * sizeof(float));
  const float* first = image.pixels.empty() ? nullptr : image.pixels.front().data();
  write_exr_channels(file, image.width, image.height, {first, N * image.pixels.size()}, channels);
}

/// Reads one channel by its name. Throws InputError (file, cause) if it does not exist.
FloatImage read_exr_channel(const std::filesystem::path& file, const std::string& channel);

}  // namespace tileflight::imaging
