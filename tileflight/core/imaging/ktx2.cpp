#include "tileflight/core/imaging/ktx2.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <vector>

#include "tileflight/core/base/decompress.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/imaging/etc1s.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/core/imaging/uastc.h"

namespace tileflight::imaging {
namespace {

using Bytes = std::span<const std::byte>;

constexpr std::size_t kHeaderBytes = 80;
constexpr std::size_t kLevelBytes = 24;
constexpr std::uint32_t kBasisLz = 1;
constexpr std::uint32_t kZstandard = 2;
constexpr unsigned kEtc1s = 163;
constexpr unsigned kUastc = 166;
constexpr unsigned kSrgbTransfer = 2;
// Khronos Data Format Specification 1.3, section 5: samples follow the total size and a header of 24 bytes.
constexpr std::size_t kSamplesAt = 28;
constexpr std::size_t kSampleBytes = 16;
constexpr unsigned kEtc1sGreen = 4;  // KHR_DF_CHANNEL_ETC1S_GGG
constexpr unsigned kUastcRgba = 3;   // KHR_DF_CHANNEL_UASTC_RGBA

Bytes part(Bytes bytes, std::uint64_t offset, std::uint64_t length, const char* what, const std::string& name) {
  if (offset > bytes.size() || length > bytes.size() - offset) {
    throw InputError(name, std::string(what) + " of the KTX2 lies outside the file");
  }
  return bytes.subspan(static_cast<std::size_t>(offset), static_cast<std::size_t>(length));
}

/// Section 3, "KTX File Structure": one level of a 2D texture.
struct Ktx2 {
  std::uint32_t vk_format = 0;
  int width = 0;
  int height = 0;
  std::uint32_t levels = 1;
  std::uint32_t scheme = 0;
  unsigned color_model = 0;
  std::size_t channels = 0;    ///< that the descriptor lists
  unsigned first_channel = 0;  ///< its identifier, whose meaning depends on the colour model
  unsigned last_channel = 0;
  bool srgb = false;
  std::uint32_t level = 0;  ///< requested level; width and height are those of the level
  Bytes level_data;
  Bytes global_data;
};

Ktx2 parse(Bytes bytes, const std::string& name, std::int64_t max_pixels, std::uint32_t level) {
  if (bytes.size() < kHeaderBytes + kLevelBytes) throw InputError(name, "the KTX2 is truncated");
  Ktx2 out;
  out.vk_format = base::read_raw<std::uint32_t>(bytes, 12);
  const auto width = base::read_raw<std::uint32_t>(bytes, 20);
  const auto height = base::read_raw<std::uint32_t>(bytes, 24);
  const auto depth = base::read_raw<std::uint32_t>(bytes, 28);
  const auto layers = base::read_raw<std::uint32_t>(bytes, 32);
  const auto faces = base::read_raw<std::uint32_t>(bytes, 36);
  if (depth > 1 || layers > 1 || faces != 1) throw InputError(name, "the KTX2 is not a single two-dimensional image");
  constexpr std::uint32_t kLargestSide = 1U << 16U;
  if (width == 0 || height == 0 || width > kLargestSide || height > kLargestSide ||
      std::int64_t{width} * height > max_pixels) {
    throw InputError(name, "the KTX2 has " + std::to_string(width) + " x " + std::to_string(height) +
                               " pixels, more than the limit of " + std::to_string(max_pixels));
  }
  out.levels = std::max(base::read_raw<std::uint32_t>(bytes, 40), 1U);
  if (out.levels > 17) throw InputError(name, "the KTX2 has too many mipmap levels");
  if (level >= out.levels) throw InputError(name, "the KTX2 has no level " + std::to_string(level));
  out.level = level;
  out.width = static_cast<int>(std::max(width >> level, 1U));
  out.height = static_cast<int>(std::max(height >> level, 1U));
  out.scheme = base::read_raw<std::uint32_t>(bytes, 44);
  const Bytes descriptor = part(bytes, base::read_raw<std::uint32_t>(bytes, 48),
                                base::read_raw<std::uint32_t>(bytes, 52), "descriptor", name);
  if (descriptor.size() < 16) throw InputError(name, "the data format descriptor of the KTX2 is truncated");
  out.color_model = std::to_integer<unsigned>(descriptor[12]);
  out.srgb = std::to_integer<unsigned>(descriptor[14]) == kSrgbTransfer;
  if (descriptor.size() > kSamplesAt) out.channels = (descriptor.size() - kSamplesAt) / kSampleBytes;
  const auto channel = [&](std::size_t i) {
    return std::to_integer<unsigned>(descriptor[kSamplesAt + kSampleBytes * i + 3]) & 15U;
  };
  if (out.channels > 0) out.first_channel = channel(0);
  if (out.channels > 0) out.last_channel = channel(out.channels - 1);
  out.global_data = part(bytes, base::read_raw<std::uint64_t>(bytes, 64), base::read_raw<std::uint64_t>(bytes, 72),
                         "global data", name);
  const Bytes index = part(bytes, kHeaderBytes + kLevelBytes * level, kLevelBytes, "level index", name);
  out.level_data =
      part(bytes, base::read_raw<std::uint64_t>(index, 0), base::read_raw<std::uint64_t>(index, 8), "level", name);
  return out;
}

enum class Slice { kColor, kAlpha };

/// Appendix "BasisLZ Global Data": counts and lengths, a description of each level, the codebooks. Returns an empty
/// image if there is no such slice.
RgbImage decode_basis_lz(const Ktx2& file, Slice which, const std::string& name) {
  constexpr std::size_t kHeader = 20;
  constexpr std::size_t kDescription = 20;
  const Bytes data = file.global_data;
  const std::size_t books_at = kHeader + kDescription * file.levels;
  if (data.size() < books_at) throw InputError(name, "the BasisLZ global data are truncated");
  const std::uint64_t endpoint_bytes = base::read_raw<std::uint32_t>(data, 4);
  const std::uint64_t selector_bytes = base::read_raw<std::uint32_t>(data, 8);
  const std::uint64_t table_bytes = base::read_raw<std::uint32_t>(data, 12);
  const Bytes endpoints = part(data, books_at, endpoint_bytes, "endpoints", name);
  const Bytes selectors = part(data, books_at + endpoint_bytes, selector_bytes, "selectors", name);
  const Bytes tables = part(data, books_at + endpoint_bytes + selector_bytes, table_bytes, "tables", name);
  constexpr std::uint32_t kPredictedFrame = 2;
  const Bytes described = data.subspan(kHeader + kDescription * file.level, kDescription);
  if ((base::read_raw<std::uint32_t>(described, 0) & kPredictedFrame) != 0)
    throw InputError(name, "the KTX2 is a video, which is not supported");
  const std::size_t at = which == Slice::kColor ? 4 : 12;
  const Bytes slice = part(file.level_data, base::read_raw<std::uint32_t>(described, at),
                           base::read_raw<std::uint32_t>(described, at + 4),
                           which == Slice::kColor ? "colour slice" : "alpha slice", name);
  if (which == Slice::kAlpha && slice.empty()) return {};
  const Etc1sCodebooks books(base::read_raw<std::uint16_t>(data, 0), endpoints, base::read_raw<std::uint16_t>(data, 2),
                             selectors, tables, name);
  return books.decode_slice(slice, file.width, file.height, name);
}

/// The `size` bytes of the level, decompressed if Zstandard was used; `unpacked` then owns them.
Bytes decompress_level(const Ktx2& file, std::size_t size, std::vector<std::byte>& unpacked, const std::string& name) {
  if (file.scheme == kZstandard) unpacked = base::decompress_zstd(file.level_data, size, name);
  const Bytes bytes = file.scheme == kZstandard ? Bytes(unpacked) : file.level_data;
  if (bytes.size() < size) throw InputError(name, "the KTX2 has fewer pixels than its header declares");
  return bytes;
}

RgbImage decode_uastc_level(const Ktx2& file, const std::string& name) {
  std::vector<std::byte> unpacked;
  const Bytes bytes = decompress_level(file, uastc_bytes(file.width, file.height), unpacked, name);
  return decode_uastc(bytes, file.width, file.height, file.srgb, name);
}

/// Bytes per pixel of the supported uncompressed formats; 0: unsupported.
std::size_t plain_pixel_bytes(std::uint32_t vk_format) {
  if (vk_format == 23 || vk_format == 29) return 3;  // VK_FORMAT_R8G8B8_UNORM, _SRGB
  if (vk_format == 37 || vk_format == 43) return 4;  // VK_FORMAT_R8G8B8A8_UNORM, _SRGB
  return 0;
}

GrayImage decode_uastc_level_alpha(const Ktx2& file, const std::string& name) {
  if (file.channels > 0 && file.first_channel != kUastcRgba) return {};
  std::vector<std::byte> unpacked;
  const Bytes bytes = decompress_level(file, uastc_bytes(file.width, file.height), unpacked, name);
  return decode_uastc_alpha(bytes, file.width, file.height, name);
}

/// One channel of a slice, in which all three are equal.
GrayImage green_of(const RgbImage& slice) {
  GrayImage out(slice.width, slice.height);
  std::ranges::transform(slice.pixels, out.pixels.begin(), [](const Rgb8& pixel) { return pixel[1]; });
  return out;
}

RgbImage decode_plain(const Ktx2& file, std::size_t pixel_bytes, const std::string& name) {
  RgbImage image(file.width, file.height);
  std::vector<std::byte> unpacked;
  const Bytes bytes = decompress_level(file, image.pixels.size() * pixel_bytes, unpacked, name);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      image.pixels[i][c] = std::to_integer<std::uint8_t>(bytes[i * pixel_bytes + c]);
    }
  }
  return image;
}

