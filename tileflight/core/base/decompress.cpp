#include "tileflight/core/base/decompress.h"

#include <lzf.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <limits>
#include <memory>

#include "tileflight/core/base/input_error.h"

namespace tileflight::base {

namespace {

constexpr std::size_t kMost = std::numeric_limits<unsigned>::max();

using Bytes = std::span<const std::byte>;

/// A zlib stream; `window_bits` selects its format.
class Inflater {
 public:
  Inflater(Bytes bytes, int window_bits, const std::string& name) : rest_(bytes), name_(name) {
    if (inflateInit2(&stream_, window_bits) != Z_OK) throw InputError(name, "cannot be unpacked (zlib)");
  }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
  ~Inflater() { inflateEnd(&stream_); }

  /// Appends the next output, at most `room` bytes. False: the stream has ended.
  bool append(std::vector<std::byte>& out, std::size_t room) {
    const std::size_t before = out.size();
    out.resize(before + room);
    stream_.next_out = reinterpret_cast<Bytef*>(out.data() + before);
    stream_.avail_out = static_cast<uInt>(room);
    const int status = step();
    out.resize(out.size() - stream_.avail_out);
    if (status == Z_STREAM_END) return false;
    if (status != Z_OK && status != Z_BUF_ERROR) throw InputError(name_, "its compressed data are malformed");
    if (stream_.avail_out > 0) throw InputError(name_, "its compressed data are truncated");
    return true;
  }

  /// The input after the end of the stream.
  Bytes rest() const { return rest_.last(rest_.size() - fed_ + stream_.avail_in); }

 private:
  /// zlib counts in 32 bits, so the input is passed in pieces.
  int step() {
    while (true) {
      if (stream_.avail_in == 0) feed();
      const int status = ::inflate(&stream_, Z_NO_FLUSH);
      if (status != Z_OK || stream_.avail_out == 0 || (stream_.avail_in == 0 && fed_ == rest_.size())) return status;
    }
  }

  void feed() {
    const std::size_t piece = std::min<std::size_t>(rest_.size() - fed_, 1U << 30U);
    stream_.next_in = const_cast<Bytef*>(reinterpret_cast<const Bytef*>(rest_.data() + fed_));
    stream_.avail_in = static_cast<uInt>(piece);
    fed_ += piece;
  }

  Bytes rest_;
  std::string name_;
  std::size_t fed_ = 0;
  z_stream stream_{};
};

/// Appends the output of a whole stream; returns the input after it.
Bytes append_stream(Bytes bytes, int window_bits, std::size_t max_bytes, const std::string& name,
                    std::vector<std::byte>& out) {
  Inflater inflater(bytes, window_bits, name);
  std::size_t room = std::max<std::size_t>(4 * std::min(bytes.size(), std::size_t{1} << 24U), 4096);
  while (true) {
    const std::size_t left = max_bytes - out.size();
    // One byte above the limit distinguishes a stream that ends there from a longer one.
    const bool more = inflater.append(out, std::min(room, left + 1));
    if (out.size() > max_bytes) {
      throw InputError(name, "unpacks to more than the limit of " + std::to_string(max_bytes) + " bytes");
    }
    if (!more) return inflater.rest();
    room = std::min(2 * room, std::size_t{1} << 26U);
  }
}

}  // namespace

std::optional<std::string> lzf_decompress(std::string_view input, std::size_t size) {
  if (input.size() > kMost || size > kMost) return std::nullopt;
  if (input.empty() || size == 0) return input.empty() && size == 0 ? std::optional<std::string>("") : std::nullopt;
  std::string output(size, '\0');
  const unsigned written = ::lzf_decompress(input.data(), static_cast<unsigned>(input.size()), output.data(),
                                            static_cast<unsigned>(output.size()));
  if (written != size) return std::nullopt;
  return output;
}

std::string lzf_compress(std::string_view input) {
  if (input.empty()) return {};
  const std::size_t worst = input.size() + input.size() / 32 + 64;  // one control byte per 32 literals
  if (worst > kMost) throw InputError("LZF", "cannot compress 4 GB and more at once");
  std::string output(worst, '\0');
  output.resize(::lzf_compress(input.data(), static_cast<unsigned>(input.size()), output.data(),
                               static_cast<unsigned>(output.size())));
  return output;
}

bool is_gzip(Bytes bytes) {
  return bytes.size() >= 3 && bytes[0] == std::byte{0x1F} && bytes[1] == std::byte{0x8B} && bytes[2] == std::byte{8};
}

std::vector<std::byte> gunzip(Bytes bytes, std::size_t max_bytes, const std::string& name) {
  constexpr int kGzip = 15 + 16;
  std::vector<std::byte> out;
  // Consecutive members form one file (RFC 1952, section 2.2); anything else after them is padding.
  while (is_gzip(bytes)) bytes = append_stream(bytes, kGzip, max_bytes, name, out);
  return out;
}

std::vector<std::byte> inflate(Bytes bytes, std::size_t size, const std::string& name) {
  constexpr int kRaw = -15;
  std::vector<std::byte> out;
  append_stream(bytes, kRaw, size, name, out);
  if (out.size() != size) throw InputError(name, "unpacks to fewer bytes than it should");
  return out;
}

std::vector<std::byte> decompress_zstd(Bytes bytes, std::size_t size, const std::string& name) {
  // No real file compresses better; a declared size alone must not cause an allocation.
  constexpr std::size_t kBestRatio = 1U << 16U;
  if (size / kBestRatio > bytes.size()) throw InputError(name, "declares more bytes than its data can unpack to");
  std::vector<std::byte> out(size);
  const std::size_t written = ZSTD_decompress(out.data(), out.size(), bytes.data(), bytes.size());
  if (ZSTD_isError(written) != 0U) throw InputError(name, "its Zstandard data are malformed");
  if (written != size) throw InputError(name, "unpacks to fewer bytes than it should");
  return out;
}

}  // namespace tileflight::base
