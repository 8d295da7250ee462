#pragma once

#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/base/files.h"

namespace tileflight::tests {

/// A number's bytes, the highest first.
template <class Number>
std::string big_endian(Number value) {
  const auto* const bytes = reinterpret_cast<const char*>(&value);
  return {std::make_reverse_iterator(bytes + sizeof value), std::make_reverse_iterator(bytes)};
}

/// A box of ISO/IEC 14496-12: its size, its name, its content.
inline std::string mp4_box(std::string_view name, const std::string& content) {
  return big_endian(static_cast<std::uint32_t>(8 + content.size())) + std::string(name) + content;
}

/// Adds a track of metadata to an MP4 whose last box is `moov`, as cameras add theirs: samples of `period_ms` each, of
/// the kind that the four letters name. `user_data`: boxes of moov/udta; empty: none.
inline void add_metadata_track(const std::filesystem::path& file, std::string_view kind,
                               const std::vector<std::string>& samples, std::uint32_t period_ms,
                               const std::string& user_data = "") {
  const std::string video = base::read_raw(file);
  std::size_t moov = 0;
  for (std::size_t at = 0; at + 8 <= video.size();) {
    std::uint32_t size = 0;
    for (std::size_t i = 0; i < 4; ++i) size = size << 8U | static_cast<unsigned char>(video[at + i]);
    if (size < 8) throw std::runtime_error("a box of 64 bits");
    if (video.substr(at + 4, 4) == "moov") moov = at;
    at += size;
  }
  const auto u32 = [](std::size_t value) { return big_endian(static_cast<std::uint32_t>(value)); };
  const auto count = samples.size();
  std::string bytes, sizes;
  for (const std::string& sample : samples) {
    bytes += sample;
    sizes += u32(sample.size());
  }
  const auto with_offset = [&](std::size_t offset) {
    const std::string description = mp4_box(kind, std::string(6, '\0') + big_endian(std::uint16_t{1}));
    const std::string table = mp4_box("stsd", u32(0) + u32(1) + description) +
                              mp4_box("stts", u32(0) + u32(1) + u32(count) + u32(period_ms)) +
                              mp4_box("stsc", u32(0) + u32(1) + u32(1) + u32(count) + u32(1)) +
                              mp4_box("stsz", u32(0) + u32(0) + u32(count) + sizes) +
                              mp4_box("stco", u32(0) + u32(1) + u32(offset));
    const std::string media = mp4_box("mdhd", u32(0) + u32(0) + u32(0) + u32(1000) + u32(count * period_ms) + u32(0)) +
                              mp4_box("hdlr", u32(0) + u32(0) + "meta" + std::string(12, '\0') + "metadata" + '\0') +
                              mp4_box("minf", mp4_box("nmhd", u32(0)) + mp4_box("stbl", table));
    const std::string header = u32(7) + u32(0) + u32(0) + u32(99) + u32(0) + u32(0) + std::string(60, '\0');
    const std::string track = mp4_box("trak", mp4_box("tkhd", header) + mp4_box("mdia", media));
    const std::string more = track + (user_data.empty() ? "" : mp4_box("udta", user_data));
    return video.substr(0, moov) + mp4_box("moov", video.substr(moov + 8) + more);
  };
  const std::size_t size = with_offset(0).size();
  std::filesystem::remove(file);
  base::write_file(file, with_offset(size + 8) + mp4_box("mdat", bytes));
}

}  // namespace tileflight::tests