GrayImage decode_plain_alpha(const Ktx2& file, const std::string& name) {
  GrayImage alpha(file.width, file.height);
  std::vector<std::byte> unpacked;
  const Bytes bytes = decompress_level(file, 4 * alpha.pixels.size(), unpacked, name);
  for (std::size_t i = 0; i < alpha.pixels.size(); ++i)
    alpha.pixels[i] = std::to_integer<std::uint8_t>(bytes[4 * i + 3]);
  return alpha;
}

/// Tells how the pixels of a level are stored.
enum class Storage { kBasisLz, kUastc, kPlain };

Storage storage_of(const Ktx2& file, const std::string& name) {
  if (file.vk_format == 0 && file.color_model == kEtc1s && file.scheme == kBasisLz) return Storage::kBasisLz;
  const bool whole_levels = file.scheme == 0 || file.scheme == kZstandard;
  if (file.vk_format == 0 && file.color_model == kUastc && whole_levels) return Storage::kUastc;
  if (plain_pixel_bytes(file.vk_format) > 0 && whole_levels) return Storage::kPlain;
  throw InputError(name, "the KTX2 has Vulkan format " + std::to_string(file.vk_format) + ", colour model " +
                             std::to_string(file.color_model) + " and scheme " + std::to_string(file.scheme) +
                             ", which are not supported; ETC1S, UASTC and plain RGB are");
}

}  // namespace

