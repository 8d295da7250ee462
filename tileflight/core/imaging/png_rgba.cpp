#include <tbb/parallel_for.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <span>
#include <stdexcept>
#include <string_view>

#include "tileflight/core/imaging/image_files.h"

namespace tileflight::imaging {
namespace {

using PngBytes = std::vector<std::uint8_t>;

constexpr int kStripeRows = 128;
constexpr int kLevel = 1;

void append_big_endian(PngBytes& to, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) to.push_back(static_cast<std::uint8_t>(value >> shift));
}

/// W3C PNG specification, section 5.3: length, type, data, CRC over type and data.
void append_chunk(PngBytes& to, std::string_view type, std::span<const std::uint8_t> data) {
  append_big_endian(to, static_cast<std::uint32_t>(data.size()));
  const std::size_t begin = to.size();
  to.insert(to.end(), type.begin(), type.end());
  to.insert(to.end(), data.begin(), data.end());
  append_big_endian(
      to, static_cast<std::uint32_t>(crc32_z(0, to.data() + begin, static_cast<z_size_t>(to.size() - begin))));
}

/// Filtered rows of a stripe: the filter's number, then differences to the row above.
PngBytes filter_rows(const RgbImage& image, int begin, int end) {
  constexpr std::uint8_t kUp = 2;
  PngBytes rows;
  rows.reserve(static_cast<std::size_t>(end - begin) * (static_cast<std::size_t>(image.width) * 4 + 1));
  for (int y = begin; y < end; ++y) {
    rows.push_back(kUp);
    for (int x = 0; x < image.width; ++x) {
      const imaging::Rgb8 here = image(x, y);
      const imaging::Rgb8 above = y > 0 ? image(x, y - 1) : imaging::Rgb8{};
      for (std::size_t c = 0; c < 3; ++c) rows.push_back(static_cast<std::uint8_t>(here[c] - above[c]));
      rows.push_back(y > 0 ? 0 : 255);
    }
  }
  return rows;
}

struct Stripe {
  PngBytes deflated;
  uLong adler = 0;
  z_off_t size = 0;
};

/// A part of a raw deflate stream that ends on a byte boundary; the last one ends the stream.
Stripe deflate_rows(const PngBytes& rows, bool last) {
  z_stream stream{};
  if (deflateInit2(&stream, kLevel, Z_DEFLATED, -15, 8, Z_DEFAULT_STRATEGY) != Z_OK)
    throw std::runtime_error("zlib: out of memory");
  Stripe stripe;
  stripe.deflated.resize(deflateBound(&stream, rows.size()) + 64);
  stream.next_in = const_cast<Bytef*>(rows.data());  // zlib does not modify it
  stream.avail_in = static_cast<uInt>(rows.size());
  stream.next_out = stripe.deflated.data();
  stream.avail_out = static_cast<uInt>(stripe.deflated.size());
  deflate(&stream, last ? Z_FINISH : Z_SYNC_FLUSH);
  stripe.deflated.resize(stream.total_out);
  deflateEnd(&stream);
  stripe.adler = adler32_z(1, rows.data(), rows.size());
  stripe.size = static_cast<z_off_t>(rows.size());
  return stripe;
}

/// RFC 1950: a header of two bytes, the stream, the checksum of its content.
PngBytes zlib_stream(const RgbImage& image) {
  const int count = (image.height + kStripeRows - 1) / kStripeRows;
  std::vector<Stripe> stripes(static_cast<std::size_t>(count));
  tbb::parallel_for(0, count, [&](int i) {
    const int begin = i * kStripeRows;
    stripes[static_cast<std::size_t>(i)] =
        deflate_rows(filter_rows(image, begin, std::min(image.height, begin + kStripeRows)), i + 1 == count);
  });
  PngBytes all{0x78, 0x01};
  uLong adler = 1;
  for (const Stripe& stripe : stripes) {
    all.insert(all.end(), stripe.deflated.begin(), stripe.deflated.end());
    adler = adler32_combine(adler, stripe.adler, stripe.size);
  }
  append_big_endian(all, static_cast<std::uint32_t>(adler));
  return all;
}

}  // namespace

std::vector<std::uint8_t> encode_png_rgba(const RgbImage& image) {
  PngBytes png{0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
  PngBytes header;
  append_big_endian(header, static_cast<std::uint32_t>(image.width));
  append_big_endian(header, static_cast<std::uint32_t>(image.height));
  for (const std::uint8_t value : {8, 6, 0, 0, 0}) header.push_back(value);  // bits, RGBA, deflate, filters, in rows
  append_chunk(png, "IHDR", header);
  append_chunk(png, "IDAT", zlib_stream(image));
  append_chunk(png, "IEND", {});
  return png;
}

}  // namespace tileflight::imaging
