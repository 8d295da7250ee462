#include "tileflight/experiments/report/data_blocks.h"

#include <nlohmann/json.hpp>

#include <zlib.h>

#include <bit>
#include <cassert>

namespace tileflight::report {
namespace {

static_assert(std::endian::native == std::endian::little, "blocks are written as they lie in memory");

void fill_up_to_four(std::string& bytes, char filling) { bytes.resize((bytes.size() + 3) / 4 * 4, filling); }

}  // namespace

nlohmann::json DataBlocks::add_bytes(std::string_view bytes) {
  fill_up_to_four(bytes_, '\0');
  const nlohmann::json place{{"at", bytes_.size()}, {"bytes", bytes.size()}};
  bytes_ += bytes;
  return place;
}

std::string DataBlocks::compress(const nlohmann::json& header) const {
  // Names come from files: invalid UTF-8 is replaced.
  const std::string words = header.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  const auto length = static_cast<std::uint32_t>(words.size());
  std::string plain(reinterpret_cast<const char*>(&length), sizeof(length));
  plain += words;
  fill_up_to_four(plain, ' ');
  plain += bytes_;
  uLongf size = compressBound(static_cast<uLong>(plain.size()));
  std::string packed(size, '\0');
  const int result = compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
                               reinterpret_cast<const Bytef*>(plain.data()), static_cast<uLong>(plain.size()), 6);
  assert(result == Z_OK);
  static_cast<void>(result);
  packed.resize(size);
  return packed;
}

}  // namespace tileflight::report