bool is_ktx2(Bytes bytes) {
  static constexpr std::array<unsigned char, 12> kMagic = {0xAB, 'K',  'T',  'X',  ' ',  '2',
                                                           '0',  0xBB, 0x0D, 0x0A, 0x1A, 0x0A};
  return bytes.size() >= kMagic.size() && std::memcmp(bytes.data(), kMagic.data(), kMagic.size()) == 0;
}

RgbImage decode_ktx2(Bytes bytes, const std::string& name, std::int64_t max_pixels, std::uint32_t level) {
  const Ktx2 file = parse(bytes, name, max_pixels, level);
  const Storage storage = storage_of(file, name);
  if (storage == Storage::kBasisLz) return decode_basis_lz(file, Slice::kColor, name);
  if (storage == Storage::kUastc) return decode_uastc_level(file, name);
  return decode_plain(file, plain_pixel_bytes(file.vk_format), name);
}

GrayImage decode_ktx2_alpha(Bytes bytes, const std::string& name, std::int64_t max_pixels) {
  const Ktx2 file = parse(bytes, name, max_pixels, 0);
  const Storage storage = storage_of(file, name);
  if (storage == Storage::kUastc) return decode_uastc_level_alpha(file, name);
  if (storage == Storage::kPlain)
    return plain_pixel_bytes(file.vk_format) == 4 ? decode_plain_alpha(file, name) : GrayImage();
  if (file.channels > 1 && file.last_channel == kEtc1sGreen) return {};
  return green_of(decode_basis_lz(file, Slice::kAlpha, name));
}

RgbImage decode_texture(Bytes bytes, const std::string& name, std::int64_t max_pixels) {
  return is_ktx2(bytes) ? decode_ktx2(bytes, name, max_pixels) : decode_rgb(bytes, name, {.max_pixels = max_pixels});
}

}  // namespace tileflight::imaging
