
#include <zstd.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <memory>
#include <stdexcept>

#include "tileflight/core/base/decompress.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/simd.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::imaging {
namespace {

/// In the machine's byte order, by which the mark differs, too.
struct QuickHeader {
  std::uint64_t mark = 0x3130434950465431;
  std::uint32_t width = 0, height = 0;
};

constexpr int kQuickLevel = 1;
constexpr std::size_t kChannels = 3;

/// Differences of a row to the pixels on the left; the first pixel stays.
TILEFLIGHT_WIDE_VECTORS void difference_row(const std::uint8_t* row, std::size_t bytes, std::uint8_t* out) {
  using Bytes = std::uint8_t __attribute__((vector_size(32)));
  std::size_t i = std::min(bytes, kChannels);
  std::memcpy(out, row, i);
  for (; i + sizeof(Bytes) <= bytes; i += sizeof(Bytes)) {
    Bytes here, left;
    std::memcpy(&here, row + i, sizeof(here));
    std::memcpy(&left, row + i - kChannels, sizeof(left));
    here -= left;
    std::memcpy(out + i, &here, sizeof(here));
  }
  for (; i < bytes; ++i) out[i] = static_cast<std::uint8_t>(row[i] - row[i - kChannels]);
}

}  // namespace

std::vector<std::byte> encode_quick_picture(const RgbImage& image) {
  const QuickHeader header{.width = static_cast<std::uint32_t>(image.width),
                           .height = static_cast<std::uint32_t>(image.height)};
  const std::size_t row_bytes = kChannels * header.width, size = row_bytes * header.height;
  // Not vectors, which are cleared first.
  const auto differences = std::make_unique_for_overwrite<std::uint8_t[]>(size);
  for (int y = 0; y < image.height; ++y)
    difference_row(image.row(y)->data(), row_bytes, &differences[static_cast<std::size_t>(y) * row_bytes]);
  const std::size_t most = ZSTD_compressBound(size);
  const auto compressed = std::make_unique_for_overwrite<std::byte[]>(most);
  const std::size_t written = ZSTD_compress(compressed.get(), most, differences.get(), size, kQuickLevel);
  if (ZSTD_isError(written) != 0U) throw std::runtime_error("Zstandard: an image was not compressed");
  std::vector<std::byte> bytes(sizeof(header) + written);
  std::memcpy(bytes.data(), &header, sizeof(header));
  std::memcpy(bytes.data() + sizeof(header), compressed.get(), written);
  return bytes;
}

RgbImage decode_quick_picture(std::span<const std::byte> bytes, const std::string& name) {
  QuickHeader header;
  const std::uint64_t mark = header.mark;
  if (bytes.size() < sizeof(header)) throw InputError(name, "is no kept image");
  std::memcpy(&header, bytes.data(), sizeof(header));
  const std::uint64_t pixels = std::uint64_t{header.width} * header.height;
  if (header.mark != mark || pixels == 0 || pixels > static_cast<std::uint64_t>(DecodeLimits().max_pixels))
    throw InputError(name, "is no kept image");
  const std::vector<std::byte> differences =
      base::decompress_zstd(bytes.subspan(sizeof(header)), kChannels * pixels, name);
  RgbImage image(static_cast<int>(header.width), static_cast<int>(header.height));
  const std::byte* from = differences.data();
  for (int y = 0; y < image.height; ++y) {
    Rgb8 pixel{};
    for (int x = 0; x < image.width; ++x) {
      for (std::uint8_t& value : pixel)
        value = static_cast<std::uint8_t>(value + std::to_integer<std::uint8_t>(*from++));
      image(x, y) = pixel;
    }
  }
  return image;
}

}  // namespace tileflight::imaging
